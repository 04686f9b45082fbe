"""Write DNG: a Bayer mosaic or linear planes as an uncompressed raw file with its metadata.

    header | preview's directory | sensor's directory | EXIF, GPS | rows of samples | preview

The first directory holds a small JPEG and what is said of the photograph, its child the samples
(DNG specification 1.7, chapter 4). LibRaw gives back the same samples, levels, pattern and white
balance. The caller writes to a temporary name and renames.
"""

import json
import math
import os
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.cfa import CFA_PATTERNS, CfaPattern, cfa_channels
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.directory import (
    Kind,
    Tags,
    directory_bytes,
    directory_length,
    header_bytes,
)
from camkit.runtime.output.dng_preview import Averages, preview_jpeg
from camkit.runtime.output.exif import main_tags, sub_directories

PHOTOMETRIC_CFA: Final = 32803
PHOTOMETRIC_LINEAR_RAW: Final = 34892
PHOTOMETRIC_YCBCR: Final = 6
UNCOMPRESSED, JPEG = 1, 7
ILLUMINANT_D65: Final = 21
MAX_LEVEL: Final = 65535
MAX_BYTES: Final = 2**32 - 2**20
"""A DNG has 32-bit offsets."""

_DENOMINATOR: Final = 1_000_000
_SRGB_PREVIEW: Final = 2
_BITS: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class DngTags:
    """The metadata of a DNG beside its samples.

    Attributes:
        cfa: Letters of the 2x2 cell; None for linear planes.
        black: Black level, one integer or (2, 2) integers by position (mosaics only).
        white: White level.
        color_matrix: (3, 3) XYZ (D65) to camera; None leaves the colour to the reader.
        as_shot_neutral: Raw response to the white of the scene, largest 1 by custom:
            1 / white-balance gains.
        camera_model: UniqueCameraModel, for captures of camkit "camkit BUNDLE".
        metadata: What is said of the photograph; make and model follow from the camera model where
            it states none.
        noise: Noise of the linear signal (1.0 = white level) before white balance.
        description: ImageDescription; see `camkit_description`.
        orientation: EXIF orientation 1..8.
    """

    cfa: CfaPattern | None
    black: int | NDArray[np.integer[Any]]
    white: int
    color_matrix: NDArray[np.float64] | None
    as_shot_neutral: tuple[float, float, float]
    camera_model: str
    metadata: Metadata = field(default_factory=Metadata)
    noise: NoiseModel | None = None
    description: str = ""
    orientation: int = 1

    def __post_init__(self) -> None:
        if self.cfa is not None and self.cfa not in CFA_PATTERNS:
            raise ContractError(f"CFA must be one of {CFA_PATTERNS} or None; got {self.cfa!r}")
        black = np.asarray(self.black)
        if black.shape not in ((), (2, 2)) or not np.issubdtype(black.dtype, np.integer):
            raise ContractError(f"black must be an integer or (2, 2) integers; got {self.black!r}")
        if black.shape and self.cfa is None:
            raise ContractError("linear planes take one black level, not one per CFA position")
        if not (black.min() >= 0 and black.max() < self.white <= MAX_LEVEL):
            raise ContractError(
                f"levels must be 0 <= black < white <= {MAX_LEVEL}; got {self.black}, {self.white}"
            )
        neutral = self.as_shot_neutral
        if len(neutral) != 3 or not all(math.isfinite(n) and 0 < n < 1e3 for n in neutral):
            raise ContractError(f"as_shot_neutral must be 3 values > 0; got {neutral}")
        if self.orientation not in range(1, 9):
            raise ContractError(f"orientation must be 1..8; got {self.orientation}")
        if not (self.camera_model + self.description).isascii():
            raise ContractError("camera model and description of a DNG must be ASCII")


