"""Captures with a known truth: the golden cases as stored, or pictures and scenes photographed.

golden     capture and sharp reference of the bundle; through the bundle's own PSF
scenes     of the source that the kind of camera names, by their seeds; photographed as pictures
pictures   of a folder, at the field positions and sensitivities of the kind of camera, fabricated
           lenses traced afresh where the bundle holds its prescription and torch is there
           (`camkit.report.quality`)
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import util
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.golden import IMAGE, GoldenArrays, golden_from_bytes
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import GOLDEN, PRESCRIPTION, Bundle
from camkit.bundle.sensor import ColorSensor
from camkit.colorimetry import encode_srgb
from camkit.errors import ContractError
from camkit.report.bench.part import BenchPart
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.kind_finder import find_part
from camkit.report.quality import (
    FIELD_SHARES,
    Exposed,
    PsfSource,
    Shot,
    list_set,
    read_picture,
)
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.twin.light import stated_balance
from camkit.runtime.twin.saturation import exposure_for_share
from camkit.runtime.twin.truth import light_sensor, picture_scale
from camkit.scenes import named_scene
from camkit.scenes.saturation import with_exposure

MOST_PX: Final = 1024
"""Of a larger picture the middle is taken."""
SCENES: Final = 8
"""Of a source, where no number is asked for."""
SCENE_PX: Final = 512
LEAST_PX: Final = 96
"""Of a smaller one too little would be left inside the border."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownCapture:
    """A capture and what a perfect camera would have made of it.

    Attributes:
        picture: Name of the picture; captures of one picture share it.
        caption: What distinguishes the capture, for people.
        psf: Lens of the capture: fresh (fabricated, traced afresh) or bundle.
        capture: What the sensor gave, as `Pipeline.capture_of` takes it.
        iso: Sensitivity.
        white_balance: Gains (R, G, B).
        origin_px: (x, y) on the sensor.
        undistort: Whether the truth is in ideal geometry; else in that of the sensor.
        truths: Product -> what a perfect camera would give; for `image` (3, h, w) float32 sRGB
            values.
        extras: What metrics may need beside, by name, see `camkit.report.quality.Exposed`.
        field_share: Where its middle lies on the way from the middle of the sensor to that of a
            capture that touches a corner; None where the sensor has no stated size.
        field_mm: Distance of its middle from the optical axis; likewise.
    """

    picture: str
    caption: str
    psf: PsfSource
    capture: NDArray[Any]
    iso: float
    white_balance: tuple[float, float, float] | None
    origin_px: tuple[int, int]
    undistort: bool
    truths: Mapping[str, FloatArray]
    extras: Mapping[str, Any] = field(default_factory=dict)
    field_share: float | None = None
    field_mm: float | None = None


def golden_captures(bundle: Bundle) -> list[KnownCapture]:
    """Return the golden cases of a bundle that are large enough to be judged."""
    cases = bundle.manifest.golden
    arrays = golden_from_bytes(bundle.member(GOLDEN)) if cases else {}
    places = {case.name: _golden_place(bundle, arrays, case) for case in cases}
    return [
        KnownCapture(
            picture=case.name,
            caption=f"golden case {case.name}, ISO {case.iso:g}",
            psf="bundle",
            capture=np.ascontiguousarray(arrays[case.name].capture),
            iso=case.iso,
            white_balance=case.white_balance,
            origin_px=case.origin_px,
            undistort=True,
            truths={IMAGE: encode_srgb(arrays[case.name].reference)},
            extras={"linear": arrays[case.name].reference},
            field_share=places[case.name][0],
            field_mm=places[case.name][1],
        )
        for case in cases
        if min(arrays[case.name].reference.shape[1:]) >= LEAST_PX
    ]


def _golden_place(
    bundle: Bundle, arrays: Mapping[str, GoldenArrays], case: GoldenCase
) -> tuple[float | None, float | None]:
    """Return field share and distance of a golden case; None where the sensor has no size."""
    extent = bundle.manifest.sensor.extent
    if extent is None:
        return None, None
    height, width = arrays[case.name].capture.shape[-2:]
    window = SensorWindow(
        size_px=(width, height),
        origin_px=case.origin_px,
        sensor_size_px=(extent.width_px, extent.height_px),
        pitch_um=extent.pixel_pitch_um,
        axis_px=extent.optical_centre_px,
    )
    return round(_field_share(window), 2), _distance_mm(window)


def _field_share(window: SensorWindow) -> float:
    """Return how far a window lies from the middle of its sensor; 1 touches a corner."""
    spare = [
        whole - side for whole, side in zip(window.sensor_size_px, window.size_px, strict=True)
    ]
    shifts = [2 * at - free for at, free in zip(window.origin_px, spare, strict=True)]
    return math.hypot(*shifts) / (math.hypot(*spare) or 1.0)


def _distance_mm(window: SensorWindow) -> float:
    return math.hypot(*(float(v) for v in window.centre_mm))


