"""The worst patches of a scenario: the same square of the truth and of every method."""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from camkit.contracts import FloatArray
from camkit.report.stress.break_point import sound_values
from camkit.report.stress.curve import Curve, margins
from camkit.report.stress.score import PATCH_PX
from camkit.report.stress.verdict import Examiner, SweptScene

ENLARGED: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Patches:
    """Pictures of one place.

    Attributes:
        value: Of the knob.
        scene: Name.
        x_px: Left edge in the capture.
        y_px: Top edge.
        pictures: "sharp" and every method -> PNG.
    """

    value: float
    scene: str
    x_px: int
    y_px: int
    pictures: dict[str, bytes]


def worst_patches(
    curve: Curve, judge: Examiner, scenes: tuple[SweptScene, ...], method: str
) -> Patches | None:
    """Take the worst capture of a scenario again and cut its worst patch.

    Args:
        curve: What was measured.
        judge: Restores and judges.
        scenes: Of the sweep.
        method: Whose worst patch.

    Returns:
        None if the scenario takes no photographs or the method gave nothing to compare.
    """
    place = worst_place(curve, method)
    if curve.scenario.shoot is None or place is None:
        return None
    value, name = curve.values[place[0]], curve.scenes[place[1]]
    scene = next((s for s in scenes if s.name == name), None)
    patch_px = curve.outcomes[place][method].patch_px
    if scene is None or patch_px is None:
        return None
    shot = curve.scenario.shoot(judge, scene, value)
    pictures = judge.pictures(shot)
    x, y = patch_px
    cut = np.s_[:, y : y + PATCH_PX, x : x + PATCH_PX]
    return Patches(
        value=value,
        scene=name,
        x_px=x,
        y_px=y,
        pictures={m: _png(picture[cut]) for m, picture in pictures.items()},
    )


def worst_place(curve: Curve, method: str) -> tuple[int, int] | None:
    """Return (value index, scene index) of the capture to look at; None if nothing was compared.

    The value is the first broken one, else that of the least gain in PSNR over its rivals; the
    scene is that of the least gain.
    """
    if method not in curve.methods:
        return None
    plain = [curve.psnr_db[m] for m in curve.rivals if m in curve.psnr_db and m != method]
    grid = curve.psnr_db[method] - (np.fmax.reduce(plain) if plain else 0.0)
    known = np.isfinite(grid)
    if not known.any():
        return None
    broken = np.flatnonzero(~sound_values(margins(curve, method)) & known.any(axis=1))
    if broken.size:
        row = int(min(broken, key=lambda i: abs(i - curve.nominal)))
    else:
        row = int(np.unravel_index(np.argmin(np.where(known, grid, np.inf)), grid.shape)[0])
    return row, int(np.argmin(np.where(known[row], grid[row], np.inf)))


def _png(picture: FloatArray) -> bytes:
    """Encode (3, h, w) sRGB values as an 8-bit PNG, enlarged without smoothing."""
    codes = np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)[::-1].transpose(1, 2, 0)
    big = np.kron(codes, np.ones((ENLARGED, ENLARGED, 1), np.uint8))
    done, data = cv2.imencode(".png", big)
    return data.tobytes() if done else b""