def camkit_description(
    *,
    bundle: str,
    origin_px: tuple[int, int],
    sensor_size_px: tuple[int, int],
    pixel_pitch_um: float,
    object_distance_mm: float | None = None,
    psf_sha256: str | None = None,
) -> str:
    """Return the JSON that tells a later reader where on which sensor the capture lies.

    The object distance (inf as "inf") and the hash of the PSF are left out if None.
    """
    record: dict[str, Any] = {
        "bundle": bundle,
        "origin_px": list(origin_px),
        "sensor_size_px": list(sensor_size_px),
        "pixel_pitch_um": pixel_pitch_um,
    }
    if object_distance_mm is not None:
        finite = math.isfinite(object_distance_mm)
        record["object_distance_mm"] = object_distance_mm if finite else "inf"
    if psf_sha256 is not None:
        record["psf_sha256"] = psf_sha256
    return json.dumps({"camkit": record})


class DngFile:
    """A DNG whose rows of samples are appended from top to bottom, its preview at the end."""

    def __init__(
        self, path: str | os.PathLike[str], shape: tuple[int, ...], tags: DngTags, sensor: Tags
    ) -> None:
        """Open the file.

        Args:
            path: Written as it is; an existing file is replaced.
            shape: (h, w) or (h, w, 3) of the samples.
            tags: Its metadata.
            sensor: What only the directory of the samples holds.

        Raises:
            ContractError: If the samples do not fit into a DNG.
            OSError: If the file cannot be written.
        """
        self._shape, self._tags, self._sensor = shape, tags, sensor
        if math.prod(shape) * _BITS // 8 > MAX_BYTES:
            raise ContractError(
                f"a DNG holds at most 4 GB; {shape[1]}x{shape[0]} pixels need more: "
                f"choose {option_text('format')} tiff or exr"
            )
        self._file = Path(path).open("wb")  # noqa: SIM115
        self._file.write(bytes(len(self._front((1, 1), 0))))

    def append(self, rows: NDArray[np.uint16]) -> None:
        """Append (rows, w) or (rows, w, 3) samples."""
        self._file.write(np.ascontiguousarray(rows, dtype="<u2").data)

    def finish(self, preview: FloatArray) -> None:
        """Complete the file.

        Args:
            preview: (3, h, w) float32 DN above black, fewer pixels than the samples: LibRaw takes
                the largest picture of a file for the photograph.
        """
        tags = self._tags
        range_dn = tags.white - float(np.mean(tags.black))
        red, green, blue = (1 / (range_dn * n) for n in tags.as_shot_neutral)
        coded = preview_jpeg(preview, (red, green, blue), tags.color_matrix)
        self._file.write(coded)
        self._file.seek(0)
        self._file.write(self._front((preview.shape[2], preview.shape[1]), len(coded)))
        self._file.close()

    def release(self) -> None:
        """Release the file as it is."""
        self._file.close()

    def _front(self, size: tuple[int, int], preview_bytes: int) -> bytes:
        """Return all that stands before the first row; its length is always the same."""
        metadata, samples_bytes = self._tags.metadata, math.prod(self._shape) * _BITS // 8
        pointers, _ = sub_directories(metadata, 0)
        main = {**_main(self._tags), **_preview(size, preview_bytes), **pointers}
        sensor = {
            **_samples(self._shape, samples_bytes),
            **_noise(self._tags.noise),
            **self._sensor,
        }
        start = len(header_bytes(0))
        sensor_at = start + directory_length(main)
        below_at = sensor_at + directory_length(sensor)
        pointers, sub_bytes = sub_directories(metadata, below_at)
        samples_at = below_at + len(sub_bytes)
        main |= {
            273: (Kind.LONG, samples_at + samples_bytes),  # StripOffsets
            330: (Kind.LONG, sensor_at),  # SubIFDs
            **pointers,
        }
        sensor[273] = Kind.LONG, samples_at
        return (
            header_bytes(start)
            + directory_bytes(main, start)
            + directory_bytes(sensor, sensor_at)
            + sub_bytes
        )


