"""The decoding child: a RAW file becomes a capture, by LibRaw or, of some DNGs, without it.

    python -P -m camkit.runtime.raw_worker PATH MAX_MEMORY_MB PARENT [BLACK, WHITE]
      -> stdout: one line of JSON, then the samples as plain bytes
    python -P -m camkit.runtime.raw_worker PARENT
      the same, once its arguments came as a line of JSON on stdin

Run as a process of its own so that a crash, a hang or an allocation storm in LibRaw costs one
file. Imports numpy and rawpy only, since its start is part of every photograph's time. The pixels
go through a pipe: both sides hold one copy, nothing has to be cleaned up after a crash, and 48 MB
take about 30 ms.
"""

import json
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files import raw_checks
from camkit.runtime.files.capture_header import header_of, is_repeated
from camkit.runtime.files.dng.jpeg_frames import frame_doubt
from camkit.runtime.files.dng.picture_tags import sensor_picture
from camkit.runtime.files.dng.readable import check_readable, is_plain
from camkit.runtime.files.libraw import NOTHING_SAID, decode_with_libraw
from camkit.runtime.files.plain_dng import plain_decode
from camkit.runtime.files.raw_decode import noted, to_capture
from camkit.runtime.files.tiff_tags import read_tiff_tags
from camkit.runtime.machine.memory import peak_rss_mb

WRITE_ROWS: Final = 256
PR_SET_PDEATHSIG: Final = 1


def decode_raw(path: Path, options: MosaicOptions = NOTHING_SAID) -> Capture:
    """Decode a RAW or DNG file in this process.

    Args:
        path: The file.
        options: Levels that the caller says in place of the file's.

    Returns:
        The visible area in sensor orientation. Planes of a monochrome sensor are one plane seen
        three times.

    Raises:
        DecodeError: If the file is refused or what was decoded is not believable.
        OSError: If the file cannot be read.
    """
    with _decoded(path, options) as capture:
        samples = capture.samples
        if is_repeated(samples):
            return replace(capture, samples=np.broadcast_to(samples[0].copy(), samples.shape))
        return replace(capture, samples=np.array(samples, order="C"))


@contextmanager
def _decoded(path: Path, options: MosaicOptions) -> Iterator[Capture]:
    """Yield a capture whose samples lie in LibRaw's memory, which ends with the block."""
    import rawpy

    tags = read_tiff_tags(path)
    raw_checks.check_chunks_inside(tags)
    try:
        picture = sensor_picture(tags)
        if picture is not None:
            check_readable(picture)
        if picture is not None and is_plain(picture):
            yield to_capture(plain_decode(path, tags, picture, options), tags, picture, options)
            return
        with _named_in_utf8(path) as name, rawpy.imread(name) as raw:
            decode = decode_with_libraw(raw, tags, picture, options)
            if picture is not None:
                decode = noted(decode, frame_doubt(path, picture))
            yield to_capture(decode, tags, picture, options)
    except (rawpy.LibRawError, rawpy.NotSupportedError) as error:
        text = error.args[0].decode() if error.args and isinstance(error.args[0], bytes) else error
        raise DecodeError(f"LibRaw cannot decode the file: {text}") from error
    except (ContractError, ValueError, TypeError, LookupError, OverflowError) as error:
        raise DecodeError(f"LibRaw's answer makes no sense: {error}") from error
    except MemoryError as error:
        raise DecodeError("decoding needs more memory than allowed; raise max_memory_mb") from error


@contextmanager
def _named_in_utf8(path: Path) -> Iterator[str]:
    """Yield a name that rawpy takes: that of an open file where the path is no UTF-8."""
    try:
        path.as_posix().encode()
    except UnicodeEncodeError:
        with path.open("rb") as file:
            yield f"/dev/fd/{file.fileno()}"
    else:
        yield str(path)


def _send(capture: Capture, out: BinaryIO) -> None:
    header = header_of(capture) | {"decoder_peak_mb": peak_rss_mb()}
    out.write(json.dumps(header).encode() + b"\n")
    samples = capture.samples
    planes = (
        [samples] if samples.ndim == 2 else list(samples[: 1 if is_repeated(samples) else None])
    )
    for plane in planes:
        for top in range(0, plane.shape[0], WRITE_ROWS):
            out.write(np.ascontiguousarray(plane[top : top + WRITE_ROWS]).data)
    out.flush()


def _limit_memory(max_memory_mb: int) -> None:
    """Limit the address space where the system can (not on Windows)."""
    try:
        import resource
    except ImportError:
        return
    limit = max_memory_mb << 20
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    if hard != resource.RLIM_INFINITY:
        limit = min(limit, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))


def end_with(parent: int) -> None:
    """Set this process to end when its parent does, where the system can tell it (Linux)."""
    if sys.platform != "linux":
        return
    import ctypes

    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL))
    if os.getppid() != parent:  # it ended before the system was asked
        os._exit(1)


def _awaited(parent: str) -> list[str]:
    """Return the arguments that come once the parent knows them; none if it ends before."""
    import rawpy  # noqa: F401 - what takes time is done while the parent is not ready

    end_with(int(parent))
    with sys.stdin.buffer as orders:
        line = orders.readline()
    return [str(word) for word in json.loads(line)] if line else []


def main(arguments: Sequence[str]) -> int:
    """Decode one file for the parent; every refusal becomes a line of JSON."""
    if len(arguments) == 1:
        arguments = _awaited(arguments[0])
        if not arguments:
            return 0
    path, max_memory_mb = Path(arguments[0]), int(arguments[1])
    black, white = json.loads(arguments[3])
    options = MosaicOptions(black_level=black, white_level=white)
    end_with(int(arguments[2]))
    # LibRaw may print: keep the pipe to ourselves and send strays to stderr
    with os.fdopen(os.dup(1), "wb", buffering=1 << 20) as out:
        os.dup2(2, 1)
        _limit_memory(max_memory_mb)
        try:
            with _decoded(path, options) as capture:
                _send(capture, out)
        except BrokenPipeError:
            return 1  # the parent is gone or gave up
        except (DecodeError, OSError) as error:
            out.write(json.dumps({"error": str(error)}).encode() + b"\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
