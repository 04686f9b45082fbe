r"""Scenes from 1 m to infinity, the camera refocused on each: what the frozen streaks lose.

    python -m tools.hdr.depths --bundle streak-hdr -o docs/results/hdr-depths.json

The dissertation's figure 5.6: the light comes from another depth, and the sensor is moved to where
it is sharp. The plate stays, so its arms grow with the distance of the sensor: 4.2 % from 5 m to
1 m. Captures are taken with the dense kernels of the bundle's plate, focused on each depth; they
are restored as the bundle knows its arms (`frozen`), and as a bundle would that was frozen for that
depth (`told`). `--depth-m` tells the depth of a light before a sensor that stays, which is
something else. `--pictures` names scenes of high dynamic range, judged apart from the nights.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.frozen_optics import psf_of_streaks
from camkit.bundle.optics import STREAKS
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.streak_file import streaks_to_bytes
from camkit.bundle.writer import write_bundle
from camkit.contracts import FrozenPsf, depth_name
from camkit.models_def.optics.diffraction.plate import Plate, read_plate
from camkit.models_def.optics.diffraction.plate_optics import plate_kernels
from camkit.models_def.optics.diffraction.plate_streaks import SIDE_PX, plate_streaks
from camkit.report.kinds.hdr.judge import HdrJudge, hdr_judge_of
from camkit.report.quality import read_picture
from camkit.report.stress.scene import Scene
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.runtime.twin.light import lens_of
from camkit.streaks import StreakOptics
from camkit.units import MM_PER_M
from tools.hdr.record import in_one_line, new_parser, open_camera, origin_of, table, write_record

DEPTHS_M: Final = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0, float("inf"))
SEEDS: Final = tuple(range(8))
NIGHT_PX: Final = 384
PICTURE_PX: Final = 512
WAYS: Final = ("frozen", "told")

Scores = dict[str, dict[str, dict[str, float]]]
"""Way -> method -> numbers of a scene."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Refocused:
    """A camera whose sensor was moved.

    Attributes:
        depth_mm: Where it is sharp.
        distance_mm: From the plate to the sensor.
        psf: What its light goes through: the plate's own kernels.
        streaks: The same by core, arms and haze, as freezing gives it.
    """

    depth_mm: float
    distance_mm: float
    psf: FrozenPsf
    streaks: StreakOptics


@in_one_line
def main() -> None:
    """Print a table."""
    parser = new_parser(__doc__)
    parser.add_argument("--depths-m", type=float, nargs="+", default=DEPTHS_M)
    parser.add_argument("--seeds", type=int, nargs="*", default=SEEDS)
    parser.add_argument("--pictures", type=Path, nargs="*", default=[])
    arguments = parser.parse_args()
    bundle = open_camera(arguments.bundle, arguments.sizes)
    scenes = night_scenes(arguments.seeds) + picture_scenes(arguments.pictures)
    found = measure(bundle, arguments.sizes, scenes, arguments.depths_m)
    origin = origin_of(bundle, arguments.sizes)
    record = {**origin, "focus_m": bundle.reference_depth_mm / MM_PER_M, "depths": found}
    print(to_text(record))
    write_record(arguments.output, record)


def night_scenes(seeds: Sequence[int]) -> list[Scene]:
    """Return night scenes, not yet exposed."""
    return [
        Scene(name=f"night:{seed}", number=n, linear=night_scene(seed, NIGHT_PX, NIGHT_PX))
        for n, seed in enumerate(seeds)
    ]


