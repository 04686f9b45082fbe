"""The lights of a capture, found from their streaks; and what every light throws beside itself.

    cells -> veil of what did not clip, taken away everywhere
          -> windows -> lights in cells of 4 px -> in cells of 2 px, each group near itself
                     -> lowered to what is proven -> streaks

"Model no more than a scene needs": nothing clipped, and only the veil is computed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS, Cells, coarser
from camkit.runtime.kinds.hdr.streaks.convolution import Convolution, spreading
from camkit.runtime.kinds.hdr.streaks.descent import COARSE_STEPS, not_outshining, seek_lights
from camkit.runtime.kinds.hdr.streaks.kernels import StreakKernels
from camkit.runtime.kinds.hdr.streaks.light_evidence import Judge, proven
from camkit.runtime.kinds.hdr.streaks.refinement import CoarseLights, Group, groups_of, refined
from camkit.runtime.kinds.hdr.streaks.regions import Window, windows_of
from camkit.runtime.kinds.hdr.streaks.shapes import pooled, rim_distance_px, upsampled

FINE_CELLS: Final = 2**20
"""Lights of windows of more cells of 2 px are judged in cells of 4 px."""
MOST_CLIPPED: Final = 0.3
"""Share of a picture; where more clipped, streaks of different lights cannot be told apart."""
Mask = NDArray[np.bool_]
MANY_SAMPLES: Final = 2
"""Of four in a cell: a colour with fewer sees no more of an arm than its cells."""
GUESS: Final = 0.6
"""Light of a clipped place that nothing was measured of, per squared pixel from its rim."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """The lights of one window.

    Attributes:
        window: Its place, in cells of 2 px.
        light: (3, h, w) float32: light of clipped cells, 0 elsewhere; 1.0 = where samples clip.
        streaks: (3, h, w) float32: what they throw beside themselves.
        streak_sums: Light of the streaks: on clipped cells, beyond what is seen elsewhere, in all.
        given_up: Places of whose lights the picture proves nothing.
    """

    window: Window
    light: FloatArray
    streaks: FloatArray
    streak_sums: tuple[float, float, float]
    given_up: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """The recovered lights, streaks and veil of a capture.

    Attributes:
        fine: Its cells of 2 px.
        coarse: Its cells of 4 px.
        veil: (3, h, w) float32, in cells of 4 px: what unclipped light throws beside itself.
        core: (3,): share of the light that stays where it is.
        kernels: (n, n) of every colour, in pixels: what a light throws beside itself; None for
            colours with fewer than `MANY_SAMPLES` in a cell.
        regions: From top to bottom; none where so much clipped that nothing can be told.
        notes: What the user should know.
        fallbacks: Places whose lights were left as the sensor saw them; 1 for a whole picture, and
            the notes say why.
        blind: Whether so much clipped that this is so of all lights.
    """

    fine: Cells
    coarse: Cells
    veil: FloatArray
    core: tuple[float, ...]
    kernels: tuple[FloatArray | None, ...]
    regions: tuple[Region, ...]
    notes: tuple[str, ...] = ()
    fallbacks: int = 0
    blind: bool = False

    def to_json(self) -> dict[str, int | float]:
        """Return the values for a sidecar.

        `clipped_streak_fraction` is the share of the streaks that fell on clipped samples, where
        nobody sees them; `unexplained` the share that outshines what is seen, which no true light
        does.
        """
        cells = self.fine.clipped[0].size
        inside = sum(region.light[0].size for region in self.regions)
        hidden, excess, total = np.sum([r.streak_sums for r in self.regions] or [(0, 0, 0)], axis=0)
        return {
            "regions": len(self.regions),
            "saturated_fraction": round(float(self.fine.clipped.mean(dtype=np.float64)), 6),
            "clipped_streak_fraction": round(float(hidden / total), 4) if total else 0.0,
            "unexplained": round(float(excess / total), 4) if total else 0.0,
            "peak": round(max((float(r.light.max()) for r in self.regions), default=1.0), 2),
            "window_fraction": round(inside / cells, 4),
            "fallbacks": self.fallbacks,
        }


def recover(
    cells: Cells,
    kernels: StreakKernels,
    pause: Callable[[], None] | None = None,
    *,
    least_samples: int = MANY_SAMPLES,
) -> Recovery:
    """Find the lights of a capture.

    Args:
        cells: Of 2 px.
        kernels: For these cells.
        pause: Called before every window; may raise to stop.
        least_samples: In a cell, of colours whose streaks are kept by pixels; 1 where they are
            taken from the samples of a mosaic.
    """
    coarse = coarser(cells)
    veil = veil_of(coarse.unclipped, kernels.coarse.veil)
    reach = -(-kernels.reach_px // coarse.pitch_px)
    clipped = np.asarray((coarse.clipped > 0).any(axis=0))
    share = float(clipped.mean())
    blind = share > MOST_CLIPPED
    regions, notes = [], []
    if blind:
        notes.append(
            f"{share:.0%} of the picture is clipped: its lights are not restored, since streaks "
            f"determine them only up to {MOST_CLIPPED:.0%}"
        )
    for window in () if blind else windows_of(clipped, reach):
        if pause is not None:
            pause()
        regions.append(_region(window, (cells, coarse), veil, kernels))
    if not blind and _at_border(clipped):
        notes.append("a light reaches the border of the picture: lights beyond it are not restored")
    return Recovery(
        fine=cells,
        coarse=coarse,
        veil=veil,
        core=kernels.coarse.core,
        kernels=tuple(
            veil if len(sites) >= least_samples else None
            for veil, sites in zip(kernels.pixel.veil, kernels.sites, strict=True)
        ),
        regions=tuple(regions),
        notes=tuple(notes),
        fallbacks=int(blind) + sum(region.given_up for region in regions),
        blind=blind,
    )


def _at_border(mask: Mask) -> bool:
    return bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())


def veil_of(light: FloatArray, kernels: tuple[FloatArray, ...]) -> FloatArray:
    """Return the light that lights spread beside themselves; the frame continues at its border.

    Args:
        light: (3, h, w).
        kernels: For every colour, in the same cells.
    """
    veil = np.empty_like(light)
    for colour, kernel in enumerate(kernels):
        half = kernel.shape[0] // 2
        wide = np.pad(light[colour], half, mode="edge")
        scattered = Convolution(kernel, wide.shape).spread(wide)
        veil[colour] = scattered[half:-half, half:-half]
    return veil


def _region(
    window: Window, cells: tuple[Cells, Cells], veil: FloatArray, kernels: StreakKernels
) -> Region:
    """Find the lights of a window."""
    fine = cells[0]
    place = window.finer(fine.light.shape[-2:])
    hidden = cells[1].clipped[(slice(None), *window.at)] > 0
    groups = groups_of(np.asarray(hidden.any(axis=0)))
    light = np.empty((COLOURS, *place.shape), np.float32)
    judges = []
    for colour in range(COLOURS):
        light[colour], judge = _lights_of_colour(colour, window, groups, cells, veil, kernels)
        judges.append(judge)
    if light[0].size > FINE_CELLS:
        proof = proven(pooled(light), judges).finer(place.shape)
    else:
        proof = proven(light, judges)
    for plane in light:
        plane[:] = proof.part_of(plane)
    streaks = np.zeros_like(light)
    for colour in range(COLOURS):
        clipped = fine.clipped[(colour, *place.at)] > 0
        if clipped.any():
            spread = spreading(kernels.fine.veil[colour], clipped)
            streaks[colour] = spread.spread(light[colour])
    return Region(
        window=place,
        light=light,
        streaks=streaks,
        streak_sums=_streak_sums(streaks, fine, place),
        given_up=proof.given_up,
    )


def _streak_sums(streaks: FloatArray, fine: Cells, place: Window) -> tuple[float, float, float]:
    """Sum the streaks: on clipped cells, beyond what is seen elsewhere, in all."""
    hidden, excess, every = 0.0, 0.0, 0.0
    for colour, plane in enumerate(streaks):
        clipped = fine.clipped[(colour, *place.at)] > 0
        outshining = np.maximum(plane - fine.light[(colour, *place.at)], 0)
        hidden += _sum(plane[clipped])
        excess += _sum(outshining[~clipped])
        every += _sum(plane)
    return hidden, excess, every


def _sum(light: FloatArray) -> float:
    return float(light.sum(dtype=np.float64))


class _ColourLights(NamedTuple):
    """Lights of one colour in a window, in cells of 2 px; their judge, None where nothing clipped.

    The judge is of cells of 4 px in a large window.
    """

    light: FloatArray
    judge: Judge | None


def _lights_of_colour(
    colour: int,
    window: Window,
    groups: Sequence[Group],
    cells: tuple[Cells, Cells],
    veil: FloatArray,
    kernels: StreakKernels,
) -> _ColourLights:
    """Find the lights of one colour in a window; a large one is judged in cells of 4 px."""
    fine, coarse = cells
    at, place = (colour, *window.at), window.finer(fine.light.shape[-2:])
    clipped = fine.clipped[(colour, *place.at)] > 0
    if not clipped.any():
        return _ColourLights(light=np.zeros(clipped.shape, np.float32), judge=None)
    rim_px = rim_distance_px(clipped, fine.pitch_px)
    guess = np.where(clipped, 1 + GUESS * rim_px**2, 0).astype(np.float32)
    measured, hidden = coarse.light[at] - veil[at], coarse.clipped[at] > 0
    kernel = kernels.coarse.whole[colour]
    spread = spreading(kernel, hidden, often=True)
    first = not_outshining(pooled(guess), measured, hidden, spread)
    light = seek_lights(measured, hidden, spread, first, COARSE_STEPS)
    blurred = spread.spread(light)
    coarse_lights = CoarseLights(
        window=window, light=light, blurred=blurred, veil=veil[at], rim_px=rim_px
    )
    finer = refined(colour, coarse_lights, groups, fine, kernels)
    if clipped.size > FINE_CELLS:
        return _ColourLights(light=finer, judge=Judge(light, measured - blurred, kernel))
    measured = fine.light[(colour, *place.at)] - upsampled(veil[at], clipped.shape)
    kernel = kernels.fine.whole[colour]
    blurred = spreading(kernel, clipped).spread(finer)
    return _ColourLights(light=finer, judge=Judge(finer, measured - blurred, kernel))
