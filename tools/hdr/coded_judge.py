"""Coded captures solved, simulated and scored against one reference."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.peak import light_within
from camkit.contracts import FloatArray
from camkit.report.hdr_score import Reference, hdr_scores
from camkit.runtime.kinds.hdr.streaks.cells import cells_of, coarser, sample_sites
from camkit.runtime.kinds.hdr.streaks.convolution import Convolution
from camkit.runtime.kinds.hdr.streaks.descent import COARSE_STEPS, seek_lights
from camkit.runtime.kinds.hdr.streaks.kernels import streak_kernels
from camkit.runtime.kinds.hdr.streaks.painting import Painter
from camkit.runtime.kinds.hdr.streaks.recovery import GUESS, Recovery, recover, veil_of
from camkit.runtime.kinds.hdr.streaks.shapes import pooled, rim_distance_px
from camkit.scenes.saturation import CEILING
from tools.hdr.coded_optics import parts_of, seen_through
from tools.hdr.coded_scene import CODES, clipped_samples

REACH_SHARE: Final = 0.9
TINY: Final = 1e-6
LESS: Final = 0.1
STAR_SHARE: Final = 0.06
STAR_PX: Final = (8.0, 120.0)
STAR_RAD: Final = tuple(np.pi * (1 + 2 * n) / 8 for n in range(4))
NUMBERS: Final = (
    "hdr_psnr_db",
    "stops_rmse",
    "mu_psnr_db",
    "unclipped_psnr_db",
    "ev0_psnr_db",
    "ev4_psnr_db",
)

Mask = NDArray[np.bool_]
Box = tuple[slice, slice, slice]


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """A capture to be solved.

    Attributes:
        light: (3, h, w) float32, clipped samples at the level of their colour.
        clipped: (3, h, w).
        scale: (3, 1, 1) where the colours clip.
    """

    light: FloatArray
    clipped: Mask
    scale: FloatArray

    @classmethod
    def of(cls, light: FloatArray, clipped: Mask, levels: FloatArray) -> "Seen":
        """Put clipped samples at the (3,) levels of their colour."""
        scale = np.asarray(levels[:, None, None], np.float32)
        at_level = np.where(clipped, scale, light).astype(np.float32)
        return cls(light=at_level, clipped=clipped, scale=scale)


class Judge:
    """Scores results against one reference, in several areas."""

    def __init__(self, seen: Seen, reference: FloatArray, areas: dict[str, Box]) -> None:
        self._seen, self._reference, self._areas = seen, reference, areas
        self.scores: dict[str, dict[str, dict[str, float]]] = {area: {} for area in areas}
        self.pictures: dict[str, FloatArray] = {}

    def add(self, name: str, picture: FloatArray, seen: Seen | None = None) -> None:
        """Score a picture; `seen` is the capture that it came of, if not the real one."""
        clipped = (seen or self._seen).clipped
        self.pictures[name] = picture
        for area, box in self._areas.items():
            truth, mask = self._reference[box], clipped[box]
            scores = hdr_scores(picture[box], Reference(truth=truth, clipped=mask))
            found: dict[str, float] = {key: scores[key] for key in NUMBERS if key in scores}
            found["own_peak_psnr_db"] = scores["hdr_psnr_db"] + 20 * float(
                np.log10(truth.max() / CEILING)
            )
            light = [float(p[mask].sum(dtype=np.float64)) for p in (picture[box], truth)]
            found["clipped_light_ratio"] = light[0] / max(light[1], TINY)
            self.scores[area][name] = {key: round(value, 2) for key, value in found.items()}

    def solve(self, name: str, psf: FloatArray, seen: Seen | None = None) -> Recovery:
        """Solve a capture, the real one unless said otherwise, and score the result."""
        picture, recovery = solved(seen or self._seen, psf)
        self.add(name, picture, seen)
        return recovery


def solved(seen: Seen, psf: FloatArray, arms_px: int | None = None) -> tuple[FloatArray, Recovery]:
    """Return a capture with its lights, >= 0, and what was found.

    Args:
        seen: The capture, in full planes.
        psf: (3, n, n).
        arms_px: How far its arms reach; None for `reach_px`.
    """
    sites = sample_sites(None)
    light = (seen.light / seen.scale).astype(np.float32)
    kernels = streak_kernels(psf, sites, reach_px(psf) if arms_px is None else arms_px)
    recovery = recover(cells_of(light, seen.clipped, sites), kernels)
    Painter(recovery).paint(light, 0, (1.0, 1.0, 1.0))
    return np.asarray(np.maximum(light, 0) * seen.scale, np.float32), recovery


def light_by_start(seen: Seen, psf: FloatArray) -> list[float | None]:
    """Return how much of the lights that a solve finds is measured, and not what it started from.

    Lights are sought twice in cells of 4 px, from the guess and from a tenth of it.

    Returns:
        For each colour the light found from the tenth, as a share of that found from the whole: 1
        where streaks decide, 0.1 where they tell nothing; None where nothing clipped.
    """
    sites = sample_sites(None)
    kernels = streak_kernels(psf, sites, reach_px(psf)).coarse
    fine = cells_of((seen.light / seen.scale).astype(np.float32), seen.clipped, sites)
    cells = coarser(fine)
    veil = veil_of(cells.known, kernels.veil)
    found: list[float | None] = []
    for colour, over in enumerate(fine.clipped > 0):
        guess = np.where(over, 1 + GUESS * rim_distance_px(over, fine.pitch_px) ** 2, 0)
        spread = Convolution(kernels.whole[colour], veil.shape[1:])
        sums = [
            float(
                seek_lights(
                    cells.light[colour] - veil[colour],
                    cells.clipped[colour] > 0,
                    spread,
                    pooled((share * guess).astype(np.float32)),
                    COARSE_STEPS,
                ).sum(dtype=np.float64)
            )
            for share in (1.0, LESS)
        ]
        found.append(round(sums[1] / sums[0], 2) if sums[0] > 0 else None)
    return found


def reach_px(psf: FloatArray) -> int:
    """Return the radius in which `REACH_SHARE` of every colour of a PSF lies."""
    inside = [light_within(plane) for plane in psf]
    return max(int(np.searchsorted(light / light[-1], REACH_SHARE)) for light in inside)


def simulated(
    reference: FloatArray, psf: FloatArray, levels: NDArray[np.intp], offset: float
) -> Seen:
    """Return the capture that a PSF makes of a reference: clipped and rounded to 8 bits.

    Args:
        reference: (3, h, w) light, 1.0 = white.
        psf: (3, n, n).
        levels: (3,) codes at which colours clip.
        offset: Of black, in codes.
    """
    full = CODES - 1 + offset
    light = np.rint(seen_through(reference, psf) * full - offset)
    codes = np.clip(light, 0, CODES - 1).astype(np.uint8)
    ends = ((levels + offset) / full).astype(np.float32)
    return Seen.of(
        ((codes + np.float32(offset)) / np.float32(full)).astype(np.float32),
        clipped_samples(codes, levels),
        ends,
    )


def star_psf(psf: FloatArray) -> FloatArray:
    """Return core of a PSF with a share of its light in eight even arms, the same in all colours.

    Returns:
        (3, m, m), each of sum 1.
    """
    half, out = psf.shape[1] // 2, int(STAR_PX[1]) + 2
    arms = np.zeros((2 * out + 1, 2 * out + 1))
    along = np.arange(*STAR_PX, 0.25)
    for angle in (turn + lean for turn in (0.0, np.pi) for lean in STAR_RAD):
        y, x = out + along * np.sin(angle), out + along * np.cos(angle)
        top, left = np.floor(y).astype(np.intp), np.floor(x).astype(np.intp)
        for down, across in ((0, 0), (0, 1), (1, 0), (1, 1)):
            share = (1 - np.abs(y - top - down)) * (1 - np.abs(x - left - across))
            np.add.at(arms, (top + down, left + across), share)
    core = np.where(parts_of(psf)["core"], psf, 0).astype(np.float64)
    core = np.stack([_resized(plane, half, out) for plane in core])
    core *= (1 - STAR_SHARE) / core.sum(axis=(1, 2), keepdims=True)
    return np.asarray(core + STAR_SHARE * arms / arms.sum(), np.float32)


def _resized(plane: NDArray[np.float64], half: int, wanted: int) -> NDArray[np.float64]:
    """Return a plane about its middle with another number of pixels to each side."""
    wide = np.pad(plane, max(wanted - half, 0))
    cut = max(half - wanted, 0)
    return wide[cut : wide.shape[0] - cut, cut : wide.shape[1] - cut]
