"""The decoding child, and the one module that touches rawpy.

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
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import CfaPattern, NoiseModel
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import MAX_ISO, Capture, MosaicOptions
from camkit.runtime.files import dng_checks, raw_checks, raw_tags
from camkit.runtime.files.doubts import find_doubts
from camkit.runtime.files.lone_pixels import count_lone
from camkit.runtime.files.raw_metadata import raw_metadata
from camkit.runtime.files.tiff_tags import TiffTags, read_tiff_tags
from camkit.runtime.files.white_level import believable_white, check_said_white
from camkit.runtime.machine.memory import peak_rss_mb
from camkit.runtime.metadata import Metadata

# LibRaw's flip has three bits (1 mirror columns, 2 mirror rows, 4 transpose); EXIF counts 1..8
FLIP_TO_EXIF: Final = {0: 1, 1: 2, 2: 4, 3: 3, 4: 5, 5: 8, 6: 6, 7: 7}
WRITE_ROWS: Final = 256
PR_SET_PDEATHSIG: Final = 1
BELIEVABLE_GAIN_STOPS: Final = 6.0
MASKED_RIM_PX: Final = 2
NOTHING_SAID: Final = MosaicOptions()
LONE_NOTE_SHARE: Final = 2e-5


def decode_raw(path: Path, said: MosaicOptions = NOTHING_SAID) -> Capture:
    """Decode a RAW or DNG file with LibRaw in this process.

    Args:
        path: The file.
        said: Levels that the caller says in place of the file's.

    Returns:
        The visible area in sensor orientation. Planes of a monochrome sensor are one plane seen
        three times.

    Raises:
        DecodeError: If LibRaw refuses the file or its answer is not believable.
        OSError: If the file cannot be read.
    """
    with _decoded(path, said) as capture:
        samples = capture.samples
        if _is_repeated(samples):
            return replace(capture, samples=np.broadcast_to(samples[0].copy(), samples.shape))
        return replace(capture, samples=np.array(samples, order="C"))


@contextmanager
def _decoded(path: Path, said: MosaicOptions) -> Iterator[Capture]:
    """Give a capture whose samples lie in LibRaw's memory, which ends with the block."""
    import rawpy

    tags = read_tiff_tags(path)
    raw_checks.check_chunks_inside(tags)
    try:
        with _named_in_utf8(path) as name, rawpy.imread(name) as raw:
            yield _to_capture(raw, tags, said)
    except (rawpy.LibRawError, rawpy.NotSupportedError) as error:
        text = error.args[0].decode() if error.args and isinstance(error.args[0], bytes) else error
        raise DecodeError(f"LibRaw cannot decode the file: {text}") from error
    except (ContractError, ValueError, TypeError, LookupError, OverflowError) as error:
        raise DecodeError(f"LibRaw's answer makes no sense: {error}") from error
    except MemoryError as error:
        raise DecodeError("decoding needs more memory than allowed; raise max_memory_mb") from error


@contextmanager
def _named_in_utf8(path: Path) -> Iterator[str]:
    """Give a name that rawpy takes: that of an open file where the path is no UTF-8."""
    try:
        path.as_posix().encode()
    except UnicodeEncodeError:
        with path.open("rb") as file:
            yield f"/dev/fd/{file.fileno()}"
    else:
        yield str(path)


def _to_capture(raw: Any, tags: TiffTags, said: MosaicOptions) -> Capture:
    sizes = raw.sizes
    raw_checks.check_size(sizes.height, sizes.width, tags.file_bytes)
    raw_checks.check_size(sizes.raw_height, sizes.raw_width, tags.file_bytes)
    notes: list[str] = []
    if abs(sizes.pixel_aspect - 1) > 0.01:
        notes.append(f"pixels are not square (aspect {sizes.pixel_aspect:.3f}); shape kept")
    if dng_checks.is_float(tags):
        notes.append("floating-point DNG: LibRaw rescales it to 14-bit integers")
    cfa = _cfa(raw)
    # black levels are read before any postprocess, which subtracts and overwrites them
    levels = _levels(raw, cfa, said)
    raw_checks.check_levels(levels)
    dng_checks.check_dng(tags, cfa, levels, said.levels)
    notes += dng_checks.find_doubts(tags)
    samples, levels = _samples(raw, cfa, levels, notes, said)
    if said.white_level is None:
        levels, note = believable_white(samples, levels, cfa, raw_tags.sample_bits(tags))
        notes += [note] if note else []
    else:
        check_said_white(samples, levels.white)
    raw_checks.check_content(samples, levels)
    _note_lone(samples, levels, cfa, notes)
    notes += find_doubts(samples, levels, cfa, _masked(raw))
    place = raw_tags.sensor_place(tags)
    metadata = raw_metadata(raw, tags)
    return Capture(
        samples=samples,
        cfa=cfa,
        black_level=levels.black,
        white_level=levels.white,
        white_balance=_white_balance(raw, tags, notes),
        color_matrix=_color_matrix(raw, tags, notes),
        orientation=FLIP_TO_EXIF.get(sizes.flip, 1),
        iso=_believable_iso(metadata.iso),
        exposure_time_s=metadata.exposure_time_s,
        noise=raw_tags.noise_profile(tags, cfa),
        origin_px=place.origin_px,
        sensor_size_px=place.sensor_size_px,
        pixel_pitch_um=place.pixel_pitch_um,
        bundle_name=place.bundle_name,
        camera=raw_tags.camera_name(tags, metadata),
        metadata=metadata,
        notes=tuple(notes),
    )


