"""SDT of Becker & Hickl: a histogram of every pixel, plain or in a zip."""

import struct
import tempfile
from pathlib import Path
from typing import Final

import numpy as np

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError, UnsupportedError
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.counts_file import ARRIVALS, EXTRA, CountsFile, Hints
from camkit.runtime.kinds.spad.files.packed import PIECE, member_bytes, opened_zip

BROKEN: Final = (
    *(ValueError, TypeError, KeyError, IndexError, OverflowError, OSError, EOFError, MemoryError),
    *(NotImplementedError, AssertionError, UnicodeDecodeError, AttributeError, struct.error),
)
"""What sdtfile raises of files that are damaged."""
PS_PER_S: Final = 1e12


def open_sdt(path: Path, hints: Hints) -> CountsFile:
    """Open an SDT file; see `open_counts`."""
    return _open_plain(path, path, hints)


def open_sdt_zip(path: Path, hints: Hints) -> CountsFile:
    """Open a zip that holds one SDT file; see `open_counts`."""
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "unpacked.sdt"
        with opened_zip(path) as archive:
            members = [i for i in archive.infolist() if i.filename.lower().endswith(".sdt")]
            if len(members) != 1:
                named = ", ".join(i.filename for i in members) or "none"
                raise DecodeError(f"{path.name} must hold one .sdt file; it holds {named}")
            data = member_bytes(archive, members[0], hints.max_bytes)
            with plain.open("wb") as file:
                for start in range(0, members[0].file_size, PIECE):
                    end = min(start + PIECE, members[0].file_size)
                    file.write(data[start:end])
        return _open_plain(path, plain, hints)


def _open_plain(path: Path, plain: Path, hints: Hints) -> CountsFile:
    try:
        import sdtfile
    except ImportError as error:
        raise UnsupportedError(f"reading {path.name} needs sdtfile: {EXTRA}") from error
    try:
        # a file that it opened itself it would leave open where it fails
        with plain.open("rb") as handle:
            file = sdtfile.SdtFile(handle)
            blocks, times = list(file.data), list(file.times)
    except BROKEN as error:
        raise DecodeError(f"{path.name} is damaged, or no SDT: {error}") from error
    number = _block(path, len(blocks), hints)
    values, seconds = np.asarray(blocks[number]), np.asarray(times[number], dtype=np.float64)
    if values.ndim == 1:
        values = values[None]
    if values.ndim == 2:
        values = values[None]
    if len(seconds) < 2 or len(seconds) != values.shape[-1]:
        raise DecodeError(f"{path.name}: {len(seconds)} times for {values.shape[-1]} bins")
    width_ps = float((seconds[-1] - seconds[0]) / (len(seconds) - 1) * PS_PER_S)
    return ArrayFile(
        path,
        values,
        hints,
        kind="histogram",
        usual="yxt",
        stated={"time_bin_ps": width_ps},
        assumed=ARRIVALS,
    )


def _block(path: Path, count: int, hints: Hints) -> int:
    known = [f"block {number}" for number in range(count)]
    if not known:
        raise DecodeError(f"{path.name} holds no histograms")
    if hints.key is None and count == 1:
        return 0
    if hints.key not in known:
        raise ContractError(
            f"{path.name} holds {', '.join(known)}; say which by [array] key in a file for "
            f"{option_text('timing')}"
        )
    return known.index(hints.key)
