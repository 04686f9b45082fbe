"""A picture on a plane in front of the camera."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class Texture:
    """A linear picture on a plane across the axis; beyond its border the border goes on.

    It hangs as the camera records it: its rows go towards -y of the scene and its columns
    towards -x, so that on the sensor they go towards +y and +x.

    Attributes:
        values: (3, h, w) linear radiance, R, G, B.
        pitch_mm: Distance of its samples in the scene.
        axis_px: Row and column that lie on the optical axis; need not lie inside.
    """

    values: Tensor
    pitch_mm: float
    axis_px: tuple[float, float]

    def __post_init__(self) -> None:
        if self.values.ndim != 3 or self.values.shape[0] != 3 or min(self.values.shape) < 1:
            raise ContractError(f"a texture must be (3, h, w); got {tuple(self.values.shape)}")
        if not self.values.is_floating_point():
            raise ContractError(f"a texture must be of floats; got {self.values.dtype}")
        if not self.pitch_mm > 0:
            raise ContractError(f"texture pitch_mm must be > 0; got {self.pitch_mm}")


def look_up(texture: Texture, x_mm: Tensor, y_mm: Tensor) -> Tensor:
    """Return the radiance at points of the scene, bilinear.

    Gradients flow to the points and to the values.

    Args:
        texture: The picture.
        x_mm: (3, a, b), one plane of points for each colour.
        y_mm: The same.

    Returns:
        (3, a, b), in the type of the values.
    """
    rows, columns = texture.values.shape[1:]
    row = texture.axis_px[0] - y_mm / texture.pitch_mm
    column = texture.axis_px[1] - x_mm / texture.pitch_mm
    # pixel i of n lies at (2 i + 1) / n - 1
    place = torch.stack([(2 * column + 1) / columns - 1, (2 * row + 1) / rows - 1], dim=-1)
    samples = grid_sample(
        texture.values[:, None],
        place.to(texture.values.dtype),
        padding_mode="border",
        align_corners=False,
    )
    return samples[:, 0]
