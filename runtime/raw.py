"""Read a capture from a file: RAW and DNG in a child process, pictures here.

    read_capture -> PNG, TIFF, EXR by content        -> camkit.runtime.files.picture
                 -> everything else, as RAW or DNG   -> child: camkit.runtime.raw_worker

The child is a plain subprocess: a fork of a process with threads hangs in LibRaw's OpenMP, and
multiprocessing's spawn would run the caller's main script again.
"""

import hashlib
import json
import logging
import math
import os
import re
import subprocess
import threading
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.regular_file import check_regular
from camkit.runtime.cancel import current_wish, watched
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files import raw_checks
from camkit.runtime.files.capture_header import capture_of
from camkit.runtime.files.decoder import decoder_of
from camkit.runtime.files.formats import foreign
from camkit.runtime.files.in_memory import Source, stored
from camkit.runtime.files.raw_tags import sensor_place
from camkit.runtime.files.tiff_tags import read_tiff_tags
from camkit.runtime.signal.tone_curve import PictureReading, Tone

__all__ = ["Capture", "MosaicOptions", "file_sha256", "is_picture", "named_bundle", "read_capture"]

logger = logging.getLogger(__name__)

DEFAULT_TIMEOUT_S: Final = 60.0
DEFAULT_MAX_MEMORY_MB: Final = 4096
MAX_HEADER_BYTES: Final = 1 << 20
PIPE_BYTES: Final = 1 << 20
_SET_PIPE_SIZE: Final = 1031  # F_SETPIPE_SZ of Linux; other systems keep their own size
EXR_MAGIC: Final = b"\x76\x2f\x31\x01"
_PICTURE_MAGIC: Final = (b"\x89PNG\r\n\x1a\n", EXR_MAGIC, b"#?RADIANCE", b"#?RGBE")
_PICTURE_SUFFIXES: Final = frozenset(
    {".jpg", ".jpeg", ".jpe", ".jfif", ".mpo", ".hdr", ".png", ".exr", ".bmp"}
)
_TIFF_SUFFIXES: Final = frozenset({".tif", ".tiff"})
_DNG_VERSION: Final = 50706
_CFA_PHOTOMETRIC: Final = 32803
_DAMAGE: Final = re.compile(r"corrupt|premature end|unexpected end", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Limits:
    """Limits of the child."""

    timeout_s: float
    max_memory_mb: int


def read_capture(
    path: Source,
    *,
    isolate: bool = True,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    max_memory_mb: int = DEFAULT_MAX_MEMORY_MB,
    mosaic: MosaicOptions | None = None,
    keep_codes: bool = False,
    tone: Tone | None = None,
    is_grey: bool = False,
) -> Capture:
    """Read a RAW, DNG, EXR, TIFF or PNG file as a capture in sensor orientation.

    Args:
        path: The file: a path, bytes, or a file opened in binary mode.
        isolate: Decode RAW in a child process; False for those who embed and accept that a crash
            in LibRaw is a crash of theirs (time and memory limits then do not apply).
        timeout_s: Time limit of the child.
        max_memory_mb: Address-space limit of the child (where the system has one).
        mosaic: What a headerless single-channel picture does not say of itself, or the levels of a
            RAW file where its own are wrong.
        keep_codes: Leave 8-bit pictures coded as they are, white at 255.
        tone: How the codes of a developed picture become light; None for what the file states.
        is_grey: Whether the camera has one channel: grey pictures keep theirs.

    Raises:
        DecodeError: If the file is missing, damaged, or not believable.
        ContractError: If a pattern or a tone curve is given for a RAW file, which says it itself,
            or levels alone for a picture.
    """
    limits = _Limits(timeout_s=timeout_s, max_memory_mb=max_memory_mb)
    if not (math.isfinite(timeout_s) and timeout_s > 0 and max_memory_mb > 0):
        raise ContractError(f"limits must be > 0; got {timeout_s} s, {max_memory_mb} MB")
    reading = PictureReading(keep_codes=keep_codes, tone=tone, is_grey=is_grey)
    with stored(path) as file:
        return _read(file, limits if isolate else None, mosaic, reading)


def _read(
    file: Path, limits: _Limits | None, mosaic: MosaicOptions | None, reading: PictureReading
) -> Capture:
    """Read a file, RAW in a child within its limits; None decodes it here."""
    try:
        check_regular(file)
        head = _head(file)
        if not head:
            raise DecodeError("the file is empty")  # noqa: TRY301
        foreign.check_not_foreign(head)
        if is_picture(file):
            capture = _read_picture(file, mosaic, reading)
            return replace(capture, sha256=file_sha256(file))
        foreign.check_no_jpeg(head)
        _check_no_tone(file, reading)
        if mosaic is not None and mosaic.cfa is not None:
            raise ContractError(
                f"a pattern is for headerless PNG or TIFF; {file.name} has its own, omit "
                f"{option_text('cfa')}"
            )
        options = mosaic or MosaicOptions()
        if limits is not None:
            return _read_isolated(file, limits, options)
        # imported late: what decodes is otherwise the child's
        from camkit.runtime.raw_worker import decode_raw

        return replace(decode_raw(file, options), sha256=file_sha256(file))
    except OSError as error:
        raise DecodeError(f"cannot read {file}: {error.strerror or error}") from error
    except DecodeError as error:
        raise DecodeError(f"{file.name}: {error}") from error


def is_picture(path: Path) -> bool:
    """Return whether a file is a picture, no RAW file: by its content, then by its name.

    Raises:
        OSError: If the file cannot be read.
    """
    head, suffix = _head(path), path.suffix.lower()
    if any(head.startswith(magic) for magic in _PICTURE_MAGIC) or suffix in _PICTURE_SUFFIXES:
        return True
    if suffix not in _TIFF_SUFFIXES:
        return False
    tags = read_tiff_tags(path)
    sensor = (tags.numbers(262) or (0,))[0] == _CFA_PHOTOMETRIC
    return not sensor and not any(_DNG_VERSION in d for d in tags.directories)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(foreign.HEAD_BYTES)


def named_bundle(path: str | os.PathLike[str]) -> str | None:
    """Return the name of the bundle that a capture made by camkit names; None for other files.

    Reads the tags only, so a long list of files can be planned before any is decoded.
    """
    try:
        file = Path(path)
        check_regular(file)
        if not _head(file).startswith(EXR_MAGIC):
            return sensor_place(read_tiff_tags(file)).bundle_name
        from camkit.runtime.files.formats.exr_picture import read_exr_place

        return read_exr_place(file).bundle_name
    except (OSError, DecodeError):
        return None  # reading the capture tells what is wrong with the file


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_no_tone(path: Path, reading: PictureReading) -> None:
    if reading.tone is not None:
        raise ContractError(
            f"{path.name} holds the sensor's own light, not codes of a developed picture; leave "
            f"{option_text('tone')} out"
        )


def _read_picture(path: Path, mosaic: MosaicOptions | None, reading: PictureReading) -> Capture:
    from camkit.runtime.files.picture import read_mosaic, read_picture

    if mosaic is None:
        return read_picture(path, reading)
    if mosaic.cfa is None:
        raise ContractError(
            f"{path.name} is a picture, levels are for RAW files; add {option_text('cfa')} too if "
            "it is a headerless mosaic"
        )
    _check_no_tone(path, reading)
    return read_mosaic(path, mosaic)


def _read_isolated(path: Path, limits: _Limits, options: MosaicOptions) -> Capture:
    """Decode in a child; the hash is computed here while it works."""
    order = [
        str(path.resolve()),
        str(limits.max_memory_mb),
        str(os.getpid()),
        json.dumps([options.black_level, options.white_level]),
    ]
    with decoder_of(order) as decoder:
        child = decoder.child
        expired = threading.Event()
        timer = threading.Timer(limits.timeout_s, _expire, (child, expired))
        timer.start()
        try:
            with watched(current_wish(), child.kill):
                sha256 = file_sha256(path)
                capture = _receive(child)
                if capture is not None and child.wait() == 0:
                    notes = (*capture.notes, *_complaint(decoder.complaints))
                    return replace(capture, sha256=sha256, notes=notes)
        finally:
            timer.cancel()
            child.kill()
        if expired.is_set():
            raise DecodeError(f"decoding took longer than {limits.timeout_s:g} s and was stopped")
        raise DecodeError(_death(child.wait(), decoder.complaints))


def _expire(child: subprocess.Popen[bytes], expired: threading.Event) -> None:
    expired.set()
    child.kill()


def _complaint(complaints: IO[bytes]) -> list[str]:
    """Return a note if LibRaw, or libjpeg in it, went on over damage with a word on stderr."""
    lines = [line for line in _last_lines(complaints) if _DAMAGE.search(line)]
    return [f"the decoder says {lines[-1][:120]!r}: the pixel data are damaged"] if lines else []


def _last_lines(complaints: IO[bytes]) -> list[str]:
    complaints.seek(max(0, complaints.seek(0, os.SEEK_END) - 4096))
    lines = complaints.read().decode(errors="replace").strip().splitlines()
    logger.debug("decoder stderr: %s", lines)
    return lines


def _death(code: int, complaints: IO[bytes]) -> str:
    lines = _last_lines(complaints)
    cause = f"signal {-code}" if code < 0 else f"exit code {code}"
    last = f" ({lines[-1][:200]})" if lines else ""
    return f"the decoder died with {cause}{last}; the file is damaged or LibRaw cannot handle it"


def _receive(child: subprocess.Popen[bytes]) -> Capture | None:
    """Read header and samples from the child; None if it broke off.

    Raises:
        DecodeError: If the child refused the file, or its answer makes no sense.
    """
    pipe = child.stdout
    if pipe is None:
        return None
    _widen(pipe)
    line = pipe.readline(MAX_HEADER_BYTES)
    if not line.endswith(b"\n"):
        return None
    try:
        header = json.loads(line)
        if "error" in header:
            raise DecodeError(str(header["error"]))
        samples = _receive_samples(pipe, header)
        return None if samples is None else capture_of(header, samples)
    except (ContractError, KeyError, TypeError, ValueError) as error:
        raise DecodeError(f"the decoder's answer makes no sense: {error}") from error


def _receive_samples(pipe: IO[bytes], header: dict[str, Any]) -> NDArray[Any] | None:
    """Read the samples; None if the pipe ends early."""
    shape = tuple(int(n) for n in header["shape"])
    dtype = np.dtype({"uint8": "u1", "uint16": "u2", "float32": "f4"}[header["dtype"]])
    if len(shape) not in (2, 3) or min(shape) < 1 or math.prod(shape) > 3 * raw_checks.MAX_PIXELS:
        raise DecodeError(f"the decoder's answer makes no sense: samples {shape}")
    repeated = header["planes_sent"] == 1
    samples = np.empty(shape[1:] if repeated else shape, dtype=dtype)
    view = samples.reshape(-1).view(np.uint8).data
    got = 0
    while got < len(view):
        count = pipe.readinto(view[got:])  # type: ignore[attr-defined]
        if not count:
            return None
        got += count
    return np.broadcast_to(samples, shape) if repeated else samples


def _widen(pipe: IO[bytes]) -> None:
    """Request a larger pipe, which saves thousands of switches between the two processes."""
    try:
        import fcntl

        fcntl.fcntl(pipe.fileno(), _SET_PIPE_SIZE, PIPE_BYTES)
    except (ImportError, OSError):
        logger.debug("pipe keeps its default size")