def picture_captures(
    bundle: Bundle,
    folder: Path,
    count: int | None,
    cache_folder: Path,
    saturate: float | None = None,
) -> Iterator[KnownCapture]:
    """Photograph the first pictures of a folder at every place and sensitivity.

    Args:
        bundle: The camera.
        folder: Sharp pictures.
        count: How many of them; None for all.
        cache_folder: Where traced optics are kept.
        saturate: As of `bench_scene`.

    Raises:
        ContractError: If the folder holds no pictures, or one is too small, or as `bench_scene`.
    """
    scenes = ((path, bench_scene(path, bundle, saturate)) for path in list_set(folder, count))
    return _photographed(bundle, folder.name, scenes, cache_folder)


def scene_captures(
    bundle: Bundle, count: int | None, cache_folder: Path, saturate: float | None = None
) -> Iterator[KnownCapture]:
    """Photograph the first scenes of the source that the kind of a camera names, likewise."""
    source = find_part(bundle.manifest.kind, "bench", BenchPart).source
    names = [f"{source}:{seed}" for seed in range(count or SCENES)]
    scenes = ((Path(name), drawn_scene(name, bundle, saturate)) for name in names)
    return _photographed(bundle, str(source), scenes, cache_folder)


def _photographed(
    bundle: Bundle, set_name: str, scenes: Iterable[tuple[Path, FloatArray]], cache_folder: Path
) -> Iterator[KnownCapture]:
    """Photograph named scenes at every place and sensitivity of a kind of camera."""
    psf = psf_source(bundle)
    part = find_part(bundle.manifest.kind, "bench", BenchPart)

    @lru_cache(maxsize=4)
    def lens(seed: int) -> FrozenOptics:
        return fabricated_optics(bundle, seed, cache_folder=cache_folder)

    for number, (path, scene) in enumerate(scenes):
        if min(scene.shape[1:]) < LEAST_PX:
            raise ContractError(
                f"{path} has {scene.shape[2]}x{scene.shape[1]} pixels; a picture to measure on "
                f"needs {LEAST_PX} a side"
            )
        for position in part.positions:
            for iso in part.isos:
                shot = Shot(
                    set_name=set_name,
                    picture=path,
                    number=number,
                    position=position,
                    iso=iso,
                    psf=psf,
                )
                optics = lens(shot.fabrication_seed) if psf == "fresh" else bundle.frozen_optics
                yield known_capture(shot, part.photograph(shot, scene, bundle, optics))


def bench_scene(path: Path, bundle: Bundle, saturate: float | None = None) -> FloatArray:
    """Return a picture as large and as bright as a camera photographs it.

    Args:
        path: A picture; of a large one the middle is taken.
        bundle: The camera.
        saturate: Share of the pixels that exceed what the sensor holds, in any colour; the picture
            is exposed for it and ends at `camkit.scenes.saturation.CEILING`. None leaves it alone.

    Returns:
        (3, h, w) float32 linear Rec.709, of whole pixels of the sensor.

    Raises:
        DecodeError: If it is damaged.
        ContractError: If no exposure saturates that share; names the file.
    """
    sensor, scale = light_sensor(bundle.manifest), picture_scale(bundle.manifest)
    most_px = min(MOST_PX, scale * sensor.width_px, scale * sensor.height_px)
    return _exposed(_whole_pixels(read_picture(path, most_px), scale), sensor, saturate, path)


def drawn_scene(name: str, bundle: Bundle, saturate: float | None = None) -> FloatArray:
    """Return a scene of the register, at most `SCENE_PX` a side; else as `bench_scene`."""
    sensor, scale = light_sensor(bundle.manifest), picture_scale(bundle.manifest)
    width, height = (scale * min(SCENE_PX, side) for side in (sensor.width_px, sensor.height_px))
    return _exposed(named_scene(name, height, width), sensor, saturate, name)


def _exposed(
    scene: FloatArray, sensor: ColorSensor, saturate: float | None, what: object
) -> FloatArray:
    if saturate is None:
        return scene
    try:
        return with_exposure(scene, exposure_for_share(scene, sensor, saturate).exposure)
    except ContractError as error:
        raise ContractError(f"{what}: {error}") from error


def psf_source(bundle: Bundle) -> PsfSource:
    """Return through which lens pictures are photographed: fresh, if it can be traced here."""
    traceable = PRESCRIPTION in bundle.names and util.find_spec("torch") is not None
    return "fresh" if traceable else "bundle"


def _whole_pixels(scene: FloatArray, scale: int) -> FloatArray:
    """Cut a scene to whole pixels of a sensor."""
    height, width = (side // scale * scale for side in scene.shape[1:])
    return np.ascontiguousarray(scene[:, :height, :width])


def known_capture(shot: Shot, exposed: Exposed) -> KnownCapture:
    """Return what was photographed as a capture with a known truth, in sensor geometry."""
    simulation, share = exposed.simulation, FIELD_SHARES[shot.position]
    x, y = (int(v) for v in simulation.window.origin_px)
    return KnownCapture(
        picture=shot.picture.name,
        caption=f"{shot.picture.stem}, {share:.0%} of the way to the corner, ISO {shot.iso:g}",
        psf=shot.psf,
        capture=simulation.samples,
        iso=simulation.iso,
        white_balance=stated_balance(simulation.white_balance),
        origin_px=(x, y),
        undistort=False,
        truths=exposed.truths,
        extras=exposed.extras,
        field_share=share,
        field_mm=_distance_mm(simulation.window),
    )
