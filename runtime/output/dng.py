"""Write DNG: a Bayer mosaic or linear planes as an uncompressed raw file with its metadata.

About twenty tags in one directory (DNG specification 1.7, chapter 4); LibRaw gives back the same
samples, levels, pattern and white balance. The caller writes to a temporary name and renames.
"""

import json
import math
import os
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import tifffile
from numpy.typing import NDArray

from camkit.contracts import CFA_PATTERNS, CfaPattern, NoiseModel, cfa_channels
from camkit.errors import ContractError

PHOTOMETRIC_CFA: Final = 32803
PHOTOMETRIC_LINEAR_RAW: Final = 34892
ILLUMINANT_D65: Final = 21
MAX_LEVEL: Final = 65535
_DENOMINATOR: Final = 1_000_000
_BYTE, _ASCII, _SHORT, _LONG, _RATIONAL, _SRATIONAL, _DOUBLE = 1, 2, 3, 4, 5, 10, 12

ExtraTag = tuple[int, int, int, Any, bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class DngTags:
    """What a DNG says beside its samples.

    Attributes:
        cfa: Letters of the 2x2 cell; None for linear planes.
        black: Black level, one integer or (2, 2) integers by position (mosaics only).
        white: White level.
        color_matrix: (3, 3) XYZ (D65) to camera; None leaves the colour to the reader.
        as_shot_neutral: Raw response to the white of the scene, largest 1 by custom:
            1 / white-balance gains.
        camera_model: UniqueCameraModel, for captures of camkit "camkit BUNDLE".
        iso: ISO speed.
        exposure_time_s: Exposure time.
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
    iso: float | None = None
    exposure_time_s: float | None = None
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
) -> str:
    """Give the JSON that tells a later reader where on which sensor the capture lies.

    The object distance (inf as "inf") is left out if None.
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
    return json.dumps({"camkit": record})


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
        raise ContractError("a Bayer DNG needs tags.cfa; for planes use write_linear_dng")
    cell = [color for row in cfa_channels(tags.cfa) for color in row]
    black = np.broadcast_to(np.asarray(tags.black), (2, 2)).ravel().tolist()
    extra: list[ExtraTag] = [
        (33421, _SHORT, 2, (2, 2), True),  # CFARepeatPatternDim
        (33422, _BYTE, 4, bytes(cell), True),  # CFAPattern
        (50710, _BYTE, 3, bytes((0, 1, 2)), True),  # CFAPlaneColor
        (50711, _SHORT, 1, 1, True),  # CFALayout: square
        (50713, _SHORT, 2, (2, 2), True),  # BlackLevelRepeatDim
        (50714, _LONG, 4, tuple(black), True),  # BlackLevel
        (50717, _LONG, 1, tags.white, True),  # WhiteLevel
    ]
    _write(path, mosaic, PHOTOMETRIC_CFA, extra, tags)


def write_linear_dng(
    path: str | os.PathLike[str], planes: NDArray[np.uint16], *, tags: DngTags
) -> None:
    """Write planes in camera space (white balance divided out) as LinearRaw DNG.

    Args:
        path: Written as it is; an existing file is replaced.
        planes: (3, h, w) uint16 in DN.
        tags: Its metadata; `cfa` must be None.

    Raises:
        ContractError: If shape, type or tags do not fit.
        OSError: If the file cannot be written.
    """
    if planes.ndim != 3 or len(planes) != 3 or planes.dtype != np.uint16 or 0 in planes.shape:
        raise ContractError(f"planes must be (3, h, w) uint16; got {planes.dtype} {planes.shape}")
    if tags.cfa is not None:
        raise ContractError("linear planes have no CFA; for a mosaic use write_bayer_dng")
    extra: list[ExtraTag] = [
        (50714, _LONG, 3, (int(tags.black),) * 3, True),
        (50717, _LONG, 3, (tags.white,) * 3, True),
    ]
    _write(path, np.moveaxis(planes, 0, -1), PHOTOMETRIC_LINEAR_RAW, extra, tags)


def _write(
    path: str | os.PathLike[str],
    samples: NDArray[np.uint16],
    photometric: int,
    extra: list[ExtraTag],
    tags: DngTags,
) -> None:
    try:
        tifffile.imwrite(
            path,
            samples,
            photometric=photometric,
            planarconfig="contig" if samples.ndim == 3 else None,
            subfiletype=0,
            description=tags.description or None,
            metadata=None,
            software=False,
            extratags=[*extra, *_common_tags(tags)],
        )
    except OSError as error:
        if error.errno is not None:
            raise
        # NumPy says how many samples it wrote of how many, and nothing of the disk.
        raise OSError(f"the disk is full, or no file may be so large ({error})") from error


def _common_tags(tags: DngTags) -> list[ExtraTag]:
    make, _, model = tags.camera_model.partition(" ")
    found: list[ExtraTag] = [
        (271, _ASCII, 0, make, True),  # Make
        (272, _ASCII, 0, model or make, True),  # Model
        (274, _SHORT, 1, tags.orientation, True),  # Orientation
        (50706, _BYTE, 4, bytes((1, 4, 0, 0)), True),  # DNGVersion
        (50707, _BYTE, 4, bytes((1, 3, 0, 0)), True),  # DNGBackwardVersion
        (50708, _ASCII, 0, tags.camera_model, True),  # UniqueCameraModel
        (50728, _RATIONAL, 3, _rationals(tags.as_shot_neutral), True),  # AsShotNeutral
        (50730, _SRATIONAL, 1, (0, 1), True),  # BaselineExposure
    ]
    if tags.color_matrix is not None:
        values = np.asarray(tags.color_matrix, dtype=np.float64).ravel().tolist()
        found.append((50721, _SRATIONAL, 9, _rationals(values), True))  # ColorMatrix1
        found.append((50778, _SHORT, 1, ILLUMINANT_D65, True))  # CalibrationIlluminant1
    if tags.exposure_time_s is not None:
        found.append((33434, _RATIONAL, 1, _rationals([tags.exposure_time_s]), True))
    if tags.iso is not None:
        found.append((34855, _SHORT, 1, min(round(tags.iso), MAX_LEVEL), True))
    if tags.noise is not None:
        pairs = zip(tags.noise.shot, tags.noise.read_variance, strict=True)
        profile = tuple(value for pair in pairs for value in pair)
        found.append((51041, _DOUBLE, 6, profile, True))  # NoiseProfile in CFAPlaneColor order
    return found


def _rationals(values: "tuple[float, ...] | list[float]") -> tuple[int, ...]:
    """Give numerators and denominators, one after the other."""
    return tuple(n for value in values for n in (round(value * _DENOMINATOR), _DENOMINATOR))
