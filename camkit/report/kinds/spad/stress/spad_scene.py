"""Scenes for the sweeps: pictures on the fine grid of an array, and surfaces as deep as its time.

Pictures are luminance of sRGB values, taken for light, as in training and bench.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.kinds.spad.scenes import coded_luminance
from camkit.report.quality import list_set, read_picture
from camkit.report.stress.scene import SCENE_SEED
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.twin.photon_twin import fitted
from camkit.scenes import procedural_scene


@dataclass(frozen=True, slots=True, kw_only=True)
class SpadScene:
    """A sharp picture; the surfaces that belong to it follow from its number.

    Attributes:
        name: For reports and journals.
        number: Decides noise and surfaces.
        light: (m h, m w) float32, white = 1.
    """

    name: str
    number: int
    light: FloatArray


def spad_scenes(bundle: Bundle, count: int, folder: Path | None = None) -> tuple[SpadScene, ...]:
    """Return the scenes of a sweep, as fine as the pictures of a bundle.

    Args:
        bundle: The camera.
        count: How many.
        folder: Pictures to take instead of procedural scenes; their middle is used.

    Raises:
        ContractError: If `count` < 1 or the folder holds fewer pictures.
        BundleError: If the bundle makes no picture of photons finer.
    """
    if count < 1:
        raise ContractError(f"a sweep needs at least one scene; got {count}")
    camera = FineCamera.of(bundle)
    height = camera.scale * camera.sensor.height_px
    width = camera.scale * camera.sensor.width_px
    if folder is None:
        named_pictures = [
            (f"procedural:{SCENE_SEED + i}", procedural_scene(SCENE_SEED + i, height, width))
            for i in range(count)
        ]
    else:
        files = list_set(folder, count)
        if len(files) < count:
            raise ContractError(
                f"{folder} holds {len(files)} picture(s), {count} are needed; add pictures or "
                "lower --scenes"
            )
        named_pictures = [(file.name, read_picture(file)) for file in files]
    return tuple(
        SpadScene(name=name, number=i, light=np.clip(fitted(coded_luminance(rgb), camera), 0, 1))
        for i, (name, rgb) in enumerate(named_pictures)
    )
