"""Depth as points in space: a binary PLY of every pixel that is believed.

A pixel at (x, y) of an array behind a lens looks along (x p, y p, f), from the middle of the array;
of a fine grid, sub-pixel `phase` of a pixel looks where the pixel does. Time of flight measures the
way along that line, so the point lies `depth` along it, not `depth` in front of the lens. +x is
right, +y down, +z along the light.

References: G. Turk, "The PLY polygon file format" (1994).
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from camkit.units import UM_PER_MM


def directions(
    shape: tuple[int, int],
    pitch_um: float,
    focal_length_mm: float,
    *,
    scale: int = 1,
    phase: int = 0,
) -> NDArray[np.float64]:
    """Return the unit vectors (h, w, 3) along which pixels look.

    Args:
        shape: (h, w).
        pitch_um: Of these pixels.
        focal_length_mm: Of the lens.
        scale: Sub-pixels along a side of a pixel of the array.
        phase: Which of them lies on its middle.
    """
    down, across = (
        np.arange(length) - scale * (length // scale - 1) / 2 - phase for length in shape
    )
    y, x = np.meshgrid(down, across, indexing="ij")
    focal_px = focal_length_mm * UM_PER_MM / pitch_um
    vectors = np.stack([x, y, np.full(shape, focal_px)], axis=-1)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def write_points(
    path: Path,
    depth_m: NDArray[np.float64],
    intensity: NDArray[np.float64],
    *,
    pitch_um: float,
    focal_length_mm: float,
    scale: int = 1,
    phase: int = 0,
) -> None:
    """Write the points.

    Args:
        path: The file.
        depth_m: (returns, h, w); NaN is left out.
        intensity: (returns, h, w), a property of each point.
        pitch_um: Of the pixels.
        focal_length_mm: Of the lens.
        scale: See `directions`.
        phase: Likewise.
    """
    shape = (depth_m.shape[1], depth_m.shape[2])
    vectors = directions(shape, pitch_um, focal_length_mm, scale=scale, phase=phase)
    valid = np.isfinite(depth_m)
    which, y, x = np.nonzero(valid)
    places = vectors[y, x] * depth_m[valid][:, None]
    rows = np.empty(
        len(places),
        dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("return", "u1")],
    )
    for column, name in enumerate("xyz"):
        rows[name] = places[:, column]
    rows["intensity"] = intensity[valid]
    rows["return"] = which + 1
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment camkit, metres, +z along the light\n"
        f"element vertex {len(rows)}\n"
        "property float x\nproperty float y\nproperty float z\nproperty float intensity\n"
        "property uchar return\nend_header\n"
    )
    path.write_bytes(header.encode() + rows.tobytes())
