"""The capture that is timed: a scene photographed once by the bundle's camera."""

import hashlib
from pathlib import Path
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import Sensor
from camkit.errors import ContractError
from camkit.report.kind_finder import check_photographs
from camkit.runtime.files.picture import read_light
from camkit.runtime.kind import part_of, photograph_by_twin
from camkit.runtime.network.engine import available_threads
from camkit.runtime.twin.simulate import SimulationOptions
from camkit.scenes import procedural_scene

SCENE_SEED: Final = 7
EXPOSURE: Final = 0.8
SCENE_TEXT: Final = f"procedural scene {SCENE_SEED}, lights cut at white, exposure {EXPOSURE:g}"
_VERSION: Final = 2


def timed_capture(
    bundle: Bundle,
    width_px: int | None,
    height_px: int | None,
    folder: Path,
    photo: Path | None = None,
) -> tuple[Path, tuple[int, int]]:
    """Return a file of the bundle's camera, simulated now or by an earlier call.

    The lights of the procedural scene are cut at white: clipped blocks cost several times what
    others cost, and how many there are is a matter of the scene.

    Args:
        bundle: The camera.
        width_px: Of a centred crop; None for the sensor's.
        height_px: Likewise.
        folder: Where captures are kept.
        photo: A sharp picture to photograph in place of the procedural scene, its middle if it is
            larger; exposed as `camkit simulate` does.

    Returns:
        The file and its (width, height).

    Raises:
        ContractError: If the bundle states no optics for camkit's own twin, the size does not fit
            the sensor, or the photo is smaller.
        UnsupportedError: If the camera cannot be simulated.
    """
    manifest, part = bundle.manifest, part_of(bundle.manifest)
    if part.simulate is photograph_by_twin:
        check_photographs(manifest, "give a capture to time with --capture FILE")
    width, height = _sides(manifest.sensor, width_px, height_px, bundle.path.name)
    optics = manifest.optics
    lens = (
        None
        if optics is None or optics.type == "lens_profile"
        else manifest.members[optics.member].sha256
    )
    if optics is not None and optics.type == "hazy_psf":
        lens = f"{lens} {manifest.members[optics.haze_member].sha256}"
    depth_mm = None if optics is None else bundle.reference_depth_mm
    scene_key = hashlib.sha256(photo.read_bytes()).hexdigest() if photo else SCENE_TEXT
    camera = (manifest.kind, manifest.sensor.model_dump_json(), lens, depth_mm)
    parts = (*camera, width, height, scene_key, _VERSION)
    key = hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
    path = folder / f"{bundle.manifest.name}-{width}x{height}-{key}{part.suffixes[0]}"
    if not path.is_file():
        if photo is None:
            scene = np.minimum(procedural_scene(SCENE_SEED, height, width), np.float32(1))
        else:
            scene = _middle(read_light(photo), photo.name, height, width)
        options = SimulationOptions(
            exposure=EXPOSURE if photo is None else 1.0,
            depth_mm=depth_mm,
            workers=available_threads(None),
        )
        part.write(path, part.simulate(scene, bundle, options), bundle)
    return path, (width, height)


def _sides(
    sensor: Sensor, width_px: int | None, height_px: int | None, name: str
) -> tuple[int, int]:
    """Return (width, height): those asked for, else the sensor's, which none exceeds."""
    if sensor.extent is None and width_px and height_px:
        return width_px, height_px
    width, height = width_px or sensor.width_px, height_px or sensor.height_px
    if width > sensor.width_px or height > sensor.height_px:
        raise ContractError(
            f"{name} has a sensor of {sensor.width_px}x{sensor.height_px} px; got {width}x{height}"
        )
    return width, height


def _middle(scene: FloatArray, name: str, height: int, width: int) -> FloatArray:
    top, left = (scene.shape[1] - height) // 2, (scene.shape[2] - width) // 2
    if min(top, left) < 0:
        raise ContractError(
            f"{name} must have at least {width}x{height} px; it has "
            f"{scene.shape[2]}x{scene.shape[1]}"
        )
    return scene[:, top : top + height, left : left + width]
