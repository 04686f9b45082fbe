"""A camera whose colours focus at different depths, with kernels of its moved sensor."""

from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.manifest import format_of
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from tests.bundle_factory import PITCH_UM, tiny_manifest, tiny_sensor, tiny_stages
from tests.psf_factory import gaussian_kernel

SIDE_PX: Final = 704
RANGE_UM: Final = 40.0
SHIFTS_UM: Final = (-RANGE_UM, RANGE_UM)
SHARPEST_UM: Final = (-30.0, 0.0, 25.0)
"""Where blue, green and red are sharpest."""
LENS: Final = b'name = "made up"\n'


def kernels_at(focus_um: float, scale: float = 1.0) -> FloatArray:
    """Give (field, depth, wavelength, h, w) Gaussians, wider off the axis."""
    of_fields = []
    for more_px in (0.0, 0.5):
        widths = [0.8 + more_px + abs(focus_um - at) / 25 for at in SHARPEST_UM]
        of_fields.append([gaussian_kernel(scale * width, radius_px=10)[0] for width in widths])
    return np.array(of_fields, np.float32)[:, None]


def focus_psf(*, moved: bool = True, scale: float = 1.0) -> FrozenPsf:
    """Give the PSF, without kernels of the moved sensor where it is not."""
    return FrozenPsf(
        kernels=kernels_at(0.0, scale),
        field_heights_mm=np.array([0.0, 3.0]),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array([0.45, 0.55, 0.62]),
        pixel_pitch_um=PITCH_UM,
        distortion=RadialDistortion(coefficients=np.tile([1.0, 0, 0, 0], (3, 1)), radius_mm=2.0),
        relative_illumination=np.array([1.0, 0.8]),
        focus_um=np.array(SHIFTS_UM) if moved else None,
        focus_kernels=np.stack([kernels_at(at, scale) for at in SHIFTS_UM]) if moved else None,
    )


def write_focus_bundle(
    folder: Path, name: str = "focused", *, moved: bool = True, lens: bytes | None = LENS
) -> Bundle:
    """Write and open the camera: a bank, no network, 704 x 704 pixels."""
    psf = focus_psf(moved=moved)
    changes: dict[str, Any] = {"stages": tiny_stages("network"), "networks": {}, "golden": ()}
    sensor = tiny_sensor(SIDE_PX, SIDE_PX)
    manifest = tiny_manifest(name=name, sensor=sensor, format_version=format_of(psf, ()), **changes)
    members = {"psf.safetensors": psf_to_bytes(psf)}
    if lens is not None:
        members["prescription.toml"] = lens
    path = folder / f"{name}.camkit"
    write_bundle(path, manifest, members)
    return open_bundle(path)
