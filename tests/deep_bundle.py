"""The tiny bundle with a PSF of three depths, sharp at the one it is focused on."""

from pathlib import Path

import numpy as np

from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.psf import FrozenPsf
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_optics, tiny_psf, tiny_sensor
from tests.psf_factory import gaussian_kernel

DEPTHS_MM = (500.0, 1000.0, 2000.0)
FOCUS_MM = 1000.0


def deep_psf(depths_mm: tuple[float, ...] = DEPTHS_MM) -> FrozenPsf:
    """Give Gaussians on 13 x 13 samples that widen with the distance from the focus in 1 / mm."""
    sigmas_px = [0.6 + 1.4 * abs(FOCUS_MM / depth_mm - 1) for depth_mm in depths_mm]
    of_depths = np.stack([gaussian_kernel(sigma, radius_px=6) for sigma in sigmas_px])
    shallow = tiny_psf()
    return FrozenPsf(
        kernels=np.stack([of_depths, of_depths]),
        field_heights_mm=shallow.field_heights_mm,
        depths_mm=np.array(depths_mm),
        wavelengths_um=shallow.wavelengths_um,
        pixel_pitch_um=shallow.pixel_pitch_um,
        distortion=shallow.distortion,
        relative_illumination=shallow.relative_illumination,
    )


def write_deep_bundle(
    folder: Path,
    name: str = "deep.camkit",
    *,
    depths_mm: tuple[float, ...] = DEPTHS_MM,
    stress_mm: tuple[float, ...] = (),
) -> Bundle:
    """Write and open the tiny bundle with several depths and 320 x 240 pixels."""
    optics = tiny_optics(object_distance_mm=FOCUS_MM)
    manifest = tiny_manifest(name="deep", sensor=tiny_sensor(320, 240), optics=optics)
    members = tiny_members() | {"psf.safetensors": psf_to_bytes(deep_psf(depths_mm))}
    if stress_mm:
        members |= {"stress_psf.safetensors": psf_to_bytes(deep_psf(stress_mm))}
    path = folder / name
    write_bundle(path, manifest, members)
    return open_bundle(path)
