"""The signal of a sensor without light: dark current, hot pixels, error of the black level."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.merging.merge import clipped_rows
from camkit.runtime.merging.survey import Frame, Survey, check_alike, read_frame

SAME_TIME: Final = 0.01
BROKEN_LIGHT: Final = 0.5
"""Share of white that the dark alone reaches from which on a sample says nothing of the light."""
DRIFT_DN: Final = 0.1
"""By which black may differ from frame to frame, where too few dark frames tell it."""
TOLD_BY: Final = 4
"""Dark frames more than there are exposure times of them, that tell a drift smaller than this."""


class Darks:
    """Dark frames by exposure time, their mean where one time has several.

    A frame takes the dark of its own time, else that of the nearest time, in proportion: above
    black the dark is a current. `rows` is what `merging.merge.merge` asks for.
    """

    def __init__(
        self, means: dict[float, FloatArray], counts: dict[float, int], drift: float
    ) -> None:
        """Store dark light by exposure time, NaN where the dark itself is clipped.

        Args:
            means: By exposure time.
            counts: Of the frames in each mean.
            drift: Standard deviation of the level from frame to frame, 1.0 = white.
        """
        self._means = means
        self._counts = counts
        self._drift = drift

    @classmethod
    def read(
        cls,
        files: Sequence[Path],
        times_s: Sequence[float] | None,
        bracket: Survey,
        mosaic: MosaicOptions | None = None,
    ) -> Self:
        """Read dark frames of a bracket.

        Args:
            files: The frames, one or more.
            times_s: One for each; None for what the files state, as the frames' own files must.
            bracket: The frames that they belong to; the darks of a single frame without a time
                were exposed as long as it.
            mosaic: As for the bracket.

        Raises:
            ContractError: If a time is not known, or is in seconds where those of the frames
                were stated as something else.
            DecodeError: If a frame cannot be read or differs from the bracket.
        """
        sums: dict[float, tuple[FloatArray, int]] = {}
        levels: dict[float, list[float]] = {}
        for number, path in enumerate(files):
            capture = read_frame(path, mosaic)
            check_alike(bracket.like, bracket.frames[0].path, capture, path)
            stated_s = capture.metadata.exposure_time_s or capture.exposure_time_s
            time_s = stated_s if times_s is None else times_s[number]
            if not bracket.is_timed:
                time_s = bracket.frames[0].time_s
            why = "states no exposure time" if time_s is None else _why_not(times_s, bracket)
            if time_s is None or why:
                raise ContractError(
                    f"the dark frame {path.name} {why}; add {option_text('times_s')} with one for "
                    "each of FILES and then for each dark frame"
                )
            light = capture.linear_rows(0, capture.height)
            light[clipped_rows(capture, 0, capture.height)] = np.nan
            light = light.reshape(capture.plane_shape)
            levels.setdefault(time_s, []).append(_level(light))
            total, count = sums.get(time_s, (np.zeros_like(light), 0))
            sums[time_s] = total + light, count + 1
        like = bracket.like
        step = 1 / (like.white_level - float(like.black_level.max()))
        means = {time_s: total / np.float32(count) for time_s, (total, count) in sums.items()}
        counts = {time_s: count for time_s, (_, count) in sums.items()}
        return cls(means, counts, _drift(list(levels.values()), DRIFT_DN * step))

    def level_error(self, bracket: Survey) -> float:
        """Return the standard error of black in the merged light of a bracket.

        Every frame and every dark has a black of its own. Where shot noise rules, frames are
        weighted by their times s, so that the error of each comes through by 1 / sum(s). That of a
        mean of k darks is 1 / sqrt(k) of it; it is the same in all frames that take this mean, and
        grows with the factor f by which each takes it:

            error = drift sqrt(n + sum over means of (sum f)^2 / k) / sum(s)

        Args:
            bracket: What the darks were read for; 1.0 = white of its longest frame.
        """
        shares = bracket.times_s / bracket.times_s[0]
        factors = dict.fromkeys(self._means, 0.0)
        for frame in bracket.frames:
            time_s, factor = self._nearest(frame)
            factors[time_s] += factor
        of_darks = sum(total**2 / self._counts[time_s] for time_s, total in factors.items())
        return self._drift * float(np.sqrt(shares.size + of_darks) / shares.sum())

    def rows(self, frame: Frame, top: int, bottom: int) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the dark light of rows of a frame, and where it leaves nothing to measure."""
        time_s, factor = self._nearest(frame)
        dark = self._means[time_s][:, top:bottom] * np.float32(factor)
        broken = ~(dark <= BROKEN_LIGHT)
        return np.where(broken, np.float32(0), dark), broken

    def _nearest(self, frame: Frame) -> tuple[float, float]:
        """Return the time of the darks that apply to a frame, and the factor for them."""
        nearest = min(self._means, key=lambda time_s: abs(np.log(time_s / frame.time_s)))
        is_same = abs(nearest / frame.time_s - 1) <= SAME_TIME
        return nearest, 1.0 if is_same else frame.time_s / nearest


def _why_not(times_s: Sequence[float] | None, bracket: Survey) -> str:
    """Return why the time of a dark frame is not known among those of a bracket."""
    if times_s is not None or not bracket.is_timed:
        return ""
    for frame in bracket.frames:
        if not frame.file_time_s or abs(frame.time_s / frame.file_time_s - 1) > SAME_TIME:
            return f"states seconds, the time of {frame.path.name} was stated as another number"
    return ""


def _level(light: FloatArray) -> float:
    """Return the mean of a dark frame without its hot pixels."""
    valid = light[np.isfinite(light)]
    if not valid.size:
        return 0.0
    low, high = np.quantile(valid, (0.01, 0.99))
    return float(valid[(valid >= low) & (valid <= high)].mean(dtype=np.float64))


def _drift(levels: Sequence[Sequence[float]], least: float) -> float:
    """Return spread of levels of frames of one time each, pooled; where few, `least` or more."""
    free = sum(len(of_time) - 1 for of_time in levels)
    if free == 0:
        return least
    square = sum(float(np.square(np.array(one) - np.mean(one)).sum()) for one in levels) / free
    return float(np.sqrt(square)) if free >= TOLD_BY else max(float(np.sqrt(square)), least)
