"""A bundle of an ordinary lens, for captures like one: no kernels, no network.

linearise -> repair -> white_balance -> [demosaic] -> raise_clipped -> illumination -> undistort
-> color
"""

import math
import re
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.chain import rewired
from camkit.bundle.manifest import Manifest, manifest_without_networks
from camkit.bundle.optics import LensProfile
from camkit.bundle.sensor import BayerSensor, Extent, IsoNoise, PlanesSensor, Row
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Illumination,
    Linearise,
    RaiseClipped,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
)
from camkit.calibration.lensfun.database import Database
from camkit.calibration.lensfun.models import FULL_FRAME_MM
from camkit.calibration.lensfun.profile import Frame
from camkit.caller import option_text
from camkit.colorimetry import D65, REC709_PRIMARIES, rgb_to_xyz
from camkit.errors import DecodeError
from camkit.runtime.capture import COLOURS, Capture
from camkit.runtime.files.exif_tags import NUMBER_TAGS, exif_of_picture
from camkit.runtime.files.tiff_tags import read_tiff_tags
from camkit.units import to_mm

FOCAL_LENGTH_35_MM: Final = 41989
"""Tag of EXIF: FocalLengthIn35mmFilm, whole millimetres."""
EXIF_WITHIN_BYTES: Final = 1 << 18
CROPS_AGREE: Final = 1.15
"""Up to this factor: makers round."""
LICENCE: Final = "CC-BY-SA-3.0"
"""Of the numbers of lensfun's database, which a profile is made of."""


def stated_crop(path: Path) -> float | None:
    """Return the crop factor of a file that states its focal length twice, also as that for 35 mm.

    That one is whole millimetres, so it is a hint; None where it is not stated.

    Raises:
        OSError: If the file cannot be read.
    """
    tags = read_tiff_tags(path)
    if not tags.directories:
        with path.open("rb") as file:
            tags = exif_of_picture(file.read(EXIF_WITHIN_BYTES))
    equivalents, focals = (
        tags.numbers(tag) for tag in (FOCAL_LENGTH_35_MM, NUMBER_TAGS["focal_length_mm"])
    )
    if not equivalents or not focals or not (equivalents[0] > 0 and focals[0] > 0):
        return None
    return equivalents[0] / focals[0]


def frame_of(
    capture: Capture,
    crop_factor: float | None,
    database: Database,
    stated_crop_factor: float | None = None,
) -> tuple[Frame, tuple[str, ...]]:
    """Return size and scale of the captures, and notes on values taken from elsewhere.

    Args:
        capture: One of them.
        crop_factor: What a person states; None for what file or database say.
        database: Knows cameras by name.
        stated_crop_factor: What `stated_crop` says of its file.

    Raises:
        DecodeError: If nothing tells how large the sensor is, or file and database contradict each
            other, or it is no colour picture.
    """
    if capture.channels != COLOURS:
        raise DecodeError(f"expected a mosaic or three colours; got {capture.channels} channel(s)")
    size = (capture.width, capture.height)
    metadata = capture.metadata
    notes = []
    crop, pitch_um = crop_factor, capture.pixel_pitch_um
    if crop is None and pitch_um is not None:
        crop = FULL_FRAME_MM / (math.hypot(*size) * to_mm(pitch_um))
    if crop is None and (crop := database.crop_factor(metadata.make, metadata.model)) is not None:
        notes.append(f"the sensor's size is that of the {metadata.model} in the database")
        if (
            stated_crop_factor is not None
            and not crop / CROPS_AGREE < stated_crop_factor < crop * CROPS_AGREE
        ):
            raise DecodeError(
                f"the database has crop factor {crop:g} for the {metadata.model}, the capture "
                f"states focal lengths of crop factor {stated_crop_factor:.2f}, as in a crop mode: "
                f"add {option_text('crop_factor')}"
            )
    if crop is None:
        raise DecodeError(
            "the capture states no pixel pitch and the database does not know its camera: add "
            f"{option_text('crop_factor')}"
        )
    if pitch_um is None:
        pitch_um = 1000 * FULL_FRAME_MM / crop / math.hypot(*size)
    return Frame(size_px=size, pitch_um=pitch_um, crop_factor=crop, channels=COLOURS), tuple(notes)


def manifest_of(
    name: str, capture: Capture, frame: Frame, profile: LensProfile
) -> tuple[Manifest, tuple[str, ...]]:
    """Return the manifest of a bundle for captures like one, and notes."""
    sensor, notes = _sensor(capture, frame)
    stages = _stages(profile, mosaic=capture.cfa is not None)
    manifest = manifest_without_networks(
        stages,
        sensor,
        profile,
        name=name,
        version="1.0.0",
        licence=LICENCE,
        training_data="no network; distortion and vignetting of lensfun's database",
    )
    return manifest, notes


def slug(text: str) -> str:
    """Return a name of a bundle out of that of a file."""
    plain = re.sub(r"[^a-z0-9_-]+", "-", text.lower()).strip("-_")
    return plain[:64] or "lens"


def _sensor(capture: Capture, frame: Frame) -> tuple[BayerSensor | PlanesSensor, tuple[str, ...]]:
    notes = []
    black, white = float(np.mean(capture.black_level)), float(capture.white_level)
    width, height = frame.size_px
    if capture.noise is not None and min(capture.noise.shot) > 0:
        full_well_e = 1 / float(np.mean(capture.noise.shot))
        read_noise_e = math.sqrt(float(np.mean(capture.noise.read_variance))) * full_well_e
    else:
        full_well_e, read_noise_e = white - black, 0.0
        notes.append("the capture states no noise: 1 electron per DN is assumed")
    fields: dict[str, Any] = {
        "extent": Extent(width_px=width, height_px=height, pixel_pitch_um=frame.pitch_um),
        "black_level": max(black, 0.0),
        "white_level": white,
        "full_well_e": full_well_e,
        "noise": (
            IsoNoise(
                iso=capture.iso or 100.0,
                gain_e_per_dn=full_well_e / (white - black),
                read_noise_e=read_noise_e,
            ),
        ),
    }
    from_xyz = capture.color_matrix
    if capture.cfa is None:
        matrix = None if from_xyz is None else _rows(from_xyz)
        return PlanesSensor(**fields, color_matrix=matrix), tuple(notes)
    if from_xyz is None:
        from_xyz = np.asarray(np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65)), dtype=np.float64)
        notes.append("the capture states no colour matrix: camera RGB is used as Rec.709")
    return BayerSensor(**fields, cfa=capture.cfa, color_matrix=_rows(from_xyz)), tuple(notes)


def _rows(matrix: NDArray[np.float64]) -> tuple[Row, Row, Row]:
    red, green, blue = ((float(x), float(y), float(z)) for x, y, z in matrix)
    return red, green, blue


def _stages(profile: LensProfile, *, mosaic: bool) -> tuple[Stage, ...]:
    usual: tuple[Stage, ...] = (
        Linearise(),
        Repair(),
        WhiteBalance(),
        Demosaic(),
        RaiseClipped(takes=("rgb",)),
        Illumination(),
        Undistort(),
        Color(),
    )
    left_out = set() if mosaic else {"demosaic", "raise_clipped"}
    left_out |= {"illumination"} if profile.illumination is None else set()
    left_out |= {"undistort"} if profile.distortion is None else set()
    return rewired([stage for stage in usual if stage.type not in left_out], usual)
