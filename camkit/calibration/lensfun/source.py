"""Distortion and illumination, in pixels, of a bundle or of a measured geometry."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from camkit.bundle.optics import LensProfile
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.calibration.lensfun.models import FULL_FRAME_MM
from camkit.calibration.measured_files import GeometryFile, read_geometry
from camkit.errors import DecodeError
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion, RadialIllumination
from camkit.runtime.geometry.distortion import reference_channel
from camkit.units import to_mm

OFF_MIDDLE_PX: Final = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """The source of an entry. Pixels stand for the millimetres of its parts.

    Attributes:
        name: Of bundle or file.
        size_px: Width and height of the pictures.
        crop_factor: By size and pitch of the sensor; None where the pitch is not known.
        distortion: Of the reference colour, one row; None where none is known.
        light: Relative illumination; None where none is known over the radius alone.
        focal_px: Focal length; None where it is not stated.
        notes: What is lost.
    """

    name: str
    size_px: tuple[int, int]
    crop_factor: float | None
    distortion: RadialDistortion | None
    light: RadialIllumination | None
    focal_px: float | None = None
    notes: tuple[str, ...]

    @property
    def corner_px(self) -> float:
        """Return the distance of the outermost pixel from the middle."""
        return float(np.hypot(self.size_px[0] - 1, self.size_px[1] - 1)) / 2

    def focal_mm(self, crop_factor: float) -> float | None:
        """Return the focal length on a sensor of a crop factor; None where it is not stated."""
        diagonal_mm = FULL_FRAME_MM / crop_factor
        return self.focal_px and self.focal_px * diagonal_mm / float(np.hypot(*self.size_px))


def read_source(path: Path) -> Source:
    """Read a result of `camkit calibrate geometry` (.toml), or a bundle, by its path or name.

    Raises:
        DecodeError: If it is neither, or states no distortion.
        BundleError: If the bundle is refused.
    """
    if path.suffix.lower() != ".toml":
        return _of_bundle(open_bundle(find_bundle(path)))
    return _of_geometry(read_geometry(path), path)


def _of_bundle(bundle: Bundle) -> Source:
    manifest = bundle.manifest
    extent, optics = manifest.sensor.extent, manifest.optics
    if extent is None or optics is None:
        raise DecodeError(f"{manifest.name} states no sensor or no optics, so nothing of a lens")
    pitch_mm = to_mm(extent.pixel_pitch_um)
    size = (extent.width_px, extent.height_px)
    notes = _off_middle(extent.optical_centre_px, size)
    profile = optics if isinstance(optics, LensProfile) else None
    distortion = None
    if profile is None or profile.distortion is not None:
        whole = bundle.distortion
        distortion = _one_row(whole, reference_channel(whole), whole.radius_mm / pitch_mm)
        rows = [whole.row(channel) for channel in range(len(whole.coefficients))]
        if not all(np.array_equal(rows[0], row) for row in rows):
            notes = (*notes, "lateral colour is left out: the entry is that of green")
    light = None
    if profile is None or profile.illumination is not None:
        illumination = bundle.illumination
        light = (
            illumination.radial_illumination
            if isinstance(illumination, FrozenPsf)
            else illumination
        )
        if light is None:
            notes = (*notes, "illumination over a grid is left out: lensfun knows the radius alone")
    diagonal_mm = float(np.hypot(*size)) * pitch_mm
    return Source(
        name=manifest.name,
        size_px=size,
        crop_factor=FULL_FRAME_MM / diagonal_mm,
        distortion=distortion,
        light=light and replace(light, heights_mm=light.heights_mm / pitch_mm),
        notes=notes,
    )


def _of_geometry(file: GeometryFile, path: Path) -> Source:
    size = (file.width_px, file.height_px)
    source = Source(
        name=path.stem,
        size_px=size,
        crop_factor=None,
        distortion=RadialDistortion(
            coefficients=np.array([file.radial.coefficients], dtype=np.float64),
            radius_mm=file.radial.radius_px,
        ),
        light=None,
        focal_px=file.focal_px,
        notes=_off_middle(file.centre_px, size),
    )
    if file.covered_radius_px < source.corner_px:
        extent = f"{file.covered_radius_px:.0f} px of {source.corner_px:.0f}"
        note = f"the geometry is known to {extent} from the centre; the rest is its guess"
        source = replace(source, notes=(*source.notes, note))
    return source


def _one_row(whole: RadialDistortion, channel: int, radius_px: float) -> RadialDistortion:
    even = whole.even_coefficients
    return RadialDistortion(
        coefficients=whole.coefficients[channel : channel + 1],
        radius_mm=radius_px,
        even_coefficients=None if even is None else even[channel : channel + 1],
    )


def _off_middle(centre: tuple[float, float] | None, size: tuple[int, int]) -> tuple[str, ...]:
    if centre is None:
        return ()
    offset_px = float(np.hypot(centre[0] - (size[0] - 1) / 2, centre[1] - (size[1] - 1) / 2))
    if offset_px < OFF_MIDDLE_PX:
        return ()
    return (
        f"the optical centre lies {offset_px:.1f} px off the middle, about which lensfun corrects",
    )