def write_bayer_dng(
    path: str | os.PathLike[str], mosaic: NDArray[np.uint16], *, tags: DngTags
) -> None:
    """Write a mosaic as CFA DNG.

    Args:
        path: Written as it is; an existing file is replaced.
        mosaic: (h, w) uint16 in DN.
        tags: Its metadata; `cfa` must be set.

    Raises:
        ContractError: If shape, type or tags do not fit.
        OSError: If the file cannot be written.
    """
    if mosaic.ndim != 2 or mosaic.dtype != np.uint16 or 0 in mosaic.shape:
        raise ContractError(f"mosaic must be (h, w) uint16; got {mosaic.dtype} {mosaic.shape}")
    if tags.cfa is None:
        raise ContractError("a Bayer DNG needs tags.cfa; for planes open a linear DNG")
    black = np.broadcast_to(np.asarray(tags.black), (2, 2))
    cell = [color for row in cfa_channels(tags.cfa) for color in row]
    sensor: Tags = {
        262: (Kind.SHORT, PHOTOMETRIC_CFA),
        33421: (Kind.SHORT, (2, 2)),  # CFARepeatPatternDim
        33422: (Kind.BYTE, bytes(cell)),  # CFAPattern
        50710: (Kind.BYTE, bytes((0, 1, 2))),  # CFAPlaneColor
        50711: (Kind.SHORT, 1),  # CFALayout: square
        50713: (Kind.SHORT, (2, 2)),  # BlackLevelRepeatDim
        50714: (Kind.LONG, tuple(black.ravel().tolist())),  # BlackLevel
        50717: (Kind.LONG, tags.white),  # WhiteLevel
    }
    file = DngFile(path, mosaic.shape, tags, sensor)
    try:
        file.append(mosaic)
        file.finish(_preview_of_mosaic(mosaic, tags.cfa, tags))
    finally:
        file.release()


def open_linear_dng(path: str | os.PathLike[str], shape: tuple[int, int], tags: DngTags) -> DngFile:
    """Open a LinearRaw DNG of planes in camera space, white balance divided out.

    Args:
        path: Written as it is; an existing file is replaced.
        shape: (h, w) of the planes; rows are appended as (rows, w, 3) uint16 in DN.
        tags: Its metadata; `cfa` must be None.

    Raises:
        ContractError: If shape or tags do not fit.
        OSError: If the file cannot be written.
    """
    if tags.cfa is not None:
        raise ContractError("linear planes have no CFA; for a mosaic use write_bayer_dng")
    sensor: Tags = {
        262: (Kind.SHORT, PHOTOMETRIC_LINEAR_RAW),
        50714: (Kind.LONG, (int(tags.black),) * 3),  # BlackLevel
        50717: (Kind.LONG, (tags.white,) * 3),  # WhiteLevel
    }
    return DngFile(path, (*shape, 3), tags, sensor)


