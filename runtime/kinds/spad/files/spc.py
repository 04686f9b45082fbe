"""SPC of Becker & Hickl (SPC-130, SPC-150): one record of 32 bits for every photon.

    bits 0..11   macro time, in ticks of the clock, modulo 4096
    bits 12..15  routing: which detector, the channel of what is read
    bits 16..27  ADC; the time within a cycle is 4095 - ADC, for the clock stops what a photon began
    bit 28       marker, 29 gap, 30 overflow of the macro time, 31 no photon

The first record is a header. A record that is an overflow and no photon holds in its lower 28 bits
how many times the macro time ran over.

References: The bh TCSPC Handbook, FIFO data format of the SPC-130 and SPC-150 modules.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.files.channels import chosen_places
from camkit.runtime.kinds.spad.files.counts_file import CountsFile, Hints
from camkit.runtime.kinds.spad.files.stamps import StampsFile

RECORD_BYTES: Final = 4
LAST_ADC: Final = 4095
ROUTINGS: Final = 16
MICRO_BYTES: Final = 4
"""Bytes that a photon takes while the parts are put together."""
MARKER: Final = np.uint32(1 << 28)
NO_PHOTON: Final = np.uint32(1 << 31)
TAC_STEP: Final = re.compile(rb"SP_TAC_TC,F,([0-9.eE+-]+)\]")
SET_BYTES: Final = 1_000_000
AT_ONCE: Final = 500_000
"""Records that are decoded at once."""


def checked_records(data: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return all records behind the header.

    Raises:
        DecodeError: If they are not whole, or there is no header.
    """
    if len(data) < RECORD_BYTES or len(data) % RECORD_BYTES:
        raise DecodeError(f"{len(data)} bytes are no whole records of {RECORD_BYTES}")
    records = data.view("<u4")
    if not records[0] & NO_PHOTON:
        raise DecodeError(
            "the first record is no header of an SPC-130 or SPC-150: expected bit 31, got "
            f"{int(records[0]):#010x}"
        )
    return np.asarray(records[1:])


def photons_of_routing(records: NDArray[np.uint32]) -> NDArray[np.int64]:
    """Return how many photons each detector has, (16,)."""
    counts = np.zeros(ROUTINGS, np.int64)
    for part in _parts(records):
        counts += np.bincount(_routing(part[_are_photons(part)]), minlength=ROUTINGS)
    return counts


def micro_times(records: NDArray[np.uint32], routing: int) -> Iterator[NDArray[np.uint16]]:
    """Yield the times within the cycle of a detector's photons, part by part."""
    for part in _parts(records):
        photons = part[_are_photons(part)]
        yield _micro(photons[_routing(photons) == routing])


def _parts(records: NDArray[np.uint32]) -> Iterator[NDArray[np.uint32]]:
    for start in range(0, len(records), AT_ONCE):
        check_wish()
        yield records[start : start + AT_ONCE]


def _are_photons(records: NDArray[np.uint32]) -> NDArray[np.bool_]:
    return np.asarray((records & (NO_PHOTON | MARKER)) == 0)


def _micro(photons: NDArray[np.uint32]) -> NDArray[np.uint16]:
    return np.asarray(LAST_ADC - ((photons >> 16) & 0xFFF), dtype=np.uint16)


def _routing(photons: NDArray[np.uint32]) -> NDArray[np.uint8]:
    return np.asarray((photons >> 12) & 0xF, dtype=np.uint8)


def open_spc(path: Path, hints: Hints) -> CountsFile:
    """Open a stream as the time stamps of one pixel of one detector; see `open_counts`."""
    try:
        records = checked_records(np.memmap(path, np.uint8, mode="r"))
    except (DecodeError, ValueError) as error:
        raise DecodeError(f"{path.name} is damaged, or no SPC: {error}") from error
    photons = photons_of_routing(records)
    detectors = np.flatnonzero(photons).tolist() or [0]
    routing = detectors[chosen_places(path, {"channel": detectors}, hints.key)["channel"]]
    size = int(photons[routing]) * MICRO_BYTES
    if size > hints.max_bytes:
        raise ContractError(
            f"{path.name}: the {photons[routing]} photons of channel {routing} take "
            f"{size / 1e9:.3g} GB, more than fits the memory; raise {option_text('max_mem_bytes')}"
        )
    micro = np.concatenate([*micro_times(records, routing), np.empty(0, np.uint16)])
    step = _tac_step_ps(path.with_suffix(".set"))
    stated_times = {} if step is None else {"stamp_ps": step}
    return StampsFile(path, (1, 1), lambda _: [micro], stated_times=stated_times)


def _tac_step_ps(path: Path) -> float | None:
    """Return the step of the TAC from the set-up file beside a stream; None without one."""
    if not path.is_file():
        return None
    with path.open("rb") as file:
        match = TAC_STEP.search(file.read(SET_BYTES))
    try:
        return None if match is None else float(match[1]) * 1e12
    except ValueError:
        return None
