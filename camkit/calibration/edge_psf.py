"""A slanted edge to a PSF that is the same in all directions.

    frames less darks -> the line of the edge, by green -> the profile of every colour across it
      -> a sum of Gaussians, none negative, whose blurred edge is this profile -> kernels

An edge shows what a PSF is when it is summed along the edge: one direction of its spectrum. Where
the PSF is round that is all of it, and a sum of round Gaussians, each of which is a step of its own
width across the edge, turns the profile into it without differences of noisy numbers. Half of all
light lies on the dark side of the place where the core rises most: this tells how much haze there
is, even haze wider than the picture, if it is known what dark is.

References: Abel 1826 (round functions from their projections); Bendinelli 1991, "Abel integral
equation inversion and deconvolution by multi-Gaussian approximation".
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from camkit.calibration.darks import Darks
from camkit.calibration.edges import (
    FloatGrid,
    FloatLine,
    Line,
    Samples,
    edge_samples,
    fit_line,
    step_of,
)
from camkit.calibration.measured import (
    COLOURS,
    WAVELENGTHS_UM,
    ColourFacts,
    MeasuredPsf,
    PsfOptions,
    Reblurred,
    core_share,
    frozen,
)
from camkit.calibration.patch import CHANNELS, cells
from camkit.calibration.peak import PEAK_PX, Field, height_mm
from camkit.calibration.psf import GREEN, MOST_HALF_PX, checked_pitch_um
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.progress import working
from camkit.runtime.merging.merge import Merged, merge
from camkit.runtime.merging.survey import Survey

LEAST_SPREAD_PX: Final = 0.3
"""Of the narrowest Gaussian: a box as wide as a pixel has 0.29."""
RATIO: Final = 1.1
FINE_PX: Final = 0.25
FINE_REACH_PX: Final = 12.0
GROWTH: Final = 1.04
LEAST_REACH_PX: Final = 12.0
LEAST_EXPLAINED: Final = 0.8
MOST_CLIPPED: Final = 0.01
WIDE: Final = 0.2
"""Of the reach: a Gaussian wider than that rises so evenly that it could be background."""
MOST_WIDE: Final = 0.01
LOST_SHARE: Final = 1e-3
"""Of the light, that may lie beyond the kernels."""
STRIPS: Final = 8
LEAST_HALF_PX: Final = 7
MOST_MOVE_PX: Final = 1.5
_MOST_BINS: Final = 400


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RoundPsf:
    """A sum of round Gaussians.

    Attributes:
        spreads_px: (n,) standard deviations.
        shares: (n,) of the light, none negative, of sum 1.
    """

    spreads_px: FloatLine
    shares: FloatLine

    def share_within(self, radius_px: float) -> float:
        """Return the share of the light within a radius, in closed form."""
        return float(self.shares @ -np.expm1(-((radius_px / self.spreads_px) ** 2) / 2))

    def kernel(self, half: int) -> FloatGrid:
        """Return (2 half + 1, 2 half + 1) samples of unit sum."""
        offset = np.arange(-MOST_HALF_PX, MOST_HALF_PX + 1, dtype=np.float64)
        lines = np.exp(-(offset**2) / (2 * self.spreads_px[:, None] ** 2))
        # samples of a narrow Gaussian do not add up to its integral, those of a wide one end
        whole = np.sqrt(2 * np.pi) * self.spreads_px
        lines /= np.where(self.spreads_px < 1, lines.sum(axis=1), whole)[:, None]
        lines = lines[:, MOST_HALF_PX - half : MOST_HALF_PX + half + 1]
        kernel = np.einsum("n,ny,nx->yx", self.shares, lines, lines)
        return np.asarray(kernel / kernel.sum())

    def half_of(self, share: float) -> int:
        """Return the radius in pixels beyond which so large a share of the light lies, at most."""
        radii = np.arange(LEAST_HALF_PX, MOST_HALF_PX + 1)
        inside = np.array([self.share_within(float(radius)) for radius in radii])
        return int(radii[min(int(np.searchsorted(inside, 1 - share)), radii.size - 1)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EdgeProfile:
    """Light across an edge.

    Attributes:
        distance_px: (n,) mean distance of the samples of a bin, > 0 where it is bright.
        width_px: (n,) of the bins.
        value: (n,) their means.
        weight: (n,) one over the standard error of each.
    """

    distance_px: FloatLine
    width_px: FloatLine
    value: FloatLine
    weight: FloatLine

    @property
    def reach_px(self) -> float:
        """Return the distance to which both sides are seen."""
        return float(min(-self.distance_px[0], self.distance_px[-1]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EdgeFit:
    """The PSF that an edge shows.

    Attributes:
        psf: The PSF.
        moved_px: Of the edge, from where its profile has 0.
        step: From dark to bright.
        predicted: (n,) the profile that it makes.
    """

    psf: RoundPsf
    moved_px: float
    step: float
    predicted: FloatLine


def fit_edge(profile: EdgeProfile, dark: float | None) -> EdgeFit:
    """Fit a round PSF to the profile of an edge.

    Args:
        profile: The profile.
        dark: Value far on the dark side; None where it is not known, and is fitted too.

    Raises:
        DecodeError: If there is no step.
    """
    count = int(np.log(profile.reach_px / LEAST_SPREAD_PX) / np.log(RATIO)) + 1
    spreads = LEAST_SPREAD_PX * RATIO ** np.arange(count, dtype=np.float64)
    target = (profile.value - (dark or 0.0)) * profile.weight

    def solved(shift_px: float) -> tuple[FloatLine, float, FloatGrid]:
        at = (profile.distance_px - shift_px)[:, None]
        table = special.ndtr(at / np.sqrt(spreads**2 + profile.width_px[:, None] ** 2 / 12))
        if dark is None:
            table = np.hstack([table, np.ones((at.size, 1)), -np.ones((at.size, 1))])
        shares, rest = optimize.nnls(table * profile.weight[:, None], target)
        return shares, float(rest), table

    shift_px = float(
        optimize.minimize_scalar(
            lambda at: solved(float(at))[1],
            bounds=(-MOST_MOVE_PX, MOST_MOVE_PX),
            method="bounded",
            options={"xatol": 1e-4},
        ).x
    )
    shares, _, table = solved(shift_px)
    step = float(shares[:count].sum())
    if step <= 0:
        raise DecodeError("an edge is dark in one colour: light it so that every colour sees it")
    psf = RoundPsf(spreads_px=spreads, shares=shares[:count] / step)
    return EdgeFit(psf=psf, moved_px=shift_px, step=step, predicted=table @ shares + (dark or 0.0))


@working("measuring the PSF of an edge")
def measure_edge(survey: Survey, options: PsfOptions, darks: Darks | None) -> MeasuredPsf:
    """Measure a round PSF on frames of one straight edge.

    Args:
        survey: One frame or more; linear.
        options: What the caller says of it.
        darks: Taken off every frame; what is left is light, haze included.

    Raises:
        ContractError: If frames are coded, no pitch is known, or a side does not fit.
        DecodeError: If there is no straight edge, it is clipped, or haze cannot be told from the
            background.
    """
    pitch_um = checked_pitch_um(survey, options)
    most = 2 * MOST_HALF_PX + 1
    if options.side_px is not None and options.side_px > most:
        raise ContractError(
            f"{option_text('side_px')} of an edge is at most {most}; got {options.side_px}"
        )
    merged = merge(survey, None, None if darks is None else darks.rows)
    light, precision = (_plain(plane, survey) for plane in (merged.light, merged.precision))
    clipped = float((precision <= 0).mean())
    if clipped > MOST_CLIPPED:
        raise DecodeError(f"{clipped:.0%} of the edge's samples are clipped; expose less")
    samples = edge_samples(light, survey.like.cfa)
    weights = [plane for _, _, plane in edge_samples(precision, survey.like.cfa)]
    line = _line(merged, survey, samples[1])
    colours = [
        _Colour(line, samples[c], weights[c], None if darks is None else darks.level_error(survey))
        for c in CHANNELS
    ]
    half = (
        max(one.fit.psf.half_of(LOST_SHARE) for one in colours)
        if options.side_px is None
        else options.side_px // 2
    )
    kernels = np.stack([one.fit.psf.kernel(half) for one in colours])
    centre_px = float(line.x), float(line.y)
    return MeasuredPsf(
        psf=frozen(kernels, pitch_um, options.depth_m),
        centre_px=centre_px,
        colours=tuple(
            _facts(n, kernels[n], one, colours[GREEN], line) for n, one in enumerate(colours)
        ),
        fields=(
            Field(
                height_mm=height_mm(survey.like, centre_px, pitch_um),
                peak_share=colours[GREEN].peak_share,
                peak_share_error=colours[GREEN].peak_share_error,
            ),
        ),
        notes=(),
    )


class _Colour:
    """One colour of an edge: its profile, its PSF, and how sure that is."""

    def __init__(
        self, line: Line, samples: Samples, precision: FloatLine, black_error: float | None
    ) -> None:
        y, x, values = samples
        valid = precision > 0
        distance, position = line.distances(y, x)[valid], line.along(y, x)[valid]
        values, precision = values[valid], precision[valid]
        dark = None if black_error is None else 0.0
        length = float(np.ptp(position)) or 1.0
        strip = np.minimum((position - position.min()) / length * STRIPS, STRIPS - 1).astype(
            np.intp
        )
        bins = Bins.of(distance, values, precision, strip)
        self.profile = bins.profile()
        self.fit = fit_edge(self.profile, dark)
        wide = self.fit.psf.spreads_px > WIDE * self.profile.reach_px
        hazy = float(self.fit.psf.shares[wide].sum())
        if dark is None and hazy > MOST_WIDE:
            raise DecodeError(
                f"veiling glare fills the frame: {hazy:.0%} of the edge's light cannot be told "
                f"from the background; give frames without light by {option_text('dark')}"
            )
        self.peak_share = self.fit.psf.share_within(PEAK_PX)
        shares = [
            fit_edge(bins.profile(omitted=n), dark).psf.share_within(PEAK_PX) for n in range(STRIPS)
        ]
        noise = np.sqrt((STRIPS - 1) * np.var(shares))
        black = 0.0
        if black_error is not None:
            share = fit_edge(self.profile, black_error).psf.share_within(PEAK_PX)
            black = abs(share - self.peak_share)
        self.peak_share_error = float(np.hypot(noise, black))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bins:
    """Samples sorted by their distance from an edge, and into strips across it.

    Attributes:
        ends: (bin + 1,) in pixels.
        sums: (4, strip, bin) of ones, distances, values and variances.
    """

    ends: FloatLine
    sums: NDArray[np.float64]

    @classmethod
    def of(
        cls, distance: FloatLine, values: FloatLine, precision: FloatLine, strip: NDArray[np.intp]
    ) -> Self:
        """Sort samples into bins that are narrow near the edge and wide far from it.

        Args:
            distance: (n,) of the samples from the edge, > 0 where it is bright.
            values: (n,) their light.
            precision: (n,) one over its variance.
            strip: (n,) number of each sample's strip, below `STRIPS`.
        """
        most = float(np.abs(distance).max())
        fine = np.arange(0, FINE_REACH_PX, FINE_PX)
        growth = FINE_PX * GROWTH ** np.arange(1, _MOST_BINS)
        coarse = FINE_REACH_PX + np.concatenate([[0.0], np.cumsum(growth)])
        ends = np.concatenate([fine, coarse[: np.searchsorted(coarse, most) + 1]])
        ends = np.concatenate([-ends[:0:-1], ends])
        bins = ends.size - 1
        number = np.clip(np.searchsorted(ends, distance, side="right") - 1, 0, bins - 1)
        number = number + bins * strip
        parts = (None, distance, values, 1 / precision)
        sums = [np.bincount(number, part, bins * STRIPS).reshape(STRIPS, bins) for part in parts]
        return cls(ends=ends, sums=np.stack(sums).astype(np.float64))

    def profile(self, omitted: int | None = None) -> EdgeProfile:
        """Return the profile, of all strips or without one.

        Raises:
            DecodeError: If a side of the edge is not seen.
        """
        strips = np.arange(STRIPS) != (-1 if omitted is None else omitted)
        sums = self.sums[:, strips].sum(axis=1)
        filled = sums[0] > 0
        count, distance, value, variance = sums[:, filled]
        profile = EdgeProfile(
            distance_px=distance / count,
            width_px=np.diff(self.ends)[filled],
            value=value / count,
            weight=count / np.sqrt(variance),
        )
        if profile.reach_px < LEAST_REACH_PX:
            raise DecodeError(
                f"the picture shows {profile.reach_px:.0f} px to one side of the edge; at least "
                f"{LEAST_REACH_PX:g} are needed: put the edge into the middle"
            )
        return profile


def _plain(planes: NDArray[np.float32], survey: Survey) -> FloatGrid:
    """Return (h, w) of a mosaic, else (c, h, w)."""
    return np.asarray(planes[0] if survey.like.cfa else planes, dtype=np.float64)


def _line(merged: Merged, survey: Survey, green: Samples) -> Line:
    """Find the edge.

    Raises:
        DecodeError: If there is no straight one.
    """
    light = cells(merged, survey).astype(np.float64)
    if survey.like.cfa is None:
        height, width = (n // 2 * 2 for n in light.shape)
        light = light[:height, :width].reshape(height // 2, 2, width // 2, 2).sum(axis=(1, 3))
    step = step_of(light)
    size = survey.like.height, survey.like.width
    fit = None
    if step is not None:
        fit = fit_line(Line(y=step[0], x=step[1], angle=step[2]), green, size)
    if fit is None or fit[2] < LEAST_EXPLAINED:
        raise DecodeError(
            "the frames show no straight edge, or a faint one: take one edge, from border to "
            "border of the picture, through its middle, well lit"
        )
    return fit[0]


def _facts(n: int, kernel: FloatGrid, one: _Colour, green: _Colour, line: Line) -> ColourFacts:
    shift_px, step = one.fit.moved_px - green.fit.moved_px, one.fit.step
    return ColourFacts(
        colour=COLOURS[n],
        wavelength_um=WAVELENGTHS_UM[n],
        core_share=core_share(kernel),
        peak_share=one.peak_share,
        peak_share_error=one.peak_share_error,
        offset_px=(float(shift_px * line.normal[1]), float(shift_px * line.normal[0])),
        reblurred=Reblurred(
            distance_px=one.profile.distance_px - one.fit.moved_px,
            captured=one.profile.value / step,
            predicted=one.fit.predicted / step,
        ),
    )
