"""A bracket of a point light to a frozen PSF.

    frames less darks -> merged light -> the light found -> each colour on its own lattice, centred
    to a fraction of a pixel -> background off -> cropped -> noise smoothed -> sum 1

The colours are written as wavelengths, blue, green and red in this order, at `WAVELENGTHS_UM`: a
camera with such optics takes them by a `channel_response` that is one at its own and zero at the
others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray, FrozenPsf, RadialDistortion, cfa_channels
from camkit.errors import ContractError, DecodeError
from camkit.runtime.calibration.lattice import FloatGrid, Lattice, filled
from camkit.runtime.calibration.light import Core, background, find_light, fit_core
from camkit.runtime.calibration.trim import cropped, reach_px, smooth_noise
from camkit.runtime.merging.merge import DarkRows, Merged, merge
from camkit.runtime.merging.survey import Survey
from camkit.units import MM_PER_M

COLOURS: Final = ("blue", "green", "red")
CHANNELS: Final = (2, 1, 0)
RED: Final = 2
"""Its place in both."""
WAVELENGTHS_UM: Final = (0.46, 0.54, 0.60)
CORE_SHARE_PX: Final = 3.0
MOST_HALF_PX: Final = 511
CLIP_PX: Final = 8
LEAST_BORDER_PX: Final = 12
LEAST_SPREADS: Final = 0.4
"""Standard deviation of a core, in pitches of its lattice, below which samples miss it: a Gaussian
then keeps a twentieth of its amplitude at the finest wave that the lattice holds."""
MOST_REST: Final = 0.15
REST_PX: Final = 4.0
_EDGE_PX: Final = 3
_WHITE: Final = 0.98


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourFacts:
    """What was measured of one colour.

    Attributes:
        colour: Its name.
        wavelength_um: Under which it is written.
        core_share: Of its light within the crop, what lies within 3 px of the centre.
        noise_floor: Spread of the dark around, of the peak, before noise is smoothed.
        offset_px: (x, y) of its core from that of green.
    """

    colour: str
    wavelength_um: float
    core_share: float
    noise_floor: float
    offset_px: tuple[float, float]

    def to_json(self) -> dict[str, Any]:
        """Give plain JSON values."""
        return {
            "colour": self.colour,
            "wavelength_um": self.wavelength_um,
            "core_share": round(self.core_share, 5),
            "noise_floor": float(f"{self.noise_floor:.3g}"),
            "offset_px": [round(part, 4) for part in self.offset_px],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredPoint:
    """A PSF as it was measured.

    Attributes:
        psf: One field, one depth, three colours as wavelengths.
        red: (h, w) light of red as its samples lie on the sensor, as far as the kernels reach,
            background taken off: what is summed over many samples is not to be resampled.
        red_pitch_um: Of these samples.
        centre_px: (x, y) of the light in the frames.
        colours: Facts of each colour.
        filled_samples: Samples of the crop that no frame holds, taken from their neighbours.
        notes: What the user should know.
    """

    psf: FrozenPsf
    red: FloatGrid
    red_pitch_um: float
    centre_px: tuple[float, float]
    colours: tuple[ColourFacts, ...]
    filled_samples: int
    notes: tuple[str, ...]

    @property
    def side_px(self) -> int:
        """Give the side of the kernels."""
        return int(self.psf.kernels.shape[-1])


@dataclass(frozen=True, slots=True, kw_only=True)
class PointOptions:
    """What the caller says of a measurement.

    Attributes:
        side_px: Odd side of the kernels; None for as far as the light stands out of the noise.
        pixel_pitch_um: None for what the frames state.
        depth_m: Distance of the light.
    """

    side_px: int | None = None
    pixel_pitch_um: float | None = None
    depth_m: float = np.inf

    def __post_init__(self) -> None:
        side, pitch = self.side_px, self.pixel_pitch_um
        if side is not None and (side < 3 or side % 2 == 0):
            raise ContractError(f"--side-px must be odd and >= 3; got {side}")
        if pitch is not None and not (np.isfinite(pitch) and pitch > 0):
            raise ContractError(f"--pixel-pitch-um must be > 0; got {pitch:g}")
        if not self.depth_m > 0:
            raise ContractError(f"--depth-m must be > 0; got {self.depth_m:g}")


def measure_point(survey: Survey, options: PointOptions, dark: DarkRows | None) -> MeasuredPoint:
    """Measure the PSF of a bracket of a point light.

    Args:
        survey: The bracket; linear frames.
        options: What the caller says of it.
        dark: Taken off every frame.

    Raises:
        ContractError: If frames are coded, no pitch is known, or a side does not fit.
        DecodeError: If there is no light, it lies too near the border, or its peak is clipped in
            the shortest frame.
    """
    pitch_um = options.pixel_pitch_um or survey.like.pixel_pitch_um
    if survey.codes is not None:
        raise ContractError("a PSF is measured on linear frames: RAW, EXR, 16-bit TIFF or PNG")
    if pitch_um is None:
        raise ContractError("the frames state no pixel pitch; say --pixel-pitch-um")
    merged = merge(survey, None, dark)
    row, column = find_light(_cells(merged, survey))
    row, column = (n * (2 if survey.like.cfa else 1) for n in (row, column))
    _refuse_clipped(merged, survey, row, column)
    half = _most_half(survey, row, column, options.side_px)
    patch = _Patch(merged, survey, (row, column), half)
    planes, noise, facts = _centred(patch, half)
    notes = _doubts(patch, facts)
    if options.side_px is None:
        found = reach_px(planes, noise)
        if found == half:
            notes.append(f"light is still seen {half} px from the centre, where the crop ends")
        planes, noise = cropped(planes, found), cropped(noise, found)
    kernels = np.stack([smooth_noise(p, n) for p, n in zip(planes, noise, strict=True)])
    kernels = np.maximum(kernels, 0)
    kernels /= kernels.sum((-2, -1), keepdims=True)
    return MeasuredPoint(
        psf=_frozen(kernels, pitch_um, options.depth_m),
        red=patch.red(kernels.shape[-1] // 2, facts[1]),
        red_pitch_um=pitch_um * patch.light[RED].pitch_px,
        centre_px=(patch.left + facts[1].x, patch.top + facts[1].y),
        colours=_facts(kernels, facts, patch.floors),
        filled_samples=patch.filled_samples(kernels.shape[-1] // 2, facts[1]),
        notes=tuple(notes),
    )


class _Patch:
    """The light around the point, colour by colour, with its noise."""

    def __init__(self, merged: Merged, survey: Survey, place: tuple[int, int], half: int) -> None:
        like, reach = survey.like, half + LEAST_BORDER_PX
        # an even first row and column keep the phase of the mosaic
        self.top, self.left = (max(0, n - reach) // 2 * 2 for n in place)
        inside = (
            slice(None),
            slice(self.top, place[0] + reach + 2),
            slice(self.left, place[1] + reach + 2),
        )
        precision = merged.precision[inside].astype(np.float64)
        light = merged.light[inside].astype(np.float64)
        self._missing = precision <= 0
        light[self._missing] = np.nan
        variance = np.where(self._missing, np.nan, 1 / np.maximum(precision, 1e-300))
        self.light: list[Lattice] = []
        self.variance: list[Lattice] = []
        self.floors: list[float] = []
        for channel in CHANNELS:
            level, spread = background(_sites(merged, survey, channel))
            lattice = _lattice(light, survey, channel)
            self.light.append(lattice.with_values(lattice.values - level))
            self.variance.append(_lattice(variance, survey, channel))
            # noise finer than the steps of a converter shows no spread
            self.floors.append(max(spread, float(np.sqrt(np.nanmedian(self.variance[-1].values)))))
        self.place = place[0] - self.top, place[1] - self.left
        self.cfa = like.cfa

    def red(self, half: int, core: Core) -> FloatGrid:
        """Give the light of red as its samples lie, up to so many pixels from a core."""
        lattice = self.light[RED]
        y, x = lattice.places()
        inside = np.maximum(np.abs(y - core.y), np.abs(x - core.x)) <= half
        rows, columns = (np.flatnonzero(inside.any(axis=n)) for n in (1, 0))
        return filled(lattice.values[np.ix_(rows, columns)])

    def filled_samples(self, half: int, core: Core) -> int:
        """Count the samples of the crop that no frame holds."""
        y, x = np.indices(self._missing.shape[-2:])
        inside = np.maximum(np.abs(y - core.y), np.abs(x - core.x)) <= half
        return int(np.count_nonzero(self._missing & inside))


def _lattice(planes: FloatGrid, survey: Survey, channel: int) -> Lattice:
    """Give the lattice of a channel of (1 or 3, h, w)."""
    cfa = survey.like.cfa
    if cfa is None:
        return Lattice.of_plane(planes[channel])
    return Lattice.of_mosaic(planes[0], cfa, channel)


def _sites(merged: Merged, survey: Survey, channel: int) -> list[FloatArray]:
    """Give the light of a channel as planes of its places in the cell, NaN where none is known."""
    usable = np.where(merged.precision > 0, merged.light, np.float32(np.nan))
    if survey.like.cfa is None:
        return [usable[channel]]
    cell = np.array(cfa_channels(survey.like.cfa))
    return [usable[0, y::2, x::2] for y, x in np.argwhere(cell == channel)]


def _cells(merged: Merged, survey: Survey) -> FloatArray:
    """Give the light of whole cells: the sum of the planes, or of the 2x2 of a mosaic."""
    light = merged.light
    if survey.like.cfa is None:
        return np.asarray(light.sum(axis=0))
    height, width = (n // 2 * 2 for n in light.shape[1:])
    even = light[0, :height, :width]
    return np.asarray(even.reshape(height // 2, 2, width // 2, 2).sum(axis=(1, 3)))


def _refuse_clipped(merged: Merged, survey: Survey, row: int, column: int) -> None:
    """Refuse a light that even the shortest frame does not hold.

    Raises:
        DecodeError: If samples near it are clipped there.
    """
    shortest, longest = survey.frames[-1], survey.frames[0]
    near = (
        slice(None),
        slice(max(0, row - CLIP_PX), row + CLIP_PX + 2),
        slice(max(0, column - CLIP_PX), column + CLIP_PX + 2),
    )
    white = _WHITE * longest.time_s / shortest.time_s
    clipped = np.count_nonzero((merged.precision[near] == 0) & (merged.light[near] >= white))
    if clipped:
        raise DecodeError(
            f"{clipped} samples of the light at ({column}, {row}) are clipped in the shortest "
            f"frame, {shortest.path.name}; add a shorter one"
        )


def _most_half(survey: Survey, row: int, column: int, side_px: int | None) -> int:
    """Give half the side that may be cropped around a place.

    Raises:
        ContractError: If the side that is asked for does not fit into the frame.
        DecodeError: If the light lies at the border.
    """
    like = survey.like
    most = min(row, column, like.height - 1 - row, like.width - 1 - column) - _EDGE_PX
    if most < LEAST_BORDER_PX:
        raise DecodeError(
            f"the light lies at ({column}, {row}), at the border of {like.width}x{like.height} "
            "pixels; move it inwards"
        )
    if side_px is None:
        return min(most, MOST_HALF_PX)
    if side_px // 2 > most:
        raise ContractError(
            f"--side-px {side_px} does not fit around the light at ({column}, {row}) of "
            f"{like.width}x{like.height} pixels; at most {2 * most + 1}"
        )
    return side_px // 2


def _centred(patch: _Patch, half: int) -> tuple[FloatGrid, FloatGrid, list[Core]]:
    """Give (colour, side, side) light and noise about the centre of green, and the cores."""
    cores = [fit_core(lattice, *patch.place) for lattice in patch.light]
    middle = cores[CHANNELS.index(1)]
    offset = np.arange(-half, half + 1, dtype=np.float64)
    y, x = np.meshgrid(middle.y + offset, middle.x + offset, indexing="ij")
    planes, noise = [], []
    for light, variance, core in zip(patch.light, patch.variance, cores, strict=True):
        rest = light.with_values(light.values - core.at(*light.places()))
        planes.append(rest.at(y, x) + core.at(y, x))
        noise.append(np.sqrt(np.maximum(variance.at(y, x, order=1), 1e-30)))
    return np.stack(planes), np.stack(noise), cores


def _doubts(patch: _Patch, cores: Sequence[Core]) -> list[str]:
    """Say whether the core is too fine for the lattice of a colour, as any of them shows."""
    for lattice, core in zip(patch.light, cores, strict=True):
        y, x = lattice.places()
        rest = np.abs(lattice.values - core.at(y, x))[np.hypot(y - core.y, x - core.x) <= REST_PX]
        narrow = core.spread_px < LEAST_SPREADS * lattice.pitch_px
        if lattice.pitch_px > 1 and (narrow or np.nanmax(rest) > MOST_REST * core.height):
            return [
                "the core is too fine for the mosaic: what lies between the samples of a colour "
                "is a guess; measure such optics on a sensor without a mosaic"
            ]
    return []


def _facts(
    kernels: FloatGrid, cores: Sequence[Core], floors: Sequence[float]
) -> tuple[ColourFacts, ...]:
    offset = np.arange(kernels.shape[-1]) - kernels.shape[-1] // 2
    near = np.hypot(offset[:, None], offset[None]) <= CORE_SHARE_PX
    middle = cores[CHANNELS.index(1)]
    return tuple(
        ColourFacts(
            colour=colour,
            wavelength_um=wavelength_um,
            core_share=float(kernel[near].sum()),
            noise_floor=floor / core.height,
            offset_px=(core.x - middle.x, core.y - middle.y),
        )
        for colour, wavelength_um, kernel, core, floor in zip(
            COLOURS, WAVELENGTHS_UM, kernels, cores, floors, strict=True
        )
    )


def _frozen(kernels: NDArray[np.float64], pitch_um: float, depth_m: float) -> FrozenPsf:
    return FrozenPsf(
        kernels=np.ascontiguousarray(kernels[None, None], dtype=np.float32),
        field_heights_mm=np.zeros(1),
        depths_mm=np.array([depth_m * MM_PER_M]),
        wavelengths_um=np.array(WAVELENGTHS_UM),
        pixel_pitch_um=pitch_um,
        distortion=RadialDistortion(coefficients=np.array([[1.0, 0, 0, 0]]), radius_mm=1.0),
        relative_illumination=np.ones(1),
        symmetry="uniform",
    )
