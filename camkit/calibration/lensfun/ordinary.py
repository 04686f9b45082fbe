"""A lens of the database and a capture to the bundle of that camera: all steps as one function."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from camkit.bundle.manifest import Manifest
from camkit.calibration.lensfun.camera import frame_of, manifest_of, slug, stated_crop
from camkit.calibration.lensfun.database import Database, check_positive
from camkit.calibration.lensfun.models import TERMS
from camkit.calibration.lensfun.profile import LensfunProfile, profile_of
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.raw import read_capture


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraOptions:
    """The settings of the captures.

    Attributes:
        focal_mm: Focal length.
        aperture: F-number, for vignetting; None for what the capture states.
        distance_m: Distance of the object, for vignetting; None for the farthest measured.
        crop_factor: Of the sensor; None for what capture or database tell.
        scale: Of the straight picture's radii, 1 as lensfun has them; None for the most up to 1
            at which no border is repeated.
        mosaic: What is said of the mosaic in place of the file; None for what it states.
    """

    focal_mm: float
    aperture: float | None = None
    distance_m: float | None = None
    crop_factor: float | None = None
    scale: float | None = None
    mosaic: MosaicOptions | None = None

    def __post_init__(self) -> None:
        """Refuse values that no camera can have.

        Raises:
            ContractError: If a number is not > 0.
        """
        for option in ("focal_mm", "aperture", "distance_m", "crop_factor", "scale"):
            value = getattr(self, option)
            if value is not None:
                check_positive(value, option)


@dataclass(frozen=True, slots=True, kw_only=True)
class LensBundle:
    """A bundle that has no members but its manifest.

    Attributes:
        manifest: For `write_bundle(path, manifest, {})`.
        profile: What the database knows of the lens.
        notes: What had to be taken from elsewhere.
    """

    manifest: Manifest
    profile: LensfunProfile
    notes: tuple[str, ...]

    def to_record(self) -> dict[str, Any]:
        """Return its sources as JSON values."""
        lens_profile, entry, light = self.profile, self.profile.distortion, self.profile.vignetting
        return {
            "lens": lens_profile.lens.name,
            "file": lens_profile.lens.file,
            "crop_factor": lens_profile.lens.crop_factor,
            "model": entry.model,
            "focal_mm": entry.focal_mm,
            "terms": dict(zip(TERMS[entry.model], entry.terms, strict=True)),
            "scale": lens_profile.scale,
            "residual_px": round(lens_profile.residual_px, 6),
            "vignetting": light
            and {
                "focal_mm": light.focal_mm,
                "aperture": light.aperture,
                "distance_m": light.distance_m,
                "terms": list(light.terms),
            },
            "notes": list(self.notes),
        }


def lensfun_bundle(
    database: Path, lens: str, capture: Path, options: CameraOptions, *, name: str | None = None
) -> LensBundle:
    """Make a bundle that undistorts and evens the light of a lens that lensfun knows.

    Args:
        database: Folder of a lensfun database, or one of its XML files.
        lens: Model of the lens, as the database writes it.
        capture: One of the captures; the bundle is for others like it.
        options: How they were taken.
        name: Of the bundle; None for that of the lens.

    Raises:
        DecodeError: If database or capture cannot be read, the lens is not known or was not
            measured for such captures, or nothing tells the sensor's size.
    """
    files = Database(database)
    lenses = files.find(lens)
    shot = read_capture(capture, mosaic=options.mosaic)
    frame, frame_notes = frame_of(shot, options.crop_factor, files, stated_crop(capture))
    lens_profile = profile_of(
        lenses,
        options.focal_mm,
        frame,
        aperture=shot.metadata.f_number if options.aperture is None else options.aperture,
        distance_m=options.distance_m,
        scale=options.scale,
    )
    manifest, stood_in = manifest_of(slug(name or lens), shot, frame, lens_profile.profile)
    return LensBundle(
        manifest=manifest,
        profile=lens_profile,
        notes=(*frame_notes, *lens_profile.notes, *stood_in),
    )
