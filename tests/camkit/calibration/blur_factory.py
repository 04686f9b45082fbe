"""Photographs of polygons through a lens whose blur is known and grows towards the corner."""

import numpy as np
from scipy import ndimage

from camkit.cfa import cfa_channels
from camkit.runtime.capture import Capture

SPREADS_PX = (1.2, 2.0)
"""Of round Gaussians on the axis and in the corner; red is a tenth wider."""
FINE = 2


def polygons(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """Return an even scene with bright and dark triangles on it, sampled finely, by area."""
    y, x = (np.mgrid[: height * FINE, : width * FINE] + 0.5) / FINE - 0.5
    scene = np.full(y.shape, 0.35)
    for _ in range(max(6, height * width // 7000)):
        centre = rng.uniform((0, 0), (height, width))
        inside = np.ones(y.shape, dtype=bool)
        start, size = rng.uniform(0, 2 * np.pi), rng.uniform(22, 40)
        for corner in range(3):
            angle = start + corner * 2 * np.pi / 3
            inside &= (y - centre[0]) * np.sin(angle) + (x - centre[1]) * np.cos(angle) < size
        scene[inside] = rng.choice([0.08, 0.15, 0.6, 0.75])
    return scene


def photograph(
    seed: int,
    size: tuple[int, int] = (320, 480),
    *,
    cfa: str | None = "RGGB",
    scale: float = 1.0,
    noise: float = 0.002,
) -> Capture:
    """Return a photograph of polygons."""
    rng = np.random.default_rng(seed)
    scene = polygons(rng, *size)
    y, x = np.mgrid[: size[0], : size[1]]
    share = np.hypot(y - (size[0] - 1) / 2, x - (size[1] - 1) / 2) / (np.hypot(*size) / 2)
    planes = []
    for wider in (1.1, 1.0, 1.0):
        near, far = (
            ndimage.gaussian_filter(scene, spread * wider * FINE)
            .reshape(size[0], FINE, size[1], FINE)
            .mean(axis=(1, 3))
            for spread in SPREADS_PX
        )
        planes.append(((1 - share) * near + share * far) * scale)
    light = np.stack(planes) + rng.normal(size=(3, *size)) * noise
    codes = np.clip(np.round(light * 60000), 0, 65535).astype(np.uint16)
    if cfa is None:
        black = np.zeros(3, dtype=np.float32)
    else:
        sites = np.array(cfa_channels(cfa))[y % 2, x % 2]
        codes = np.take_along_axis(codes, sites[None], axis=0)[0]
        black = np.zeros((2, 2), dtype=np.float32)
    return Capture(
        samples=codes, cfa=cfa, black_level=black, white_level=60000.0, pixel_pitch_um=5.0
    )


def transfer_of(share: float, frequency: float, wider: float = 1.0) -> float:
    """Return the transfer at some cycles per pixel, a share of the way to the corner."""
    near, far = (
        float(np.exp(-2 * (np.pi * spread * wider * frequency) ** 2)) for spread in SPREADS_PX
    )
    return (1 - share) * near + share * far