def picture_scenes(paths: Sequence[Path]) -> list[Scene]:
    """Return the middles of scenes of high dynamic range."""
    found = []
    for number, path in enumerate(paths):
        linear = read_picture(path, PICTURE_PX)
        height, width = (side // 2 * 2 for side in linear.shape[1:])
        # a scene in which nothing exceeds white would be taken for one without lights
        linear = linear[:, :height, :width] / np.float32(linear.mean())
        found.append(Scene(name=path.name, number=number, linear=np.ascontiguousarray(linear)))
    return found


def refocused(plate: Plate, bundle: Bundle, depth_mm: float) -> Refocused:
    """Move the sensor of a bundle's camera to where a depth is sharp.

    Kernels and arms keep the bundle's name of its one depth, by which it asks for them.
    """
    moved = replace(plate, bench=replace(plate.bench, focus_mm=depth_mm))
    known = bundle.streaks
    sensor = bundle.manifest.sensor
    assert sensor.type != "spad"  # no camera that counts photons writes streaks
    streaks = plate_streaks(moved, sensor, wavelengths_um=known.wavelengths_um)
    light = plate_kernels(
        moved,
        depths_m=[depth_mm / MM_PER_M],
        wavelengths_um=[float(wave) for wave in known.wavelengths_um],
        side_px=SIDE_PX,
        pitch_um=known.pixel_pitch_um,
    )
    light = light / light.sum(axis=(-2, -1), keepdims=True, dtype=np.float64)
    named = np.array([bundle.reference_depth_mm])
    streaks = replace(streaks, depths_mm=named)
    psf = psf_of_streaks(streaks, len(sensor.channels))
    return Refocused(
        depth_mm=depth_mm,
        distance_mm=moved.bench.distance_mm,
        psf=replace(psf, kernels=light[None].astype(np.float32)),
        streaks=streaks,
    )


def measure(
    bundle: Bundle, sizes: Sequence[str], scenes: Sequence[Scene], depths_m: Sequence[float]
) -> list[dict[str, Any]]:
    """Return what every depth gives, beside the depth that the bundle was frozen for."""
    plate, judge = read_plate(bundle.path), hdr_judge_of(bundle, tuple(sizes), None)
    nominal_m = bundle.reference_depth_mm / MM_PER_M
    scored: dict[float, dict[str, Scores]] = {}
    distances_mm: dict[float, float] = {}
    for depth_m in sorted({*depths_m, nominal_m}):
        camera = refocused(plate, bundle, depth_m * MM_PER_M)
        distances_mm[depth_m] = camera.distance_mm
        scored[depth_m] = _scores(bundle, judge, sizes, scenes, camera)
    return [
        {
            "depth": depth_name(depth_m * MM_PER_M),
            "arms_longer_percent": round(100 * (distance_mm / distances_mm[nominal_m] - 1), 2),
            "sets": _sets(scored[depth_m], scored[nominal_m]),
            "scenes": scored[depth_m],
        }
        for depth_m, distance_mm in distances_mm.items()
    ]


def _scores(
    bundle: Bundle,
    judge: HdrJudge,
    sizes: Sequence[str],
    scenes: Sequence[Scene],
    camera: Refocused,
) -> dict[str, Scores]:
    with tempfile.TemporaryDirectory() as folder:
        told = hdr_judge_of(_frozen_anew(bundle, camera, Path(folder)), tuple(sizes), None)
        found: dict[str, Scores] = {}
        lens = lens_of(camera.psf, judge.rig.sensor, depth_mm=bundle.reference_depth_mm)
        for scene in scenes:
            shot = judge.shoot(judge.lit(scene), lens=lens)
            found[scene.name] = {
                way: _numbers(one.score(shot).outcomes)
                for way, one in zip(WAYS, (judge, told), strict=True)
            }
    return found


def _frozen_anew(bundle: Bundle, camera: Refocused, folder: Path) -> Bundle:
    members = {name: bundle.member(name) for name in bundle.names}
    path = folder / "told.camkit"
    write_bundle(path, bundle.manifest, members | {STREAKS: streaks_to_bytes(camera.streaks)})
    return open_bundle(path)


def _numbers(outcomes: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    return {
        name: {"hdr_psnr_db": round(outcome.psnr_db, 3)}
        | {key: round(value, 3) for key, value in outcome.extra.items()}
        for name, outcome in outcomes.items()
        if outcome.psnr_db is not None
    }


def _sets(scored: dict[str, Scores], nominal: dict[str, Scores]) -> dict[str, Any]:
    """Sum up night scenes and pictures, each beside the depth of the bundle."""
    names = {"night": [n for n in scored if n.startswith("night:")]}
    names["pictures"] = [n for n in scored if n not in names["night"]]
    return {
        name: {
            way: {
                method: _summary(
                    [(_db(scored[n], way, method), _db(nominal[n], way, method)) for n in own]
                )
                for method in scored[own[0]][way]
            }
            for way in WAYS
        }
        for name, own in names.items()
        if own
    }


def _db(scores: Scores, way: str, method: str) -> float:
    return scores[way][method]["hdr_psnr_db"]


def _summary(pairs: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Return the mean and what is lost from the second of each pair to the first."""
    lost = [nominal - found for found, nominal in pairs]
    return {
        "hdr_psnr_db": round(float(np.mean([found for found, _ in pairs])), 2),
        "drop_db": round(float(np.mean(lost)), 2),
        "worst_drop_db": round(max(lost), 2),
    }


def to_text(record: Mapping[str, Any]) -> str:
    """Return a table of every set of scenes."""
    parts = []
    first = record["depths"][0]["sets"]
    for name, ways in first.items():
        methods = [m for m in ways["frozen"] if m != "input"]
        head = ["depth", "arms longer", "LDR"]
        head += [f"{m}, {w}: dB, drop (worst)" for m in methods for w in WAYS]
        rows = []
        for row in record["depths"]:
            own = row["sets"][name]
            cells = [row["depth"], f"{row['arms_longer_percent']:+.1f} %"]
            cells.append(f"{own['frozen']['input']['hdr_psnr_db']:.1f}")
            for found in (own[way][method] for method in methods for way in WAYS):
                drop, worst = found["drop_db"], found["worst_drop_db"]
                cells.append(f"{found['hdr_psnr_db']:.1f}, {drop:.2f} ({worst:.2f})")
            rows.append(cells)
        parts.append(f"{name}\n\n{table(head, rows)}")
    return "\n\n".join(parts)


if __name__ == "__main__":
    main()
