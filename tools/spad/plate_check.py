"""A plate of dots simulated again: through its real aperture, pixels, focus, and as badly etched.

    python -m tools.spad.plate_check --out-dir out/spad

For every PSF a plate of 8 levels is made as `camkit plate match` makes it. Told are correlation,
RMSE (peaks at 1) and light in the 11x11 places of

making    each step of the way to the plate, on cells of 9.9 um, and Gerchberg-Saxton on 11x11 cells
levels    the plate at 2, 4, 8, 16 levels
views     what the round active areas of the array see: 16x16 units and one unit alone, square and
          round apertures, in focus and out, plates that are turned and shifted
etching   the same of plates whose masks all etch too deep by a share, and not deep enough

Without --psf these are the PSF that comes with camkit, `spad-sr`, and a Gaussian of 1.84
sub-pixels.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.cli.design.plate.target import read_target
from camkit.errors import CamkitError
from camkit.models_def.kinds.spad.sampling import GAUSSIAN_SIGMA, gaussian_psf
from camkit.models_def.optics.diffraction.plate import PLATES
from camkit.models_def.optics.dots.camera import ORDERS, DotCamera
from camkit.models_def.optics.dots.effective import effective_psf
from camkit.models_def.optics.dots.gerchberg_saxton import gerchberg_saxton
from camkit.models_def.optics.dots.match import Match, match_dots
from camkit.models_def.optics.dots.pattern import View
from camkit.models_def.optics.dots.target import FloatGrid, likeness, to_target
from camkit.models_def.optics.dots.unit import DotPlate, phase_light
from camkit.report.bench.machine import describe_machine

LEVELS: Final = 8
LEVEL_COUNTS: Final = (2, 4, 8, 16)
DEFOCUS_MM: Final = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)
TURNS_DEG: Final = (1.0, 2.0, 4.0, 8.0)
SHIFTS_MM: Final = (0.2, 0.436, 2.0)
DEPTH_ERRORS: Final = (-0.1, -0.05, -0.02, 0.02, 0.05, 0.1)
WIDE: Final = 61
"""Sub-pixels along the side of the window in which the light beside the dots is sought."""
Row = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Check plates and write JSON.

    Raises:
        SystemExit: If a PSF cannot be read; says why.
    """
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out-dir", type=Path, default=Path("out/spad"))
    parser.add_argument("--psf", type=Path, nargs="+", help="as of `camkit plate match`")
    parser.add_argument("--cells", type=int, default=DotCamera().cells)
    parser.add_argument("--tiles", type=int, default=DotCamera().tiles)
    options = parser.parse_args(arguments)
    try:
        camera = DotCamera(cells=options.cells, tiles=options.tiles)
        plates = [_checked(*psf, camera) for psf in _targets(options.psf).items()]
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    options.out_dir.mkdir(parents=True, exist_ok=True)
    record = {"machine": describe_machine(), "cell_um": round(camera.cell_um, 3), "plates": plates}
    path = options.out_dir / "plate.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(path)
    return 0


def _targets(paths: Sequence[Path] | None) -> Mapping[str, FloatGrid]:
    if paths:
        return {path.stem: to_target(read_target(path)) for path in paths}
    return {
        "spad-sr": to_target(read_target(PLATES / "spad-sr.safetensors")),
        f"gaussian-{GAUSSIAN_SIGMA:.2f}": to_target(gaussian_psf()),
    }


def _checked(name: str, target: FloatGrid, camera: DotCamera) -> Row:
    began = time.process_time()
    found = match_dots(target, camera, LEVELS, np.random.default_rng(0))
    seconds = time.process_time() - began
    print(f"{name}: {found.reached} in {seconds:.1f} CPU-s", file=sys.stderr)
    return {
        "psf": name,
        "cpu_seconds": round(seconds, 2),
        "making": _making(found, target),
        "levels": list(_levels(target, camera)),
        "views": [_seen(found.plate, target, view) for view in _views()],
        "etching": list(_etching(found.plate, target)),
    }


def _making(found: Match, target: FloatGrid) -> Row:
    first = phase_light(gerchberg_saxton(target, ORDERS, np.random.default_rng(0)))
    return {
        "gerchberg_saxton_11_cells": likeness(first, target).to_json(),
        "gerchberg_saxton": found.gerchberg_saxton.to_json(),
        "refined": found.refined.to_json(),
        "rounded": found.rounded.to_json(),
        "descended": found.reached.to_json(),
    }


def _levels(target: FloatGrid, camera: DotCamera) -> Iterator[Row]:
    for levels in LEVEL_COUNTS:
        found = match_dots(target, camera, levels, np.random.default_rng(0))
        yield {"levels": levels, **found.reached.to_json()}


def _views() -> Iterator[View]:
    for tiles in (None, 1):
        yield from (View(tiles=tiles, defocus_mm=d) for d in (0.0, *DEFOCUS_MM))
    yield View(aperture="circle")
    yield from (View(turn_rad=math.radians(turn)) for turn in TURNS_DEG)
    yield from (View(shift_mm=(shift, shift)) for shift in SHIFTS_MM)


def _seen(plate: DotPlate, target: FloatGrid, view: View) -> Row:
    camera, light = plate.camera, effective_psf(plate.height_um, plate.camera, view)
    whole = replace(camera, active_um=camera.spacing_um)
    return {
        "tiles": camera.tiles if view.tiles is None else view.tiles,
        "aperture": view.aperture,
        "defocus_mm": view.defocus_mm,
        "turn_deg": round(math.degrees(view.turn_rad), 3),
        "shift_mm": list(view.shift_mm),
        **likeness(light, target).to_json(),
        # what a circle as wide as a sub-pixel would see of the light near the dots
        "beside": round(_beside(plate.height_um, whole, view), 5),
    }


def _beside(height_um: FloatGrid, camera: DotCamera, view: View) -> float:
    """Return the light in places outside the 11x11, as a share of that in them."""
    light = effective_psf(height_um, camera, view, side=WIDE)
    edge = (WIDE - ORDERS) // 2
    inside = float(light[edge:-edge, edge:-edge].sum())
    return float(light.sum()) / inside - 1


def _etching(plate: DotPlate, target: FloatGrid) -> Iterator[Row]:
    masks = plate.masks.shape[0]
    for error in DEPTH_ERRORS:
        seen = effective_psf(plate.etched_um((error,) * masks), plate.camera)
        yield {"depth_error": error, **likeness(seen, target).to_json()}


if __name__ == "__main__":
    sys.exit(main())
