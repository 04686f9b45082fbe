"""Read pictures: linear captures (EXR, 16-bit TIFF/PNG), headerless mosaics, sharp scenes.

    read_picture      a capture that is already RGB (linear_rgb_v1)
    read_mosaic       a single-channel PNG or TIFF that is a Bayer mosaic
    read_scene        a sharp scene for the simulation, as linear Rec.709
    read_light        the same as light, which is never negative
    read_orientation  how a file says that its samples are to be turned

PNG, TIFF, JPEG and Radiance HDR are decoded by OpenCV, EXR by the OpenEXR package. Samples stay as
they are stored; an EXIF orientation is told beside them.
"""

import contextlib
import sys
import threading
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.colorimetry import (
    D65,
    REC709_PRIMARIES,
    Matrix,
    adapt_white,
    apply_matrix,
    decode_srgb,
    rgb_to_xyz,
)
from camkit.contracts import FloatArray
from camkit.errors import DecodeError
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files import radiance, raw_checks
from camkit.runtime.files.exif_tags import exif_of_picture, metadata_of, orientation_of
from camkit.runtime.files.exr_attributes import metadata_of_exr
from camkit.runtime.files.mapped_tiff import map_plain_tiff
from camkit.runtime.files.tiff_tags import TiffTags, read_tiff_tags
from camkit.runtime.files.white_level import check_said_white
from camkit.runtime.geometry.turning import turn_back
from camkit.runtime.metadata import Metadata

EXR_MAGIC: Final = b"\x76\x2f\x31\x01"
MAX_EXR_PIXELS_PER_BYTE: Final = 4096
COUNTS_SUFFIXES: Final = (".tif", ".tiff")
FAINT: Final = 0.01
"""Negative samples up to this share of the brightest are noise."""
_JPEG_MAGIC: Final = b"\xff\xd8"
_CHROMATICITY_TOLERANCE: Final = 2e-3

# OpenEXR.File prints its warnings; they must not land in stdout, which may carry JSON
_exr_lock = threading.Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Picture:
    """A decoded file: (h, w) or (channel, h, w) with channel 3, R, G, B, and its colour space."""

    samples: NDArray[Any]
    to_rec709: Matrix | None
    notes: tuple[str, ...]
    orientation: int = 1
    metadata: Metadata = field(default_factory=Metadata)


def read_picture(path: Path, *, keep_codes: bool = False) -> Capture:
    """Read an RGB picture as a linear capture.

    Float and 16-bit samples are taken as linear, 8-bit ones are decoded from sRGB unless their
    codes are kept. NaN and infinite samples are kept and counted in the notes.

    Raises:
        DecodeError: If the file is damaged or not an RGB picture.
        OSError: If it cannot be read.
    """
    picture = _decode(path)
    samples, notes = picture.samples, [*picture.notes]
    if samples.ndim == 2 and _begins(path, _JPEG_MAGIC):
        raise DecodeError("expected an RGB picture, got a grey JPEG; give it in colour")
    if samples.ndim == 2 and not _begins(path, EXR_MAGIC):
        counted = f"; {_counts_advice()}" if path.suffix.lower() in COUNTS_SUFFIXES else ""
        raise DecodeError(
            f"expected an RGB picture, got a single channel; {mosaic_advice()}{counted}"
        )
    if samples.ndim == 2:
        samples = np.broadcast_to(samples, (3, *samples.shape))
    if picture.to_rec709 is not None:
        notes.append("chromaticities of the file are not Rec.709; samples are taken as they are")
    if samples.dtype == np.uint8 and not keep_codes:
        notes.append("8-bit picture: decoded from sRGB; 16-bit linear files are more exact")
        samples = np.round(_srgb_table(255) * 65535).astype(np.uint16)[samples]
    white = 1.0
    if np.issubdtype(samples.dtype, np.integer):
        white = float(np.iinfo(samples.dtype).max)
    else:
        bad = int(samples.size - np.count_nonzero(np.isfinite(samples)))
        notes.extend([f"{bad} samples are NaN or infinite"] if bad else [])
    return Capture(
        samples=samples,
        cfa=None,
        black_level=np.zeros(3, dtype=np.float32),
        white_level=white,
        orientation=picture.orientation,
        camera=picture.metadata.camera,
        metadata=picture.metadata,
        notes=tuple(notes),
    )