def _cfa(raw: Any) -> CfaPattern | None:
    """Give the 2x2 cell at the first visible pixel; None if the file is no 2x2 mosaic."""
    import rawpy

    pattern = raw.raw_pattern
    if raw.raw_type != rawpy.RawType.Flat or pattern is None or pattern.shape != (2, 2):
        return None
    top, left = raw.sizes.top_margin, raw.sizes.left_margin
    names = raw.color_desc.decode("ascii", errors="replace")
    cell = [raw.raw_color(top + dy, left + dx) for dy in (0, 1) for dx in (0, 1)]
    return raw_checks.check_pattern("".join(names[index] for index in cell))


def _black_level(raw: Any, cfa: CfaPattern | None) -> NDArray[np.float32]:
    """Reorder LibRaw's black levels, which go by colour index, to positions in the cell."""
    by_color = np.array(raw.black_level_per_channel, dtype=np.float32)
    if cfa is None:
        return by_color[:3]
    top, left = raw.sizes.top_margin, raw.sizes.left_margin
    cell = [[raw.raw_color(top + dy, left + dx) for dx in (0, 1)] for dy in (0, 1)]
    return np.asarray(by_color[np.array(cell)])


def _levels(raw: Any, cfa: CfaPattern | None, said: MosaicOptions) -> raw_checks.Levels:
    """Give the levels of the file where the caller says no others."""
    black, white = _black_level(raw, cfa), float(raw.white_level)
    if said.black_level is not None:
        black = np.full_like(black, said.black_level)
    return raw_checks.Levels(
        black=black, white=white if said.white_level is None else said.white_level
    )


def _masked(raw: Any) -> list[NDArray[Any]]:
    """Give the areas left of and above the picture, which see no light; not their rims."""
    import rawpy

    if raw.raw_type != rawpy.RawType.Flat:
        return []
    top, left, whole = raw.sizes.top_margin, raw.sizes.left_margin, raw.raw_image
    rim = MASKED_RIM_PX
    return [whole[top:, rim : max(left - rim, rim)], whole[rim : max(top - rim, rim)]]


def _samples(
    raw: Any,
    cfa: CfaPattern | None,
    levels: raw_checks.Levels,
    notes: list[str],
    said: MosaicOptions,
) -> tuple[NDArray[Any], raw_checks.Levels]:
    """Give the samples, as far as possible in LibRaw's own memory, and their levels."""
    import rawpy

    stacked = raw.raw_type == rawpy.RawType.Stack
    if cfa is not None:
        return raw.raw_image_visible, levels
    if stacked and raw.num_colors == 3:
        notes.append("linear RGB file: already demosaicked, taken as it is")
        return np.moveaxis(raw.raw_image_visible[..., :3], -1, 0), levels
    if not stacked and raw.num_colors == 1:
        notes.append("monochrome sensor: one plane stands for all three colours")
        plane = raw.raw_image_visible
        return np.broadcast_to(plane, (3, *plane.shape)), levels
    return develop_linear(raw, notes, said)


def develop_linear(
    raw: Any, notes: list[str], said: MosaicOptions = NOTHING_SAID
) -> tuple[NDArray[Any], raw_checks.Levels]:
    """Let LibRaw demosaic what is no Bayer mosaic (X-Trans, sRAW, four colours).

    Returns:
        (3, h, w) uint16 in camera space without white balance, and black 0, white 65535.
    """
    import rawpy

    picture = raw.postprocess(
        output_color=rawpy.ColorSpace.raw,
        gamma=(1, 1),
        output_bps=16,
        no_auto_bright=True,
        adjust_maximum_thr=0.0,
        user_wb=[1.0, 1.0, 1.0, 1.0],
        user_flip=0,
        user_black=None if said.black_level is None else round(said.black_level),
        user_sat=None if said.white_level is None else round(said.white_level),
    )
    notes.append(
        "not a Bayer mosaic: decoded by LibRaw's own demosaic (values below black are cut)"
    )
    black = np.zeros(3, dtype=np.float32)
    return np.moveaxis(picture, -1, 0), raw_checks.Levels(black=black, white=65535.0)


def _note_lone(
    samples: NDArray[Any], levels: raw_checks.Levels, cfa: CfaPattern | None, notes: list[str]
) -> None:
    planes, cell = ([samples], 2) if cfa is not None else (list(samples), 1)
    count = sum(count_lone(plane, levels, cell) for plane in planes)
    share = count / samples.size
    if share >= LONE_NOTE_SHARE:
        notes.append(f"{count} pixels ({share:.4%}) stand out alone: hot pixels or damage")


