"""A fan at 3,750 turns a minute before the array of a bundle, with its plate and without.

    python -m tools.spad.high_speed --bundle spad-sr [--baselines FILE] --out-dir out/spad

The array takes 1,250 frames a second (the working point high_speed): the fan turns 18 degrees in
each, and is smeared over them. Told of every way: PSNR against what an array of the fine grid would
see in the same time, how far the angle of the blades is off, and frames made finer in a second of
one thread. Writes high-speed.json, a film and a strip of frames.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
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
from camkit.runtime.kinds.spad.finer.sampling import point_kernel
from camkit.runtime.kinds.spad.twin.array import see_through
from camkit.runtime.kinds.spad.twin.counting import Disturbances, count_frames
from camkit.runtime.kinds.spad.twin.working import WORKING_POINTS
from tools.spad.fan import Fan
from tools.spad.strip import write_film, write_strip

TURNS_PER_MINUTE: Final = 3750.0
PHOTONS: Final = (10_000.0, 1000.0, 100.0, 30.0, 10.0)
"""Of white in a frame."""
SHOWN: Final = 1000.0
FRAMES: Final = 40
IN_STRIP: Final = (0, 1, 2, 3, 4)
LEAST_DEG: Final = 0.5
LOW_FILL: Final = "low_fill"
SEED: Final = 3750

Restore = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """How frames are taken and made finer.

    Attributes:
        plate: Whether there is one.
        method: Its name.
        restore: Photons (n, h, w) -> photons (n, m h, m w).
    """

    plate: bool
    method: str
    restore: Restore

    @property
    def title(self) -> str:
        """Name it for people."""
        return f"{self.method}, {'plate' if self.plate else 'no plate'}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure all ways; write JSON, a film and a strip."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="spad-sr")
    parser.add_argument("--baselines", help="bundle with a network that has no plate")
    parser.add_argument("--frames", type=int, default=FRAMES)
    parser.add_argument("--out-dir", type=Path, default=Path("out/spad"))
    options = parser.parse_args(arguments)
    try:
        camera = FineCamera.of(open_bundle(find_bundle(options.bundle)))
        plain = None
        if options.baselines is not None:
            plain = FineCamera.of(open_bundle(find_bundle(options.baselines)), role=LOW_FILL)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    fan = fan_before(camera)
    truth, angles = fan.frames(options.frames)
    ways, rows, films = ways_of(camera, plain), [], {}
    for photons in PHOTONS:
        seen = {plate: _counted(camera, truth, photons, plate=plate) for plate in (True, False)}
        for way in ways:
            made, row = _measured(way, seen[way.plate], (truth, angles), fan, photons)
            rows.append(row)
            print(row)
            if photons == SHOWN:
                films[way.title] = made
        if photons == SHOWN:
            films = {"truth": truth, "counts, no plate": seen[False] / photons, **films}
    options.out_dir.mkdir(parents=True, exist_ok=True)
    titles = [f"{math.degrees(angle):.0f} degrees" for angle in angles]
    shown = [n for n in IN_STRIP if n < options.frames]
    write_strip(options.out_dir / "high-speed.png", films, titles, shown, 1.0)
    write_film(options.out_dir / "high-speed.mp4", films, 1.0)
    record = {
        "machine": describe_machine(),
        "turns_per_minute": TURNS_PER_MINUTE,
        "frames_per_second": round(WORKING_POINTS["high_speed"].rate_hz, 3),
        "turn_deg": round(math.degrees(fan.turn_rad), 3),
        "frames": options.frames,
        "bundle_sha256": camera.bundle.sha256,
        "rows": rows,
    }
    path = options.out_dir / "high-speed.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(path)
    return 0


def fan_before(camera: FineCamera) -> Fan:
    """Return the fan that fills the height of an array."""
    height = camera.scale * camera.sensor.height_px
    turn = 2 * math.pi * TURNS_PER_MINUTE / 60 / WORKING_POINTS["high_speed"].rate_hz
    return Fan(
        size_px=(height, camera.scale * camera.sensor.width_px),
        radius_px=0.44 * height,
        hub_px=0.07 * height,
        turn_rad=turn,
    )


def ways_of(camera: FineCamera, plain: FineCamera | None) -> list[Way]:
    """Return all ways; `plain` has the network of the array without a plate."""
    found = [
        Way(plate=True, method=f"net {size}", restore=_by_network(camera, size))
        for size in camera.sizes
    ]
    found.append(Way(plate=True, method="linear", restore=_linear(camera, camera.kernel)))
    if plain is not None:
        size = plain.size(None)
        found.append(Way(plate=False, method=f"net {size}", restore=_by_network(plain, size)))
    point = point_kernel(camera.kernel.shape[0])
    found.append(Way(plate=False, method="linear", restore=_linear(camera, point)))
    found.append(Way(plate=False, method="bicubic", restore=_bicubic(camera)))
    return found


def _by_network(camera: FineCamera, size: str) -> Restore:
    return lambda frames: finer_frames(camera, frames, 0.0, size)


def _linear(camera: FineCamera, kernel: FloatArray) -> Restore:

    def restore(frames: FloatArray) -> FloatArray:
        estimate = camera.linear(float(frames.mean()), kernel)
        return np.asarray(np.maximum(estimate(frames), 0), np.float32)

    return restore


def _bicubic(camera: FineCamera) -> Restore:
    return lambda frames: np.maximum(np.stack([bicubic(f, camera.grid) for f in frames]), 0)


def _counted(camera: FineCamera, light: FloatArray, photons: float, *, plate: bool) -> FloatArray:
    kernel = camera.kernel if plate else point_kernel(camera.kernel.shape[0])
    mean = see_through(light, kernel, camera.grid) * photons
    rng = np.random.default_rng((SEED, int(photons)))
    return count_frames(mean, Disturbances(), rng).astype(np.float32)


def _measured(
    way: Way,
    counts: FloatArray,
    truth: tuple[FloatArray, np.ndarray[Any, np.dtype[np.float64]]],
    fan: Fan,
    photons: float,
) -> tuple[FloatArray, dict[str, Any]]:
    way.restore(counts[:1])  # what is made when first asked for
    began = time.perf_counter()
    made = np.clip(way.restore(counts) / photons, 0, 1)
    seconds = time.perf_counter() - began
    off_deg = np.array(
        [
            math.degrees(fan.off_by(fan.angle_of(picture), angle))
            for picture, angle in zip(made, truth[1], strict=True)
        ]
    )
    levels = [psnr_db(picture, sharp) for picture, sharp in zip(made, truth[0], strict=True)]
    return made, {
        "plate": way.plate,
        "method": way.method,
        "photons": photons,
        "psnr_db": round(float(np.mean(levels)), 3),
        "psnr_least_db": round(min(levels), 3),
        "angle_rms_deg": round(float(np.sqrt(np.mean(off_deg**2))), 4),
        "angle_most_deg": round(float(np.abs(off_deg).max()), 4),
        "within_half_degree": round(float((np.abs(off_deg) <= LEAST_DEG).mean()), 4),
        "made_per_second": round(len(counts) / seconds, 1),
    }


if __name__ == "__main__":
    sys.exit(main())
