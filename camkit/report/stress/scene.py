"""Sharp scenes for the sweeps: procedural ones with seeds of their own, or a user's pictures."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.quality import FIELD_SHARES, QUADRANTS, crop_origin, list_set, read_picture
from camkit.runtime.twin.truth import picture_scale
from camkit.scenes import procedural_scene

SCENE_SEED: Final = 9_000_000
"""Training and validation draw their scenes around 7,000,000 (models_def/training/pictures.py)."""
SIDE_PX: Final = 512
WHITE: Final = 0.9
"""Scenes end here, so that nothing clips unless a scenario makes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A sharp scene and its place on the sensor.

    Attributes:
        name: For reports and journals.
        number: Decides place and noise.
        linear: (3, s h, s w) float32 linear Rec.709, 0..`WHITE`.
        scale: Samples s along a side of a pixel, as those of the bundle's picture.
        share: Its place between the middle of the sensor (0) and its corner (1); None for one
            that its number decides.
    """

    name: str
    number: int
    linear: FloatArray
    scale: int = 1
    share: float | None = None

    @property
    def field_share(self) -> float:
        """Return the place between the middle of the sensor (0) and its corner (1)."""
        if self.share is not None:
            return self.share
        return FIELD_SHARES[self.number % len(FIELD_SHARES)]

    @property
    def size_px(self) -> tuple[int, int]:
        """Return (width, height) in pixels of the sensor."""
        return self.linear.shape[2] // self.scale, self.linear.shape[1] // self.scale

    def showing(self, linear: FloatArray, name: str) -> "Scene":
        """Return a scene of another content at a place that the number decides."""
        return replace(self, linear=linear, name=name, share=None)

    def origin_px(self, sensor_size_px: tuple[int, int]) -> tuple[int, int]:
        """Return the even (x, y) of the scene on a sensor.

        Raises:
            ContractError: If the scene is larger than the sensor.
        """
        quadrant = QUADRANTS[self.number % len(QUADRANTS)]
        return crop_origin(self.size_px, sensor_size_px, self.field_share, quadrant)


def stress_scenes(bundle: Bundle, count: int, folder: Path | None = None) -> tuple[Scene, ...]:
    """Return the scenes of a sweep, as fine as the pictures of a bundle.

    Args:
        bundle: The camera; scenes are at most as large as its sensor.
        count: How many.
        folder: Pictures to take instead of procedural scenes; their middle is used.

    Raises:
        ContractError: If `count` < 1 or the folder holds too few pictures of the size.
        UnsupportedError: If the bundle makes no picture, or states no sensor size.
    """
    if count < 1:
        raise ContractError(f"a sweep needs at least one scene; got {count}")
    sensor, scale = bundle.manifest.sensor, picture_scale(bundle.manifest)
    sides = (min(SIDE_PX, side // 2 * 2) for side in (sensor.width_px, sensor.height_px))
    width, height = (scale * side for side in sides)
    if folder is not None:
        return _from_folder(folder, count, (width, height), scale)
    return tuple(
        Scene(
            name=f"procedural:{SCENE_SEED + i}",
            number=i,
            linear=np.minimum(procedural_scene(SCENE_SEED + i, height, width), WHITE),
            scale=scale,
        )
        for i in range(count)
    )


def _from_folder(
    folder: Path, count: int, size_px: tuple[int, int], scale: int
) -> tuple[Scene, ...]:
    width, height = size_px
    scenes: list[Scene] = []
    for path in list_set(folder):
        linear = read_picture(path, max(size_px))[:, :height, :width]
        if linear.shape[1:] == (height, width):
            scaled = np.ascontiguousarray(linear * np.float32(WHITE))
            scenes.append(Scene(name=path.name, number=len(scenes), linear=scaled, scale=scale))
        if len(scenes) == count:
            return tuple(scenes)
    raise ContractError(
        f"{folder} holds {len(scenes)} picture(s) of at least {width}x{height} px, {count} are "
        "needed; add pictures or ask for fewer"
    )
