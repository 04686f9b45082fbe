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
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.contracts import FloatArray
from camkit.errors import CamkitError
from camkit.report.bench.machine import describe_machine
from camkit.report.kinds.spad.bicubic import bicubic
from camkit.report.kinds.spad.score import psnr_db
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.time_axis import TimeAxis
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
LIT: Final = 0.1
"""Of white: frames that are darker show nothing, and are judged only with all others."""
SEED: Final = 180


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """Light in flight before an array.

    Attributes:
        light: (bins, m h, m w).
        seen: (bins, h, w) what its pixels see of it.
        kept: Bins that are judged and shown.
        axis: Of time.
        sub_pixel_mm: Size of a sub-pixel at the object.
    """

    light: FloatArray
    seen: FloatArray
    kept: NDArray[np.int64]
    axis: TimeAxis
    sub_pixel_mm: float


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
        flight = flight_before(camera)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    rows: list[dict[str, Any]] = []
    films: dict[str, FloatArray] = {}
    for photons in PHOTONS:
        shown = _measured(camera, flight, photons, rows)
        if photons == SHOWN:
            films = shown
    options.out_dir.mkdir(parents=True, exist_ok=True)
    _show(films, flight, options.out_dir)
    record = {
        "machine": describe_machine(),
        "bundle_sha256": camera.bundle.sha256,
        "apart_ps": round(float(np.diff(flight.axis.centres_ps[flight.kept])[0]), 3),
        "frames": len(flight.kept),
        "bins": flight.axis.bins,
        "sub_pixel_mm": round(flight.sub_pixel_mm, 3),
        "rows": rows,
    }
    path = options.out_dir / "transient.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(path)
    return 0


def flight_before(camera: FineCamera) -> Flight:
    """Return the scene of an array.

    Raises:
        ContractError: If its bundle states no time bins and pulse.
    """
    axis, pulse = times_of(camera)
    edges = axis.edges_ps
    first, last = (float(edges[0] + share * (edges[-1] - edges[0])) for share in SPAN)
    size = camera.scale * camera.sensor.height_px, camera.scale * camera.sensor.width_px
    sight = mirrored(size, (first, last))
    light = light_of_depth(sight.times_ps * LIGHT_M_PER_PS / 2, sight.albedo, axis, pulse)
    step = max(1, round(APART_PS / axis.step_ps))
    return Flight(
        light=light,
        seen=seen_by(camera, light),
        kept=np.arange(step // 2, axis.bins, step),
        axis=axis,
        sub_pixel_mm=pixel_mm(sight),
    )


def _measured(
    camera: FineCamera, flight: Flight, photons: float, rows: list[dict[str, Any]]
) -> dict[str, FloatArray]:
    """Return what is shown of every way, white = 1, and put a row for each to the others."""
    counts, scale = _counted(flight.seen, photons)
    light = flight.light[flight.kept] * np.float32(scale)
    white = float(np.percentile(light, WHITE))
    truth = np.asarray(np.clip(light / white, 0, 1), np.float32)
    shown = {"truth": truth, "counts": np.asarray(counts[flight.kept] / white, np.float32)}
    for name, restore in ways_of(camera).items():
        restore(counts[:1])  # what is made when first asked for
        began = time.process_time()
        made = restore(counts)
        seconds = time.process_time() - began
        shown[name] = np.asarray(np.clip(made[flight.kept] / white, 0, 1), np.float32)
        rows.append(_row(name, photons, truth, shown[name]) | {"cpu_s": round(seconds, 3)})
        print(rows[-1])
    return shown


def _show(films: dict[str, FloatArray], flight: Flight, folder: Path) -> None:
    titles = [f"{t:.0f} ps" for t in flight.axis.centres_ps[flight.kept]]
    lit = np.flatnonzero(films["truth"].max(axis=(1, 2)) > LIT)
    chosen = np.unique(lit[np.linspace(0, len(lit) - 1, IN_STRIP).astype(int)])
    write_strip(folder / "transient.png", films, titles, chosen.tolist(), 1.0)
    write_film(folder / "transient.mp4", films, 1.0)


def ways_of(camera: FineCamera) -> dict[str, Callable[[FloatArray], FloatArray]]:
    """Return way -> photons (bins, h, w) to photons (bins, m h, m w)."""

    def finer(counts: FloatArray, *, size: str | None) -> FloatArray:
        return finer_frames(camera, counts, 0.0, size)

    return {
        **{f"net {size}": partial(finer, size=size) for size in camera.sizes},
        "linear": partial(finer, size=None),
        "bicubic": lambda counts: np.stack([bicubic(c, camera.grid) for c in counts]),
    }


def _counted(seen: FloatArray, photons: float) -> tuple[FloatArray, float]:
    """Return counts (bins, h, w), and photons over light."""
    mean = scaled_to(seen, photons)
    scale = photons * seen[0].size / float(seen.sum(dtype=np.float64))
    rng = np.random.default_rng((SEED, int(photons)))
    return count_times(mean, "gate", Disturbances(), rng).astype(np.float32), scale


def _row(name: str, photons: float, truth: FloatArray, made: FloatArray) -> dict[str, Any]:
    bright = [psnr_db(m, t) for m, t in zip(made, truth, strict=True) if t.max() > LIT]
    return {
        "method": name,
        "photons": photons,
        "psnr_db": round(psnr_db(made, truth), 3),
        "psnr_least_db": round(min(bright), 3),
    }


if __name__ == "__main__":
    sys.exit(main())
