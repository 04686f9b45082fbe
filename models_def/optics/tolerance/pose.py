"""Poses of decentred and tilted surfaces.

A surface is first turned about its vertex and shifted, then its piece of glass is turned about
the piece's front vertex and shifted: p = R q + o, with q in the frame of the surface and p in the
frame of its nominal vertex.
"""

import torch
from torch import Tensor

from camkit.models_def.optics.tolerance.deviation import Deviations
from camkit.models_def.optics.tracing.frame import Pose, rotation


def poses(
    deviations: Deviations,
    elements: tuple[range, ...],
    thickness_mm: Tensor,
    azimuths_rad: Tensor,
) -> list[Pose | None]:
    """Return the pose of every surface (copy, field, 1, 1), seen with each field turned to +y.

    The nominal lens is round, so a field at an azimuth is one at +y with all errors turned back.

    Args:
        deviations: The errors.
        elements: See `elements.glass_elements`.
        thickness_mm: (surface, copy), of the copies.
        azimuths_rad: (field,), from +y towards +x.

    Returns:
        One for each surface; None for surfaces that no piece of glass carries.
    """

    def turned(vectors: Tensor) -> Tensor:
        """Return (copy, field, part, 2) with the fields' directions turned to +y."""
        cos, sin = torch.cos(azimuths_rad)[:, None], torch.sin(azimuths_rad)[:, None]
        x, y = vectors[:, None, :, 0], vectors[:, None, :, 1]
        return torch.stack([cos * x - sin * y, sin * x + cos * y], dim=-1)

    shift, tilt, piece_shift, piece_tilt = (
        turned(torch.from_numpy(vectors))
        for vectors in (
            deviations.surface_decentre_mm,
            deviations.surface_turn_rad,
            deviations.element_decentre_mm,
            deviations.element_tilt_rad,
        )
    )
    surface_poses: list[Pose | None] = [None] * len(thickness_mm)
    for number, element in enumerate(elements):
        whole = rotation(piece_tilt[:, :, number])
        depth = torch.zeros_like(thickness_mm[0])
        for i in element:
            vertex_depth = torch.zeros(*shift.shape[:2], 3, dtype=shift.dtype)
            vertex_depth[..., 2] = depth[:, None]
            # the vertex seen from the front vertex, then from its own nominal place
            vertex = vertex_depth + _flat(shift[:, :, i])
            offset = (
                (whole @ vertex[..., None])[..., 0]
                - vertex_depth
                + _flat(piece_shift[:, :, number])
            )
            turn = whole @ rotation(tilt[:, :, i])
            surface_poses[i] = Pose(turn=turn[:, :, None, None], offset_mm=offset[:, :, None, None])
            depth = depth + thickness_mm[i]
    return surface_poses


def _flat(vector: Tensor) -> Tensor:
    return torch.nn.functional.pad(vector, (0, 1))
