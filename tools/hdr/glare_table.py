"""What removing glare gains: `python -m tools.hdr.glare_table -o docs/results/deglare.json`.

Night scenes behind a two-point star, and behind nothing. For each the PSNR (linear, peak 1, pixels
that are no light) before and after, the angle that was found and the one that was set; and for
scenes without streaks the PSNR of the result to what came in (null: the same picture). `--pictures`
does both with scenes of high dynamic range (EXR, HDR), and the second with any other picture, all
of them reduced to 1024 px at most.
"""

import argparse
import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.stages import Deglare
from camkit.contracts import FloatArray
from camkit.runtime.files.picture import read_light
from camkit.runtime.kinds.hdr.deglare.removal import Glare, GlareSettings, find_glare
from camkit.scenes.saturation import saturating_exposure, with_exposure
from tools.hdr.glare_twin import (
    SATURATED,
    Fading,
    exposed_scene,
    photographed,
    psnr_db,
    two_point_star,
)

SIDES_PX: Final = (384, 512)
SEEDS: Final = tuple(range(8))
ANGLES_DEG: Final = (5.0, -5.0, 3.1, -7.4)
FADINGS: Final[tuple[Fading, ...]] = ("exponential", "even")
MOST_PX: Final = 1024
LIGHT_SUFFIXES: Final = (".exr", ".hdr")
CLEAN_SEEDS: Final = tuple(range(20, 32))


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--clean-seeds", type=int, nargs="*", default=CLEAN_SEEDS)
    parser.add_argument("--pictures", type=Path, nargs="*", default=[])
    arguments = parser.parse_args()
    rows = [with_streaks(f"night:{seed}", night(seed), seed) for seed in arguments.seeds]
    clean = [without_streaks(f"night:{seed}", night(seed), seed) for seed in arguments.clean_seeds]
    real = []
    for path in arguments.pictures:
        scene = picture(path)
        clean.append(without_streaks(path.name, scene))
        if path.suffix in LIGHT_SUFFIXES:
            real.append(with_streaks(path.name, scene))
    print("| scene | fading | angle | found | before | after |\n|---|---|---|---|---|---|")
    for row in (*rows, *real):
        print("| " + " | ".join(str(cell) for cell in row.values()) + " |")
    means = [float(np.mean([row[name] for row in rows])) for name in ("before_db", "after_db")]
    print(f"mean {means[0]:.1f} -> {means[1]:.1f} dB")
    print("changed without streaks:", [row for row in clean if row["to_itself_db"] is not None])
    if arguments.output is not None:
        record = {"streaks": rows, "real": real, "clean": clean}
        arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def night(seed: int) -> FloatArray:
    """Return a night scene, exposed."""
    return exposed_scene(f"night:{seed}", *SIDES_PX)


def picture(path: Path) -> FloatArray:
    """Return a picture (3, h, w), linear; one of high dynamic range exposed as the night scenes."""
    light = read_light(path)
    side = -(-max(light.shape) // MOST_PX)
    height, width = light.shape[1] // side, light.shape[2] // side
    cells = light[:, : height * side, : width * side].reshape(3, height, side, width, side)
    small = np.asarray(cells.mean(axis=(2, 4), dtype=np.float32))
    if path.suffix not in LIGHT_SUFFIXES:
        return small
    found = saturating_exposure(small, np.eye(3), (1.0, 1.0, 1.0), SATURATED)
    return with_exposure(small, found.exposure)


def with_streaks(name: str, scene: FloatArray, seed: int = 0) -> dict[str, Any]:
    """Measure a scene behind the star; the seed chooses its angle and fading."""
    angle_deg, fading = ANGLES_DEG[seed % len(ANGLES_DEG)], FADINGS[seed % len(FADINGS)]
    shot = photographed(scene, two_point_star(math.radians(angle_deg), fading), seed)
    glare, cleared = deglared(shot.seen)
    return {
        "scene": name,
        "fading": fading,
        "angle_deg": angle_deg,
        "found_deg": glare.to_json()["angle_deg"],
        "before_db": round(psnr_db(shot.seen, shot, glare.settings.level), 2),
        "after_db": round(psnr_db(cleared, shot, glare.settings.level), 2),
    }


def without_streaks(name: str, scene: FloatArray, seed: int = 0) -> dict[str, Any]:
    """Measure a scene that needs nothing."""
    shot = photographed(scene, None, seed)
    glare, cleared = deglared(shot.seen)
    off = float(np.mean((cleared - shot.seen) ** 2, dtype=np.float64))
    return {
        "scene": name,
        "found_deg": glare.to_json()["angle_deg"],
        "to_itself_db": round(-10 * math.log10(off), 2) if off else None,
    }


def deglared(seen: FloatArray) -> tuple[Glare, FloatArray]:
    """Take the streaks out of a picture (3, h, w) that clips at 1, as the bundle does."""
    entry = Deglare()
    settings = GlareSettings(
        least_rad=math.radians(entry.least_angle_deg),
        most_rad=math.radians(entry.most_angle_deg),
        reach=entry.reach,
        level=entry.level,
    )
    _, height, width = seen.shape
    glare = find_glare(lambda: lambda top, bottom: seen[:, top:bottom], height, width, settings)
    cleared = seen.copy()
    glare.paint(cleared, 0, (1.0, 1.0, 1.0))
    return glare, cleared


if __name__ == "__main__":
    main()
