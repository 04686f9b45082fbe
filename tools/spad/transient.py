"""Light in flight: a pulse sweeps over an object and its mirror image, as the array sees it.

    python -m tools.spad.transient --bundle spad-sr --out-dir out/spad

The scan of the bundle's gate is recorded as `camkit simulate` records an NPZ of `transient`, and
every bin is made finer: by the networks, linearly, and by bicubic interpolation. Frames 180 ps
apart (every ninth step of 20 ps) are judged by PSNR against light of the fine grid, white the
brightest of it, and shown. Writes transient.json, a film and a strip of frames.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.contracts import FloatArray
from camkit.errors import CamkitError
from camkit.report.bench.machine import describe_machine
from camkit.report.kinds.spad.bicubic import bicubic
from camkit.report.kinds.spad.score import psnr_db
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.kinds.spad.twin.counting import Disturbances, count_times, scaled_to
from camkit.runtime.kinds.spad.twin.scene import light_of_depth
from camkit.runtime.kinds.spad.twin.simulate import seen_by, times_of
from tools.spad.mirror import mirrored, pixel_mm
from tools.spad.strip import write_film, write_strip

APART_PS: Final = 180.0
PHOTONS: Final = (100_000.0, 10_000.0, 1000.0)
"""Signal of a pixel in all bins, on average."""
SHOWN: Final = 10_000.0
SPAN: Final = (0.15, 0.9)
"""Of the time of all bins, in which the pulse is seen."""
WHITE: Final = 99.9
"""Percentile of the light that is white."""
IN_STRIP: Final = 6
SEED: Final = 180


def main(arguments: Sequence[str] | None = None) -> int:
    """Record, make finer, judge; write JSON, a film and a strip."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="spad-sr")
    parser.add_argument("--out-dir", type=Path, default=Path("out/spad"))
    options = parser.parse_args(arguments)
    try:
        camera = FineCamera.of(open_bundle(find_bundle(options.bundle)))
        axis, pulse = times_of(camera)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    edges = axis.edges_ps
    first, last = (float(edges[0] + share * (edges[-1] - edges[0])) for share in SPAN)
    size = camera.scale * camera.sensor.height_px, camera.scale * camera.sensor.width_px
    sight = mirrored(size, (first, last))
    light = light_of_depth(sight.times_ps * LIGHT_M_PER_PS / 2, sight.albedo, axis, pulse)
    step = max(1, round(APART_PS / axis.step_ps))
    kept = np.arange(step // 2, axis.bins, step)
    rows: list[dict[str, Any]] = []
    films: dict[str, FloatArray] = {}
    seen = seen_by(camera, light)
    for photons in PHOTONS:
        counts, scale = _counted(seen, photons)
        white = float(np.percentile(light[kept], WHITE)) * scale
        truth = np.clip(light[kept] * (scale / white), 0, 1)
        shown = {"truth": truth, "counts": np.asarray(counts[kept] / white, np.float32)}
        for name, restore in ways_of(camera).items():
            restore(counts[:1])  # what is made when first asked for
            began = time.process_time()
            made = restore(counts)
            seconds = time.process_time() - began
            shown[name] = np.clip(made[kept] / white, 0, 1)
            rows.append(_row(name, photons, truth, shown[name]) | {"cpu_s": round(seconds, 3)})
            print(rows[-1])
        if photons == SHOWN:
            films = shown
    options.out_dir.mkdir(parents=True, exist_ok=True)
    titles = [f"{t:.0f} ps" for t in axis.centres_ps[kept]]
    chosen = np.unique(np.linspace(1, len(kept) - 2, min(IN_STRIP, len(kept))).astype(int))
    write_strip(options.out_dir / "transient.png", films, titles, chosen.tolist(), 1.0)
    write_film(options.out_dir / "transient.mp4", films, 1.0)
    record = {
        "machine": describe_machine(),
        "bundle_sha256": camera.bundle.sha256,
        "apart_ps": round(step * axis.step_ps, 3),
        "frames": len(kept),
        "bins": axis.bins,
        "sub_pixel_mm": round(pixel_mm(sight), 3),
        "rows": rows,
    }
    path = options.out_dir / "transient.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(path)
    return 0


def ways_of(camera: FineCamera) -> dict[str, Callable[[FloatArray], FloatArray]]:
    """Give way -> photons (bins, h, w) to photons (bins, m h, m w)."""
    found: dict[str, Callable[[FloatArray], FloatArray]] = {
        f"net {size}": lambda counts, size=size: finer_frames(camera, counts, 0.0, size)  # type: ignore[misc]
        for size in camera.sizes
    }
    found["linear"] = lambda counts: finer_frames(camera, counts, 0.0, None)
    found["bicubic"] = lambda counts: np.stack([bicubic(c, camera.grid) for c in counts])
    return found


def _counted(seen: FloatArray, photons: float) -> tuple[FloatArray, float]:
    """Give counts (bins, h, w), and photons over light."""
    mean = scaled_to(seen, photons)
    scale = photons * seen[0].size / float(seen.sum(dtype=np.float64))
    rng = np.random.default_rng((SEED, int(photons)))
    return count_times(mean, "gate", Disturbances(), rng).astype(np.float32), scale


def _row(name: str, photons: float, truth: FloatArray, made: FloatArray) -> dict[str, Any]:
    bright = [psnr_db(m, t) for m, t in zip(made, truth, strict=True) if t.max() > 0.1]
    return {
        "method": name,
        "photons": photons,
        "psnr_db": round(psnr_db(made, truth), 3),
        "psnr_least_db": round(min(bright), 3),
    }


if __name__ == "__main__":
    sys.exit(main())