def _white_balance(raw: Any, tags: TiffTags, notes: list[str]) -> tuple[float, float, float] | None:
    red, green, blue, *_ = (float(gain) for gain in raw.camera_whitebalance)
    if green > 0 and not (dng_checks.is_dng(tags) and not dng_checks.states_white_balance(tags)):
        gains = np.array([red / green, 1.0, blue / green])
        stops = np.abs(np.log2(np.maximum(gains, 1e-9)))
        if (stops < BELIEVABLE_GAIN_STOPS).all():
            return float(gains[0]), 1.0, float(gains[2])
    notes.append("the file has no valid white balance")
    return None


def _color_matrix(raw: Any, tags: TiffTags, notes: list[str]) -> NDArray[np.float64] | None:
    """Give XYZ (D65) to camera, from the DNG tags or else from LibRaw's table of cameras."""
    stated = raw_tags.color_matrix(tags)
    if stated is not None:
        matrix, note = stated
        notes.extend([note] if note else [])
        return matrix
    table = np.array(raw.rgb_xyz_matrix, dtype=np.float64)[:3]
    if np.isfinite(table).all() and abs(np.linalg.det(table)) > 1e-9:
        return table
    notes.append("no colour matrix is known for this camera")
    return None


def _believable_iso(iso: float | None) -> float | None:
    return iso if iso is not None and iso <= MAX_ISO else None


def header_of(capture: Capture) -> dict[str, Any]:
    """Give everything but the samples as plain JSON values."""
    header: dict[str, Any] = {
        f.name: getattr(capture, f.name) for f in fields(capture) if f.name != "samples"
    }
    header["black_level"] = capture.black_level.tolist()
    if capture.color_matrix is not None:
        header["color_matrix"] = capture.color_matrix.tolist()
    if capture.noise is not None:
        header["noise"] = [capture.noise.shot, capture.noise.read_variance]
    header["metadata"] = asdict(capture.metadata)
    header["dtype"] = capture.samples.dtype.name
    header["shape"] = capture.samples.shape
    header["planes_sent"] = 1 if _is_repeated(capture.samples) else None
    return header


def capture_of(header: dict[str, Any], samples: NDArray[Any]) -> Capture:
    """Rebuild a capture from `header_of` and its samples.

    Raises:
        ContractError, KeyError, TypeError, ValueError: If the header is not of `header_of`.
    """
    values = {f.name: header[f.name] for f in fields(Capture) if f.name != "samples"}
    values["black_level"] = np.array(values["black_level"], dtype=np.float32)
    for name in ("white_balance", "origin_px", "sensor_size_px", "notes"):
        values[name] = None if values[name] is None else tuple(values[name])
    if values["color_matrix"] is not None:
        values["color_matrix"] = np.array(values["color_matrix"], dtype=np.float64)
    if values["noise"] is not None:
        shot, read_variance = (tuple(part) for part in values["noise"])
        values["noise"] = NoiseModel(shot=shot, read_variance=read_variance)
    values["metadata"] = Metadata(**values["metadata"])
    return Capture(samples=samples, **values)


def _is_repeated(samples: NDArray[Any]) -> bool:
    return samples.ndim == 3 and samples.strides[0] == 0


def _send(capture: Capture, out: BinaryIO) -> None:
    header = header_of(capture) | {"decoder_peak_mb": peak_rss_mb()}
    out.write(json.dumps(header).encode() + b"\n")
    samples = capture.samples
    planes = (
        [samples] if samples.ndim == 2 else list(samples[: 1 if _is_repeated(samples) else None])
    )
    for plane in planes:
        for top in range(0, plane.shape[0], WRITE_ROWS):
            out.write(np.ascontiguousarray(plane[top : top + WRITE_ROWS]).data)
    out.flush()


def _limit_memory(max_memory_mb: int) -> None:
    """Cap the address space where the system can (not on Windows)."""
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
    """End this process when its parent does, where the system can tell it (Linux)."""
    if sys.platform != "linux":
        return
    import ctypes

    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL))
    if os.getppid() != parent:  # it ended before the system was asked
        os._exit(1)


def _awaited(parent: str) -> list[str]:
    """Give the arguments that come once the parent knows them; none if it ends before."""
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
    said = MosaicOptions(black_level=black, white_level=white)
    end_with(int(arguments[2]))
    # LibRaw may print: keep the pipe to ourselves and send strays to stderr
    with os.fdopen(os.dup(1), "wb", buffering=1 << 20) as out:
        os.dup2(2, 1)
        _limit_memory(max_memory_mb)
        try:
            with _decoded(path, said) as capture:
                _send(capture, out)
        except BrokenPipeError:
            return 1  # the parent is gone or gave up
        except (DecodeError, OSError) as error:
            out.write(json.dumps({"error": str(error)}).encode() + b"\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
