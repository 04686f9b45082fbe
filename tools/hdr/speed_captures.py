"""Captures of a whole sensor with lights, for measuring time: 25 night scenes laid side by side.

Five scenes of a fifth of the sensor's sides are photographed, each stands five times, once in every
row and column. Light does not cross the seams.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor
from camkit.contracts import FloatArray
from camkit.errors import UnsupportedError
from camkit.report.kinds.hdr.lights import dimmed, with_lamp
from camkit.runtime.capture import SATURATION_SHARE
from camkit.runtime.geometry.sensor_window import centred_origin
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.runtime.twin.saturation import exposure_for_share
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, photograph, write_capture
from camkit.scenes.saturation import with_exposure

GRID: Final = 5
LAMPS: Final = 50
LAMP_RADIUS_PX: Final = 10.0
LAMP_POWER: Final = 30.0
SEED: Final = 300
DARK_SHARE: Final = 0.015
"""Above white in a night whose lights are then taken away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What a capture shows.

    Attributes:
        name: For reports.
        share: Of the pixels of the scene, above white.
        lamps: Round ones of one size in place of the lights of the night.
        side_px: Of a square crop; None for the whole sensor.
    """

    name: str
    share: float = 0.0
    lamps: int = 0
    side_px: int | None = None


SUBJECTS: Final = (
    Subject(name="nothing"),
    Subject(name=f"{LAMPS} lamps", lamps=LAMPS),
    *(Subject(name=f"{share:g} %", share=share / 100) for share in (0.3, 1, 1.5, 3, 6)),
    Subject(name="512 px, 1.5 %", share=0.015, side_px=512),
)


def write_subject(path: Path, subject: Subject, bundle: Bundle) -> float:
    """Photograph a subject as DNG; give the share of samples that clipped.

    Raises:
        UnsupportedError: If the sensor has no mosaic.
    """
    sensor = bundle.manifest.sensor
    if not isinstance(sensor, BayerSensor):
        raise UnsupportedError(f"bundle {bundle.manifest.name} has no mosaic to write as DNG")
    if subject.side_px is None:
        shot = _whole(list(_tiles(subject, bundle, sensor)))
    else:
        scene = _lit(subject, SEED, (subject.side_px, subject.side_px), sensor)
        shot = photograph(scene, bundle, _options(bundle, 0))
    write_capture(path, shot, sensor, bundle.manifest.name)
    span = sensor.white_level - sensor.black_level
    limit = sensor.black_level + SATURATION_SHARE * span
    return float(np.mean(shot.samples >= limit))


def _tiles(subject: Subject, bundle: Bundle, sensor: BayerSensor) -> Iterator[Simulation]:
    size = sensor.known_extent.height_px, sensor.known_extent.width_px
    height, width = (side // GRID // 2 * 2 for side in size)
    for number in range(GRID):
        scene = _lit(subject, SEED + number, (height, width), sensor)
        yield photograph(scene, bundle, _options(bundle, number))


def _options(bundle: Bundle, seed: int) -> SimulationOptions:
    return SimulationOptions(seed=seed, depth_mm=bundle.reference_depth_mm)


def _lit(subject: Subject, seed: int, size: tuple[int, int], sensor: BayerSensor) -> FloatArray:
    """Return one scene (3, h, w) of a subject."""
    night = night_scene(seed, *size)
    share = subject.share or DARK_SHARE
    night = with_exposure(night, exposure_for_share(night, sensor, share).exposure)
    if subject.share:
        return night
    scene, rng = dimmed(night), np.random.default_rng(seed)
    margin = 2 * LAMP_RADIUS_PX
    for _ in range(subject.lamps // GRID**2):
        y, x = (float(rng.uniform(margin, side - margin)) for side in size)
        scene = with_lamp(scene, (y, x), LAMP_RADIUS_PX, LAMP_POWER)
    return scene


def _whole(tiles: list[Simulation]) -> Simulation:
    """Lay tiles side by side, each once in every row and column."""
    rows = [
        np.hstack([_samples(tiles, row, column) for column in range(GRID)]) for row in range(GRID)
    ]
    samples = np.vstack(rows)
    window = tiles[0].window
    size = samples.shape[1], samples.shape[0]
    origin = centred_origin(size, window.sensor_size_px, multiple=2)
    return replace(
        tiles[0], samples=samples, window=replace(window, size_px=size, origin_px=origin)
    )


def _samples(tiles: list[Simulation], row: int, column: int) -> NDArray[np.uint16]:
    return np.asarray(tiles[(2 * row + column) % GRID].samples)
