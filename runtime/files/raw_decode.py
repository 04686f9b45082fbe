"""A decoded RAW file, and what is checked and noted of it before it is a capture."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.cfa import CfaPattern
from camkit.errors import DecodeError
from camkit.runtime.capture import MAX_ISO, Capture, MosaicOptions
from camkit.runtime.files import raw_checks, raw_tags
from camkit.runtime.files.dng import dng_checks, white_point
from camkit.runtime.files.dng.picture_tags import DngPicture, first_of
from camkit.runtime.files.doubts import find_doubts
from camkit.runtime.files.lone_pixels import count_lone
from camkit.runtime.files.order.tile_edges import TileGrid
from camkit.runtime.files.raw_checks import Levels
from camkit.runtime.files.tiff_tags import TiffTags
from camkit.runtime.files.white_level import believable_white, check_said_white
from camkit.runtime.metadata import Metadata

BELIEVABLE_GAIN_STOPS: Final = 6.0
LONE_NOTE_SHARE: Final = 2e-5
CODES_WHITE: Final = 16383.0
GREATER_STOPS: Final = 1.0
"""A BaselineExposure beyond it changes how bright other programs show the picture."""
_ORIENTATION: Final = 274
_BASELINE_EXPOSURE: Final = 50730


@dataclass(frozen=True, slots=True, kw_only=True)
class RawDecode:
    """Result of a decoder.

    Attributes:
        samples: (h, w) mosaic or (3, h, w) planes, which may be one plane seen three times.
        cfa: Pattern of a mosaic; None for planes.
        levels: Black and white of the samples.
        orientation: EXIF orientation.
        metadata: What the file says of its photograph.
        gains: White balance that the decoder found, not checked; None for that of the tags.
        table_matrix: Colour matrix of a table of cameras; None where there is none.
        masked: Areas of the sensor that see no light.
        grid: Tiles that the file stores.
        notes: What a person should know.
    """

    samples: NDArray[Any]
    cfa: CfaPattern | None
    levels: Levels
    orientation: int
    metadata: Metadata
    gains: tuple[float, float, float] | None = None
    table_matrix: NDArray[np.float64] | None = None
    masked: Sequence[NDArray[Any]] = ()
    grid: TileGrid | None = None
    notes: Sequence[str] = field(default_factory=list)


def noted(decode: RawDecode, doubt: str) -> RawDecode:
    """Return a decode with a doubt about its header, if there is one, among its notes."""
    return (
        replace(decode, notes=[*decode.notes, f"{doubt}: the header is damaged"])
        if doubt
        else decode
    )


def to_capture(
    decode: RawDecode, tags: TiffTags, picture: DngPicture | None, options: MosaicOptions
) -> Capture:
    """Return the capture of a decode that can be believed.

    Args:
        decode: Of the file.
        tags: Of the file.
        picture: Its sensor picture, if it is a DNG.
        options: Levels that the caller says in place of the file's.

    Raises:
        DecodeError: If the decode cannot be true.
    """
    notes = [*decode.notes, *dng_checks.find_doubts(tags), *_exposure_note(picture)]
    levels = _judged(decode, raw_tags.sample_bits(tags), options, notes)
    place = raw_tags.sensor_place(tags)
    iso = decode.metadata.iso
    return Capture(
        samples=decode.samples,
        cfa=decode.cfa,
        black_level=levels.black,
        white_level=levels.white,
        white_balance=_white_balance(decode, tags, picture, notes),
        color_matrix=_color_matrix(decode, tags, notes),
        orientation=decode.orientation,
        iso=iso if iso is not None and iso <= MAX_ISO else None,
        exposure_time_s=decode.metadata.exposure_time_s,
        noise=raw_tags.noise_profile(tags, decode.cfa),
        origin_px=place.origin_px,
        sensor_size_px=place.sensor_size_px,
        pixel_pitch_um=place.pixel_pitch_um,
        bundle_name=place.bundle_name,
        psf_sha256=place.psf_sha256,
        camera=raw_tags.camera_name(tags, decode.metadata),
        metadata=decode.metadata,
        notes=tuple(notes),
    )


def stated_orientation(tags: TiffTags) -> int | None:
    """Return the EXIF orientation that a file states, 1 for a number that is none; None if absent.

    Programs that do not know it write 0, which LibRaw takes for a quarter turn.
    """
    numbers = tags.numbers(_ORIENTATION)
    if numbers is None:
        return None
    return int(numbers[0]) if numbers[0] in range(1, 9) else 1


def _judged(decode: RawDecode, bits: int, options: MosaicOptions, notes: list[str]) -> Levels:
    """Check samples against their levels; return the levels, white corrected, and add notes."""
    samples, levels, cfa = decode.samples, decode.levels, decode.cfa
    if samples.dtype.kind == "f":
        raw_checks.check_levels(levels, largest_possible=np.inf)
        codes, code_levels = _codes(samples, levels, notes)
    else:
        raw_checks.check_levels(levels)
        if options.white_level is None:
            levels, note = believable_white(samples, levels, cfa, bits)
            notes += [note] if note else []
        else:
            check_said_white(samples, levels.white)
        raw_checks.check_content(samples, levels)
        codes, code_levels = samples, levels
    _note_lone(codes, code_levels, cfa, notes)
    notes += find_doubts(codes, code_levels, cfa, decode.masked, decode.grid)
    return levels


def _codes(
    samples: NDArray[Any], levels: Levels, notes: list[str]
) -> tuple[NDArray[np.uint16], Levels]:
    """Return float samples as whole numbers up to white, for the checks, and note what is odd.

    Raises:
        DecodeError: If no sample is a number, or all are the same.
    """
    finite = np.isfinite(samples)
    if not finite.any():
        raise DecodeError("no sample is a number: the pixel data are missing or damaged")
    low, high = float(samples[finite].min()), float(samples[finite].max())
    if low == high:
        raise DecodeError(f"every pixel is {low:g}: the pixel data are missing or were not decoded")
    if not finite.all():
        notes.append(
            f"{np.count_nonzero(~finite)} samples are NaN or infinite: they count as invalid"
        )
    count = np.count_nonzero(samples > levels.white)
    if count:
        notes.append(
            f"{count} samples lie above white {levels.white:g}, up to {high:.4g}: they are kept"
        )
    floor = min(low, float(levels.black.min()), 0.0)
    scale = CODES_WHITE / (levels.white - floor)
    codes = np.clip((np.where(finite, samples, floor) - floor) * scale, 0, CODES_WHITE)
    return np.rint(codes).astype(np.uint16), Levels(
        black=np.asarray((levels.black - floor) * scale, dtype=np.float32), white=CODES_WHITE
    )


def _note_lone(
    samples: NDArray[Any], levels: Levels, cfa: CfaPattern | None, notes: list[str]
) -> None:
    planes, cell = ([samples], 2) if cfa is not None else (list(samples), 1)
    count = sum(count_lone(plane, levels, cell) for plane in planes)
    share = count / samples.size
    if share >= LONE_NOTE_SHARE:
        notes.append(
            f"{count} pixels ({share:.4%}) differ from all neighbours: hot pixels or damage"
        )


def _exposure_note(picture: DngPicture | None) -> list[str]:
    stops = 0.0 if picture is None else first_of(picture.directory, _BASELINE_EXPOSURE)
    if abs(stops) < GREATER_STOPS:
        return []
    return [
        f"BaselineExposure {stops:+.2f} EV is not applied: other programs show the picture "
        f"{'brighter' if stops > 0 else 'darker'} by that"
    ]


def _white_balance(
    decode: RawDecode, tags: TiffTags, picture: DngPicture | None, notes: list[str]
) -> tuple[float, float, float] | None:
    gains = np.array(decode.gains or (0.0, 0.0, 0.0))
    if picture is not None:
        grey = white_point.neutral(tags)
        gains = np.zeros(3) if grey is None else 1 / grey
    if gains[1] > 0:
        gains = gains / gains[1]
        if (np.abs(np.log2(np.maximum(gains, 1e-9))) < BELIEVABLE_GAIN_STOPS).all():
            return float(gains[0]), 1.0, float(gains[2])
    notes.append("the file has no valid white balance")
    return None


def _color_matrix(
    decode: RawDecode, tags: TiffTags, notes: list[str]
) -> NDArray[np.float64] | None:
    """Return XYZ (D65) to camera, from the DNG tags or else from LibRaw's table of cameras."""
    tagged = white_point.color_matrix(tags)
    if tagged is not None:
        matrix, note = tagged
        notes.extend([note] if note else [])
        return matrix
    table = decode.table_matrix
    if table is not None and np.isfinite(table).all() and abs(np.linalg.det(table)) > 1e-9:
        return table
    notes.append("no colour matrix is known for this camera")
    return None
