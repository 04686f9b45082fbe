"""SDT of Becker & Hickl: a histogram of every pixel, plain or in a zip."""

import io
import tempfile
import zipfile
from pathlib import Path
from typing import IO, Final

import numpy as np

from camkit.caller import option_text
from camkit.errors import CamkitError, ContractError, DecodeError, UnsupportedError
from camkit.runtime.kinds.spad.containers.broken import BROKEN
from camkit.runtime.kinds.spad.containers.packed import PIECE, member_bytes, opened_zip
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.channels import chosen_places
from camkit.runtime.kinds.spad.files.counts_file import ARRIVALS, EXTRA, CountsFile, Hints

PS_PER_S: Final = 1e12
NEW_BLOCKS: Final = 15
"""Revision from which on blocks may be longer than 4 GB."""
MANY_BLOCKS: Final = 0x7FFF
"""Number of blocks that says that it stands elsewhere."""
TIMES: Final = 2
"""Of max_bytes: such files are read whole."""


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
                names = ", ".join(i.filename for i in members) or "none"
                raise DecodeError(f"{path.name} must hold one .sdt file; it holds {names}")
            _check_total(path, members[0].file_size, TIMES * hints.max_bytes)
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
            _check_size(path, handle, TIMES * hints.max_bytes)
            file = sdtfile.SdtFile(handle)
            blocks, times = list(file.data), list(file.times)
    except CamkitError:
        raise
    except BROKEN as error:
        raise DecodeError(f"{path.name} is damaged, or no SDT: {error}") from error
    if not blocks:
        raise DecodeError(f"{path.name} holds 0 blocks of histograms; expected one at least")
    number = chosen_places(path, {"block": range(len(blocks))}, hints.key)["block"]
    values, seconds = np.asarray(blocks[number]), np.asarray(times[number], dtype=np.float64)
    if values.ndim == 1:
        values = values[None]
    if values.ndim == 2:
        values = values[None]
    if len(seconds) < 2 or len(seconds) != values.shape[-1]:
        raise DecodeError(
            f"{path.name}: {len(seconds)} times for {values.shape[-1]} bins; expected one for each "
            "bin, and two at least"
        )
    width_ps = float((seconds[-1] - seconds[0]) / (len(seconds) - 1) * PS_PER_S)
    return ArrayFile(
        path,
        values,
        hints,
        kind="histogram",
        usual="yxt",
        stated_times={"time_bin_ps": width_ps},
        assumed=ARRIVALS,
    )


def _check_size(path: Path, file: IO[bytes], most_bytes: int) -> None:
    """Refuse blocks that unpack to more than fits the memory: sdtfile reads all of them.

    Raises:
        ContractError: Says how much they take.
    """
    from sdtfile import sdtfile

    header = np.fromfile(file, np.dtype(sdtfile.FILE_HEADER), 1)[0]
    is_new = sdtfile.FileRevision(header["revision"]).revision >= NEW_BLOCKS
    record = np.dtype(sdtfile.BLOCK_HEADER if is_new else sdtfile.BLOCK_HEADER_OLD)
    count = int(header["no_of_data_blocks"])
    count = int(header["reserved1"]) if count == MANY_BLOCKS else count
    total, offset = 0, int(header["data_block_offs"])
    for _ in range(count):
        file.seek(offset)
        block = np.fromfile(file, record, 1)[0]
        start, offset = int(block["data_offs"]), int(block["next_block_offs"])
        total += int(block["block_length"])
        if sdtfile.BlockType(block["block_type"]).compress:
            file.seek(start)
            with zipfile.ZipFile(io.BytesIO(file.read(max(offset - start, 0)))) as packed:
                total += packed.filelist[0].file_size
        _check_total(path, total, most_bytes)
    file.seek(0)


def _check_total(path: Path, total: int, most_bytes: int) -> None:
    if total > most_bytes:
        raise ContractError(
            f"{path.name} takes {total / 1e9:.3g} GB or more, and such files are read whole; "
            f"raise {option_text('max_mem_bytes')}, or save its histograms as .h5 or .npz"
        )
