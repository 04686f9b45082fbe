"""A made camera on the same captures: developed alone, behind its filter, behind its network.

scenes nobody trained on -> fabricated copies traced afresh -> three places, two ISOs -> PSNR

Gains are paired: the same capture by two methods. Their error is that over scenes.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import PRESCRIPTION, Bundle
from camkit.progress import working
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.quality import Exposed, Shot, expose, inner_srgb, list_set, psnr, read_picture
from camkit.report.sensor_geometry import in_sensor_geometry
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.twin.light import stated_balance
from camkit.scenes.procedural import procedural_scene

FILTER: Final = "wiener"
TRUTH: Final = "truth"
SCENES: Final = 6
SIDE_PX: Final = 384
FIRST_SEED: Final = 91_000
"""Of scenes that no training draws."""
POSITIONS: Final = (0, 2, 4)
ISOS: Final = (100.0, 1600.0)
COPIES: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """Decibels of one method over all captures.

    Attributes:
        psnr_db: By capture.
        scenes: Scene of every capture.
    """

    psnr_db: tuple[float, ...]
    scenes: tuple[str, ...]

    def gain_over(self, other: "Judgement") -> tuple[float, float]:
        """Return the mean gain over another method, and its standard error over scenes."""
        gains = np.array(self.psnr_db) - np.array(other.psnr_db)
        names = np.array(self.scenes)
        means = np.array([gains[names == name].mean() for name in dict.fromkeys(self.scenes)])
        error = means.std(ddof=1) / np.sqrt(means.size) if means.size > 1 else 0.0
        return float(means.mean()), float(error)


def judge_camera(
    bundle: Bundle, pictures: Path | None, cache_folder: Path
) -> Mapping[str, Judgement]:
    """Judge every method of a camera.

    Args:
        bundle: The camera.
        pictures: Folder of sharp pictures; None for procedural scenes.
        cache_folder: Where traced copies of the lens are kept.

    Returns:
        Method -> judgement.
    """
    psnr_by_method: dict[str, list[float]] = {}
    names: list[str] = []
    pipelines = pipelines_of(bundle)
    scenes = SCENES if pictures is None else len(list_set(pictures, SCENES))
    total = scenes * len(POSITIONS) * len(ISOS)
    with working("judging the camera", total, unit="captures") as task:
        for shot, exposed in captures_of(bundle, pictures, cache_folder):
            names.append(shot.picture.name)
            for method, pipeline in pipelines.items():
                truth, got = inner_srgb(restored_by(pipeline, exposed), exposed.sharp)
                psnr_by_method.setdefault(method, []).append(psnr(truth, got))
            task.count(len(names))
    return {
        method: Judgement(psnr_db=tuple(db), scenes=tuple(names))
        for method, db in psnr_by_method.items()
    }


def pipelines_of(bundle: Bundle) -> dict[str, Pipeline]:
    """Return a pipeline for every method: developed alone, the filter, each network."""
    geometry: dict[str, Any] = {**in_sensor_geometry(bundle.manifest), "threads": 1}
    ways: dict[str, dict[str, Any]] = {DEVELOP: {"method": DEVELOP}, FILTER: {"method": FILTER}}
    ways |= {size: {"method": "net", "size": size} for size in bundle.manifest.sizes}
    return {name: Pipeline(bundle, Options(**way, **geometry)) for name, way in ways.items()}


def restored_by(pipeline: Pipeline, exposed: Exposed) -> FloatArray:
    """Return what a pipeline makes of a capture: (3, h, w) linear Rec.709."""
    simulation = exposed.simulation
    x, y = (int(v) for v in simulation.window.origin_px)
    capture = pipeline.capture_of(
        simulation.samples,
        iso=simulation.iso,
        white_balance=stated_balance(simulation.white_balance),
        origin_px=(x, y),
    )
    return pipeline.start(capture).fill()


def captures_of(
    bundle: Bundle, pictures: Path | None, cache_folder: Path
) -> Iterator[tuple[Shot, Exposed]]:
    """Yield the captures: scene i through copy i."""
    is_traced = PRESCRIPTION in bundle.manifest.members

    @lru_cache(maxsize=COPIES)
    def lens(seed: int) -> FrozenOptics:
        # a kernel by waves takes as long as twenty by rays
        dense = bundle.freeze_fact("psf_model") != "waves"
        return fabricated_optics(bundle, seed, cache_folder=cache_folder, dense=dense)

    for number, (name, scene) in enumerate(scenes_of(bundle, pictures)):
        for position in POSITIONS:
            for iso in ISOS:
                shot = Shot(
                    set_name="made",
                    picture=Path(name),
                    number=number % COPIES,
                    position=position,
                    iso=iso,
                    psf="fresh" if is_traced else "bundle",
                )
                optics = lens(shot.fabrication_seed) if is_traced else bundle.frozen_optics
                yield shot, expose(shot, scene, bundle, optics)


def scenes_of(bundle: Bundle, pictures: Path | None) -> Iterator[tuple[str, FloatArray]]:
    """Yield named scenes (3, h, w), linear Rec.709, no larger than the sensor."""
    sensor = bundle.manifest.light_sensor
    side = min(SIDE_PX, sensor.width_px // 2 * 2, sensor.height_px // 2 * 2)
    if pictures is None:
        for seed in range(FIRST_SEED, FIRST_SEED + SCENES):
            yield f"procedural:{seed}", procedural_scene(seed, side, side)
        return
    for path in list_set(pictures, SCENES):
        scene = read_picture(path, side)
        height, width = (length // 2 * 2 for length in scene.shape[1:])
        yield path.name, np.ascontiguousarray(scene[:, :height, :width])


def best_size(judged: Mapping[str, Judgement], sizes: Sequence[str]) -> str | None:
    """Return the network that is surely better than the filter, the best of several; or None."""
    surely = {}
    for size in sizes:
        gain_db, error_db = judged[size].gain_over(judged[FILTER])
        if gain_db - error_db > 0:
            surely[size] = gain_db
    return max(surely, key=surely.__getitem__, default=None)