def read_mosaic(path: Path, options: MosaicOptions) -> Capture:
    """Read a headerless Bayer mosaic from a single-channel PNG or TIFF.

    Raises:
        DecodeError: If the file is damaged, a JPEG, has several channels, or contradicts the
            options.
        OSError: If it cannot be read.
    """
    if _begins(path, _JPEG_MAGIC):
        raise DecodeError(
            f"{path.name} is a JPEG, which no mosaic is: tones are coded and noise is lost; give "
            "RAW files, or a PNG or TIFF of the sensor's own samples"
        )
    picture = _decode(path)
    samples = picture.samples
    if samples.ndim != 2 or samples.dtype not in (np.uint8, np.uint16):
        raise DecodeError(
            f"a headerless mosaic must have one 8- or 16-bit channel; got {samples.dtype} "
            f"{samples.shape}; omit the mosaic options for an RGB picture"
        )
    if options.black_level is None or options.white_level is None:
        raise DecodeError(f"levels alone are for RAW files; {mosaic_advice()}")
    levels = raw_checks.Levels(
        black=np.full((2, 2), options.black_level, dtype=np.float32), white=options.white_level
    )
    raw_checks.check_levels(levels, int(np.iinfo(samples.dtype).max))
    check_said_white(samples, levels.white)
    return Capture(
        samples=samples,
        cfa=options.cfa,
        black_level=levels.black,
        white_level=levels.white,
        orientation=picture.orientation,
        camera=picture.metadata.camera,
        metadata=picture.metadata,
        notes=("headerless mosaic: pattern and levels as given",),
    )


def read_scene(path: Path) -> FloatArray:
    """Read a sharp scene for the simulation.

    8- and 16-bit files are sRGB, float files (EXR, HDR, float TIFF) are linear.

    Returns:
        (3, h, w) float32 linear Rec.709.

    Raises:
        DecodeError: If the file is missing, damaged, or holds NaN or infinite samples; names it.
    """
    try:
        picture = _decode(Path(path))
    except OSError as error:
        raise DecodeError(f"cannot read {path}: {error.strerror or error}") from error
    except DecodeError as error:
        raise DecodeError(f"{path}: {error}") from error
    samples = picture.samples
    if np.issubdtype(samples.dtype, np.integer):
        samples = _srgb_table(int(np.iinfo(samples.dtype).max))[samples]
    linear = np.asarray(samples, dtype=np.float32)
    bad = int(linear.size - np.count_nonzero(np.isfinite(linear)))
    if bad:
        raise DecodeError(f"{path}: {bad} samples are NaN or infinite; a scene must be finite")
    planes = np.stack([linear] * 3) if linear.ndim == 2 else np.ascontiguousarray(linear)
    return planes if picture.to_rec709 is None else apply_matrix(picture.to_rec709, planes)


def read_light(path: Path) -> FloatArray:
    """Read a sharp scene whose faint negative samples are taken as dark.

    Noise and colours outside Rec.709 leave samples a little below 0 in linear files. What lies
    deeper than `FAINT` of the brightest sample is no such thing and stays, for others to refuse.

    Returns:
        (3, h, w) float32 linear Rec.709.

    Raises:
        DecodeError: As `read_scene`.
    """
    scene = read_scene(path)
    if scene.min() >= -FAINT * scene.max():
        np.maximum(scene, 0, out=scene)
    return scene


def read_orientation(path: Path) -> int:
    """Give the EXIF orientation 1..8 that a file states, 1 where it states none.

    Raises:
        OSError: If it cannot be read.
    """
    if _begins(path, EXR_MAGIC):
        return 1
    tags = read_tiff_tags(path)
    return orientation_of(tags if tags.directories else exif_of_picture(path.read_bytes()))


def mosaic_advice() -> str:
    """Return what to say of a picture that may be a headerless mosaic."""
    return (
        f"if it is a Bayer mosaic, say {option_text('cfa', 'RGGB')} with "
        f"{option_text('black_level')} and {option_text('white_level')} (RGGB, BGGR, GRBG or GBRG "
        "at the top-left pixel)"
    )


def _counts_advice() -> str:
    return f"if it counts single photons, say {option_text('product', 'intensity')}, or depth"


def _srgb_table(top: int) -> FloatArray:
    """Give the linear value of every sRGB code 0..top."""
    return decode_srgb((np.arange(top + 1) / top).astype(np.float32))


def _begins(path: Path, magic: bytes) -> bool:
    with path.open("rb") as file:
        return file.read(len(magic)) == magic


def _decode(path: Path) -> _Picture:
    if _begins(path, EXR_MAGIC):
        return _decode_exr(path)
    tags = read_tiff_tags(path)
    raw_checks.check_chunks_inside(tags)
    mapped = map_plain_tiff(path)
    if mapped is not None:
        planes = mapped if mapped.ndim == 2 else np.moveaxis(mapped, -1, 0)
        return _with_exif(_Picture(samples=planes, to_rec709=None, notes=()), tags)
    data = path.read_bytes()
    if data.startswith(radiance.MAGIC):
        radiance.check_header(data)
    picture = _decode_by_opencv(data)
    if not tags.directories:
        return _with_exif(picture, exif_of_picture(data))
    # OpenCV turns a TIFF upright, whatever it is asked for
    stored = turn_back(picture.samples, orientation_of(tags))
    return _with_exif(replace(picture, samples=np.ascontiguousarray(stored)), tags)