def _preview_of_mosaic(mosaic: NDArray[np.uint16], cfa: CfaPattern, tags: DngTags) -> FloatArray:
    """Return (3, h, w) float32 DN above black: averages over the positions of the cell."""
    height, width = (max(side // 2, 1) for side in mosaic.shape)
    black = np.broadcast_to(np.asarray(tags.black, dtype=np.float32), (2, 2))
    channels: list[list[FloatArray]] = [[], [], []]
    for y, row in enumerate(cfa_channels(cfa)):
        for x, channel in enumerate(row):
            averages = Averages(height, width)
            averages.add(mosaic[None, y::2, x::2][:, :height, :width])
            channels[channel].append(averages.planes()[0] - black[y, x])
    return np.stack([np.mean(planes, axis=0) for planes in channels])


def _main(tags: DngTags) -> dict[int, tuple[Kind, Any]]:
    """Return the tags about the photograph as a whole."""
    make, _, model = tags.camera_model.partition(" ")
    entries: dict[int, tuple[Kind, Any]] = {
        271: (Kind.ASCII, make.encode()),  # Make
        272: (Kind.ASCII, (model or make).encode()),  # Model
        **main_tags(tags.metadata),
        274: (Kind.SHORT, tags.orientation),  # Orientation
        330: (Kind.LONG, 0),  # SubIFDs
        50706: (Kind.BYTE, bytes((1, 4, 0, 0))),  # DNGVersion
        50707: (Kind.BYTE, bytes((1, 3, 0, 0))),  # DNGBackwardVersion
        50708: (Kind.ASCII, tags.camera_model.encode()),  # UniqueCameraModel
        50728: (Kind.RATIONAL, _ratios(tags.as_shot_neutral)),  # AsShotNeutral
        50730: (Kind.SRATIONAL, 0),  # BaselineExposure
        50966: (Kind.ASCII, b"camkit"),  # PreviewApplicationName
        50970: (Kind.LONG, _SRGB_PREVIEW),  # PreviewColorSpace
    }
    if tags.description:
        entries[270] = Kind.ASCII, tags.description.encode()  # ImageDescription
    if tags.color_matrix is not None:
        values = np.asarray(tags.color_matrix, dtype=np.float64).ravel().tolist()
        entries[50721] = Kind.SRATIONAL, _ratios(values)  # ColorMatrix1
        entries[50778] = Kind.SHORT, ILLUMINANT_D65  # CalibrationIlluminant1
    return entries


def _preview(size: tuple[int, int], preview_bytes: int) -> Tags:
    width, height = size
    return {
        254: (Kind.LONG, 1),  # NewSubfileType: reduced
        256: (Kind.LONG, width),  # ImageWidth
        257: (Kind.LONG, height),  # ImageLength
        258: (Kind.SHORT, (8, 8, 8)),  # BitsPerSample
        259: (Kind.SHORT, JPEG),  # Compression
        262: (Kind.SHORT, PHOTOMETRIC_YCBCR),
        273: (Kind.LONG, 0),  # StripOffsets
        277: (Kind.SHORT, 3),  # SamplesPerPixel
        278: (Kind.LONG, height),  # RowsPerStrip
        279: (Kind.LONG, preview_bytes),  # StripByteCounts
        284: (Kind.SHORT, 1),  # PlanarConfiguration
        530: (Kind.SHORT, (1, 1)),  # YCbCrSubSampling: none
        531: (Kind.SHORT, 1),  # YCbCrPositioning: centred
        532: (Kind.RATIONAL, (0, 255, 128, 255, 128, 255)),  # ReferenceBlackWhite
    }


def _samples(shape: tuple[int, ...], samples_bytes: int) -> dict[int, tuple[Kind, Any]]:
    colours = shape[2] if len(shape) == 3 else 1
    return {
        254: (Kind.LONG, 0),  # NewSubfileType: the picture itself
        256: (Kind.LONG, shape[1]),  # ImageWidth
        257: (Kind.LONG, shape[0]),  # ImageLength
        258: (Kind.SHORT, (_BITS,) * colours),  # BitsPerSample
        259: (Kind.SHORT, UNCOMPRESSED),  # Compression
        273: (Kind.LONG, 0),  # StripOffsets
        277: (Kind.SHORT, colours),  # SamplesPerPixel
        278: (Kind.LONG, shape[0]),  # RowsPerStrip
        279: (Kind.LONG, samples_bytes),  # StripByteCounts
        284: (Kind.SHORT, 1),  # PlanarConfiguration: interleaved
    }


def _noise(noise: NoiseModel | None) -> Tags:
    """Return NoiseProfile in CFAPlaneColor order."""
    if noise is None:
        return {}
    pairs = zip(noise.shot, noise.read_variance, strict=True)
    return {51041: (Kind.DOUBLE, tuple(float(value) for pair in pairs for value in pair))}


def _ratios(values: "tuple[float, ...] | list[float]") -> tuple[Fraction, ...]:
    return tuple(Fraction(round(value * _DENOMINATOR), _DENOMINATOR) for value in values)
