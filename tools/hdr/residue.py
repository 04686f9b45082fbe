r"""Errors beside lamps, tints at their rims, and decibels of networks over the solve alone.

    python -m tools.hdr.residue --bundle streak-hdr --sizes M
    python -m tools.hdr.residue --bundle streak-hdr --sizes M --scenes PICTURE.exr PICTURE.hdr ...

Scenes are nights of 768x512 pixels (`SOURCE:SEED`) or pictures of high dynamic range (their middle,
512 px at most), exposed so that 1.5 % of them saturate, at ISO 100. A lamp is what exceeds white in
the truth. In linear light, 1.0 = white:

- beside: mean absolute error from 3 to 20 px beside lamps
- undershoot: how far the darkest colour of a pixel there lies below the truth at most
- rims: mean distance of r, g, b / (r + g + b) from the truth, within 3 px of the edge of a lamp
- dB: PSNR at 2^8 times white, a border of 32 px left out

`bare lens` is the same scene through the lens without its plate, as developed: it has no streaks,
and its lamps stay clipped. The last lines are paired: scene by scene, with the standard error of
their mean.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from camkit.contracts import FloatArray
from camkit.errors import ContractError, DecodeError
from camkit.report.hdr_score import psnr_db
from camkit.report.kinds.hdr.capture import developer
from camkit.report.kinds.hdr.judge import HdrJudge, hdr_judge_of
from camkit.report.stress.rig import INPUT
from camkit.report.stress.scene import Scene
from camkit.scenes.saturation import CEILING
from camkit.scenes.scene_register import named_scene
from tools.hdr.depths import picture_scenes
from tools.hdr.record import in_one_line, new_parser, open_camera, origin_of, table, write_record

SIDES_PX: Final = (512, 768)
BESIDE_PX: Final = (3.0, 20.0)
RIM_PX: Final = 3.0
BORDER_PX: Final = 32
BARE: Final = "bare lens"
SOLVE: Final = "physics"
NUMBERS: Final = ("beside", "undershoot", "rims", "hdr_psnr_db")
DIGITS: Final = (4, 3, 4, 2)
_TINY: Final = 2.0**-8
Found = dict[str, dict[str, dict[str, float]]]
"""Scene -> method -> its numbers."""


@in_one_line
def main() -> None:
    """Print a table."""
    parser = new_parser(__doc__)
    parser.add_argument("--scenes", nargs="+", default=[f"night:{seed}" for seed in range(8)])
    arguments = parser.parse_args()
    bundle = open_camera(arguments.bundle, arguments.sizes)
    judge, found = hdr_judge_of(bundle, tuple(arguments.sizes), None), Found()
    for name in arguments.scenes:
        try:
            found[Path(name).name] = dict(measure(judge, scene_of(name)))
        except (ContractError, DecodeError) as error:  # darker than black, or no such exposure
            print(f"left out: {name}: {error}")
    print(to_text(found))
    write_record(arguments.output, {**origin_of(bundle, arguments.sizes), "scenes": found})


def scene_of(name: str) -> Scene:
    """Return a named scene or the middle of a picture, not yet exposed."""
    if Path(name).suffix:
        return picture_scenes([Path(name)])[0]
    return Scene(name=name, number=0, linear=named_scene(name, *SIDES_PX))


def measure(judge: HdrJudge, scene: Scene) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the numbers of a scene, method by method."""
    shot = judge.shoot(judge.lit(scene))
    pictures = dict(judge.rig.restore(shot.coded).pictures)
    pictures.pop(INPUT, None)  # the solve takes its streaks out
    pictures[BARE] = developer(judge.rig.bundle, threads=1).start(shot.bare).fill()
    for method, picture in pictures.items():
        numbers = numbers_of(picture, shot.truth)
        yield method, dict(zip(NUMBERS, map(float, numbers), strict=True))


def numbers_of(picture: FloatArray, truth: FloatArray) -> tuple[float, float, float, float]:
    """Return what `NUMBERS` names; NaN beside lamps where there is none."""
    lamps = truth.max(axis=0) > 1
    gap = picture.astype(np.float64) - truth
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    level_db = psnr_db(float(np.square(gap[inside]).mean()), CEILING)
    if not lamps.any() or lamps.all():
        return np.nan, np.nan, np.nan, level_db
    outside, within = distance_transform_edt(~lamps), distance_transform_edt(lamps)
    ring = (outside >= BESIDE_PX[0]) & (outside <= BESIDE_PX[1])
    rim = np.maximum(outside, within) <= RIM_PX
    tint = np.linalg.norm(_chroma(picture[:, rim]) - _chroma(truth[:, rim]), axis=0)
    return np.abs(gap[:, ring]).mean(), -gap[:, ring].min(), tint.mean(), level_db


def _chroma(light: FloatArray) -> NDArray[np.float64]:
    """Return the share of each colour in (3, n) light; what is darker than black counts as that."""
    seen = np.maximum(light.astype(np.float64), 0) + _TINY / 3
    return np.asarray(seen / seen.sum(axis=0))


def to_text(found: Found) -> str:
    """Return a table of all scenes, their mean, and paired gains over the solve."""
    methods = list(next(iter(found.values())))
    rows = [
        [scene, method, *_cells([numbers[name] for name in NUMBERS])]
        for scene, own in found.items()
        for method, numbers in own.items()
    ]
    lines = []
    for method in methods:
        values = np.array([[own[method][name] for name in NUMBERS] for own in found.values()])
        rows.append(["mean", method, *_cells(np.nanmean(values, axis=0))])
        if method not in (SOLVE, BARE):
            gain = [
                own[method]["hdr_psnr_db"] - own[SOLVE]["hdr_psnr_db"] for own in found.values()
            ]
            error = np.std(gain, ddof=1) / np.sqrt(len(gain)) if len(gain) > 1 else np.nan
            lines.append(
                f"{method} over {SOLVE}, {len(gain)} scenes: {np.mean(gain):+.2f} dB, "
                f"standard error {error:.2f}, worst {min(gain):+.2f}"
            )
    return "\n".join([table(["scene", "method", *NUMBERS], rows), *lines])


def _cells(numbers: Sequence[float] | NDArray[np.float64]) -> list[str]:
    return [f"{value:.{digits}f}" for value, digits in zip(numbers, DIGITS, strict=True)]


if __name__ == "__main__":
    main()