def _with_exif(picture: _Picture, tags: TiffTags) -> _Picture:
    return replace(picture, orientation=orientation_of(tags), metadata=metadata_of(tags))


def _decode_by_opencv(data: bytes) -> _Picture:
    # libjpeg fills what is missing with grey and only warns
    if data.startswith(_JPEG_MAGIC) and b"\xff\xd9" not in data[-65536:]:
        raise DecodeError("the JPEG has no end marker: it is cut off, copy it again")
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        decoded = (
            cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
        )
    except cv2.error as error:
        raise DecodeError(f"the picture cannot be decoded: {error.err or error}") from error
    finally:
        cv2.utils.logging.setLogLevel(level)
    if decoded is None:
        raise DecodeError(
            "the picture is damaged or of an unknown kind; expected EXR, PNG, TIFF, JPEG or HDR"
        )
    if decoded.dtype not in (np.uint8, np.uint16, np.float32):
        raise DecodeError(f"samples must be 8-bit, 16-bit or float32; got {decoded.dtype}")
    return _planes(np.asarray(decoded))


def _planes(decoded: NDArray[Any]) -> _Picture:
    """Turn OpenCV's (h, w, BGR[A]) into planes R, G, B; alpha is dropped with a note."""
    if decoded.ndim == 2:
        return _Picture(samples=decoded, to_rec709=None, notes=())
    channels = decoded.shape[2]
    if channels not in (3, 4):
        raise DecodeError(f"expected 1, 3 or 4 channels; got {channels}")
    planes = np.ascontiguousarray(decoded[..., 2::-1].transpose(2, 0, 1))
    notes = ("alpha channel dropped",) if channels == 4 else ()
    return _Picture(samples=planes, to_rec709=None, notes=notes)


def _decode_exr(path: Path) -> _Picture:
    """Read R, G, B, or a single Y, of the first part."""
    import OpenEXR

    # the package raises these three, depending on where the damage lies
    damaged = (RuntimeError, ValueError, TypeError)
    with _exr_lock, contextlib.redirect_stdout(sys.stderr):
        try:
            with OpenEXR.File(str(path), header_only=True) as file:
                header = dict(file.header())  # the file empties its own on closing
            (x0, y0), (x1, y1) = (np.asarray(corner).tolist() for corner in header["dataWindow"])
            _check_exr_size(y1 - y0 + 1, x1 - x0 + 1, path.stat().st_size)
            names = {channel.name for channel in header["channels"]}
            wanted = next((w for w in ("RGB", "Y") if names.issuperset(w)), "")
            if not wanted or {"RY", "BY"} & names:
                raise DecodeError(f"expected EXR channels R, G, B or Y; got {sorted(names)}")
            with OpenEXR.File(str(path), separate_channels=True) as file:
                channels = file.channels()
                planes = [np.asarray(channels[name].pixels) for name in wanted]
        except (*damaged, KeyError) as error:
            raise DecodeError(f"the EXR is damaged: {error}") from error
    if any(plane.shape != (y1 - y0 + 1, x1 - x0 + 1) for plane in planes):
        raise DecodeError(f"EXR channels differ in size: {[plane.shape for plane in planes]}")
    samples = np.stack(planes).astype(np.float32)
    return _Picture(
        samples=samples if wanted == "RGB" else samples[0],
        to_rec709=_to_rec709(header.get("chromaticities")),
        notes=("alpha channel dropped",) if "A" in names else (),
        metadata=metadata_of_exr(header),
    )


def _check_exr_size(height: int, width: int, file_bytes: int) -> None:
    most = min(raw_checks.MAX_PIXELS, file_bytes * MAX_EXR_PIXELS_PER_BYTE)
    if height < 1 or width < 1 or height * width > most:
        raise DecodeError(f"the header claims {width}x{height} pixels in {file_bytes} bytes")


def _to_rec709(chromaticities: Any) -> Matrix | None:
    """Give the matrix from the file's primaries to Rec.709; None if they are Rec.709."""
    if chromaticities is None:
        return None
    values = np.asarray(chromaticities, dtype=np.float64).ravel()
    expected = np.array([*np.ravel(REC709_PRIMARIES), *D65])
    # Primaries may be imaginary (the blue of ACES 2065-1 has y < 0); the white may not.
    ys = values[1::2]
    if values.shape != (8,) or not (np.isfinite(values).all() and ys.all() and ys[-1] > 0):
        raise DecodeError(f"EXR chromaticities are not believable: {values.tolist()}")
    if np.abs(values - expected).max() <= _CHROMATICITY_TOLERANCE:
        return None
    pairs = [(float(x), float(y)) for x, y in values.reshape(4, 2)]
    try:
        to_xyz = adapt_white(pairs[3], D65) @ rgb_to_xyz(tuple(pairs[:3]), pairs[3])
    except np.linalg.LinAlgError as error:
        raise DecodeError(f"EXR chromaticities are not believable: {values.tolist()}") from error
    return np.asarray(np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65)) @ to_xyz)
