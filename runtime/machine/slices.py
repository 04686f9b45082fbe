"""Rows of one band, or parts of a sum, shared among threads, so that no core is left idle."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

from camkit.errors import ContractError

T = TypeVar("T")
R = TypeVar("R")

LEAST_ROWS: Final = 8
"""A thread is not worth its start for fewer rows."""


CHUNK_SAMPLES: Final = 1 << 18
"""Samples of one channel that a pointwise function gets at once: what it makes stays in cache."""


def run_chunks(work: Callable[[int, int], None], rows: int, width: int, *, threads: int) -> None:
    """Call `work(first, last)` for pieces of rows that stay in cache, shared among threads.

    As `run_slices`; for pointwise work, whose bits no cut can change.

    Args:
        work: Fills rows first..last.
        rows: Number of rows.
        width: Samples in a row of one channel.
        threads: Threads at most.
    """
    chunk = max(1, CHUNK_SAMPLES // width)

    def pieces(first: int, last: int) -> None:
        for start in range(first, last, chunk):
            work(start, min(start + chunk, last))

    run_slices(pieces, rows, threads=threads)


def run_slices(
    work: Callable[[int, int], None], rows: int, *, threads: int, lattice: int = 1
) -> None:
    """Call `work(first, last)` for slices that together are all rows, each on a thread of its own.

    The threads end with the call: who waits for rows between two bands must own none. The calling
    thread takes the first slice; the bits must not depend on where the slices end.

    Args:
        work: Fills rows first..last of an output that the caller holds; called at the same time
            from several threads.
        rows: Number of rows.
        threads: Slices at most.
        lattice: Slices start at multiples of it.

    Raises:
        ContractError: If a count is < 1.
    """
    if threads < 1 or rows < 1 or lattice < 1:
        raise ContractError(f"slices need counts >= 1; got {rows} rows, {threads}, {lattice}")
    count = max(1, min(threads, rows // LEAST_ROWS))
    step = -(-rows // (count * lattice)) * lattice
    slices = [(first, min(first + step, rows)) for first in range(0, rows, step)]
    if len(slices) == 1:
        work(0, rows)
        return
    with ThreadPoolExecutor(len(slices) - 1) as pool:
        others = [pool.submit(work, *ends) for ends in slices[1:]]
        work(*slices[0])
        for other in others:
            other.result()


def run_parts(work: Callable[[T], R], parts: Sequence[T], *, threads: int) -> list[R]:
    """Return what `work` makes of every part, in their order; the threads end with the call.

    Args:
        work: Called at the same time from several threads.
        parts: What is worked on.
        threads: Parts at a time.
    """
    if min(threads, len(parts)) < 2:
        return [work(part) for part in parts]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, parts))
