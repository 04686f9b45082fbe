"""The tone curve of a display: pictures of grey steps that fill it to luminance over level.

    middle of each picture -> mean of green over its exposure -> monotone -> 1 at the brightest

A screen with one step in the middle of another shows the light of both, scattered by the lens: so
steps fill the screen, and the middle of a picture is what counts. The fitted curve, a power of the
level with an offset on a black of its own, only says how well displays of its kind explain the
steps.

References: Berns 1996, "Methods for characterizing CRT displays" (gain, offset, gamma).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from camkit.calibration.flat.picture import MOST_CLIPPED, check_one_camera, green_of
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.progress import counted
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.merging.survey import read_frame, without_pixels

FloatGrid = NDArray[np.float64]

MIDDLE: Final = 0.5
"""Side of what counts, of the picture's."""
LEAST_STEPS: Final = 3
FITTED_STEPS: Final = 5
_SURE: Final = 5.0
_OF_TWO: Final = 2**0.5
_SAME: Final = 1e-6
_LEAST: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One picture of a grey step.

    Attributes:
        path: The file.
        level: What the display was told.
        light: Mean of the middle over the exposure.
        error: Standard deviation of that mean.
    """

    path: Path
    level: float
    light: float
    error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerCurve:
    """Luminance = black + gain (level / top + offset)^gamma."""

    black: float
    gain: float
    offset: float
    gamma: float
    top: float

    def at(self, levels: FloatGrid) -> FloatGrid:
        """Return luminance at levels."""
        share = np.maximum(levels / self.top + self.offset, _LEAST)
        return np.asarray(self.black + self.gain * share**self.gamma)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToneFacts:
    """The measured tone curve of a display.

    Attributes:
        levels: (step,) increasing.
        luminance: (step,) never decreasing, 1 at the brightest.
        curve: Fitted to them; None for fewer than `FITTED_STEPS` steps.
        is_lit: (step,) whether its light stands out of the camera's black; the curve is fitted to
            those that do.
        notes: What the user should know.
    """

    levels: FloatGrid
    luminance: FloatGrid
    curve: PowerCurve | None
    is_lit: NDArray[np.bool_]
    notes: tuple[str, ...]

    @property
    def residuals(self) -> FloatGrid | None:
        """Return the deviations of fitted steps from the curve, as shares of it; NaN of others."""
        if self.curve is None:
            return None
        return np.where(self.is_lit, self.luminance / self.curve.at(self.levels) - 1, np.nan)

    def to_record(self) -> dict[str, Any]:
        """Return plain values; None where no curve was fitted."""
        rest, curve = self.residuals, self.curve
        residual = None if rest is None else 100 * np.sqrt(np.mean(rest[self.is_lit] ** 2))
        return {
            "levels": [float(level) for level in self.levels],
            "luminance": [float(f"{light:.6g}") for light in self.luminance],
            "residual_percent": None if residual is None else float(f"{residual:.3g}"),
            "gamma": None if curve is None else round(curve.gamma, 4),
            "notes": list(self.notes),
        }


def levels_of(text: str | Sequence[float], count: int) -> tuple[float, ...]:
    """Read the levels of pictures.

    Args:
        text: Numbers, or a text of them separated by commas, in the order of the pictures.
        count: Of the pictures.

    Raises:
        ContractError: If there is not one for each, one is no number >= 0, or one comes twice.
    """
    try:
        levels = tuple(map(float, text.split(",") if isinstance(text, str) else text))
    except ValueError:
        raise ContractError(
            f"{option_text('levels')} takes numbers separated by commas; got {text!r}"
        ) from None
    if len(levels) != count:
        raise ContractError(
            f"{option_text('levels')} states {len(levels)} levels for {count} pictures; state one "
            "for each"
        )
    if not all(0 <= level < np.inf for level in levels):
        raise ContractError(f"levels must be >= 0; got {text!r}")
    if len(set(levels)) < len(levels):
        raise ContractError(
            f"{option_text('levels')} states a level twice: {text!r}; give one picture of each"
        )
    return levels


def measure_tone(
    files: Sequence[Path], levels: Sequence[float], mosaic: MosaicOptions | None = None
) -> ToneFacts:
    """Measure the tone curve of a display.

    Args:
        files: Linear pictures, each of one grey step that fills the display.
        levels: What the display was told, one for each file.
        mosaic: What files do not say of themselves.

    Raises:
        ContractError: If there are too few steps, or a picture is given twice.
        DecodeError: If a picture cannot be used or is another camera's, exposures are stated by
            some only, or luminance falls from one level to the next.
    """
    if len(files) < LEAST_STEPS:
        raise ContractError(f"a tone curve needs {LEAST_STEPS} steps; got {len(files)}")
    if len({path.resolve() for path in files}) < len(files):
        raise ContractError("a picture is given twice; give one of each step")
    captures: list[Capture] = []
    readings = []
    steps_seen = list(zip(files, levels, strict=True))
    for path, level in counted(steps_seen, "reading", "pictures"):
        capture = read_frame(path, mosaic)
        light, error = _middle(path, capture)
        captures.append(without_pixels(capture))
        check_one_camera(captures[0], files[0], capture, path)
        readings.append((path, level, light, error))
    exposures, notes = exposures_of(files, captures)
    steps = [
        Step(path=path, level=level, light=light / t, error=error / t)
        for (path, level, light, error), t in zip(readings, exposures, strict=True)
    ]
    steps.sort(key=lambda step: step.level)
    _check_rising(steps)
    rising = _monotone([max(step.light, 0.0) for step in steps])
    luminance, at = rising / rising[-1], np.array([step.level for step in steps])
    is_lit = np.array([step.light > _SURE * step.error for step in steps]) & (luminance > 0)
    notes += [
        f"{step.path.name} (level {step.level:g}) does not stand out of the camera's black; expose "
        "it longer if the display is not black there"
        for step, lit in zip(steps, is_lit, strict=True)
        if not lit
    ]
    curve = None
    if np.count_nonzero(is_lit) >= FITTED_STEPS:
        curve = _fitted(at[is_lit], luminance[is_lit], float(at[-1]))
    return ToneFacts(levels=at, luminance=luminance, curve=curve, is_lit=is_lit, notes=tuple(notes))


def _middle(path: Path, capture: Capture) -> tuple[float, float]:
    """Return mean and its standard deviation of green in the middle.

    Raises:
        DecodeError: If the picture is coded or clipped there.
    """
    if capture.samples.dtype == np.uint8 and capture.cfa is None:
        raise DecodeError(
            f"{path.name} is coded in 8 bits; give linear pictures: RAW, EXR, 16-bit TIFF or PNG"
        )
    green, clipped, _ = green_of(capture)
    high, wide = (max(1, round(n * (1 - MIDDLE) / 2)) for n in green.shape)
    inside = np.s_[high:-high, wide:-wide]
    share = float(np.mean(clipped[inside])) if clipped[inside].size else 0.0
    if not green[inside].size:
        raise DecodeError(f"{path.name} has {capture.width}x{capture.height} pixels: too few")
    if share > MOST_CLIPPED:
        raise DecodeError(f"{path.name}: {share:.1%} of green is clipped; expose less")
    middle = green[inside]
    # neighbours, since what is uneven is so in every picture
    noise = float(np.diff(middle, axis=1).std()) / _OF_TWO if middle.shape[1] > 1 else 0.0
    return float(middle.mean()), noise / float(np.sqrt(middle.size))


def exposures_of(
    files: Sequence[Path], captures: Sequence[Capture]
) -> tuple[list[float], list[str]]:
    """Return relative exposures, and notes about them.

    Raises:
        DecodeError: If some files state time and ISO and others do not.
    """
    settings: list[dict[str, float | None]] = [
        {
            "exposure time": c.metadata.exposure_time_s or c.exposure_time_s,
            "ISO": c.iso or c.metadata.iso,
            "f-number": c.metadata.f_number,
        }
        for c in captures
    ]
    exposure = np.ones(len(files))
    differs = []
    for name, power in (("exposure time", 1), ("ISO", 1), ("f-number", -2)):
        values = [one[name] for one in settings]
        stated_values = [value for value in values if value is not None]
        if not stated_values:
            continue
        if len(stated_values) < len(values):
            path = files[values.index(None)]
            raise DecodeError(
                f"{path.name} states no {name}, as others do; give pictures of one camera as it "
                "wrote them"
            )
        if max(stated_values) > min(stated_values) * (1 + _SAME):
            differs.append(name)
        exposure *= (np.array(stated_values) / stated_values[0]) ** power
    notes = []
    if differs:
        words = " and ".join(differs)
        notes.append(f"pictures differ in {words}; light is scaled by what the files state")
    if all(one["exposure time"] is None for one in settings):
        notes.append("no picture states its exposure time; all are taken as equal")
    return list(exposure), notes


def _check_rising(steps: Sequence[Step]) -> None:
    """Refuse a step that is darker than the one before it by more than noise.

    Raises:
        DecodeError: If there is one, or the last is no brighter than the first.
    """
    for previous, step in pairwise(steps):
        chance = _SURE * float(np.hypot(previous.error, step.error))
        if step.light < previous.light - chance:
            raise DecodeError(
                f"{step.path.name} (level {step.level:g}) is darker than {previous.path.name} "
                f"(level {previous.level:g}), by {1 - step.light / previous.light:.2%}; are "
                "levels and pictures in one order, and exposures as stated?"
            )
    chance = _SURE * float(np.hypot(steps[0].error, steps[-1].error))
    if steps[-1].light <= max(steps[0].light + chance, 0.0):
        raise DecodeError(
            f"{steps[-1].path.name} is no brighter than {steps[0].path.name}; give steps that "
            "differ"
        )


def _monotone(light: Sequence[float]) -> FloatGrid:
    """Return values that never fall: neighbours that do share their mean."""
    pools: list[tuple[float, int]] = []
    for value in light:
        mean, count = value, 1
        while pools and pools[-1][0] > mean:
            other, members = pools.pop()
            mean = (mean * count + other * members) / (count + members)
            count += members
        pools.append((mean, count))
    return np.concatenate([np.full(count, mean) for mean, count in pools])


def _fitted(levels: FloatGrid, luminance: FloatGrid, top: float) -> PowerCurve:
    """Fit the curve, each step by its share."""

    def curve(p: FloatGrid) -> PowerCurve:
        black, gain = (float(np.exp(n)) for n in p[:2])
        return PowerCurve(black=black, gain=gain, offset=float(p[2]), gamma=float(p[3]), top=top)

    def misfit(p: FloatGrid) -> FloatGrid:
        return np.asarray(curve(p).at(levels) / luminance - 1)

    start = np.array([np.log(max(float(luminance[0]), _LEAST)), 0.0, 0.0, 2.2])
    fit = optimize.least_squares(
        misfit,
        start,
        bounds=([-40, -3, -0.2, 0.3], [1, 3, 0.5, 6.0]),
        x_scale=[1.0, 0.1, 0.01, 0.1],
    )
    return curve(fit.x)
