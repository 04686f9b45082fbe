"""Rows of one band shared among threads, so that no stage of the picture leaves a core idle."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from camkit.errors import ContractError

LEAST_ROWS = 8
"""A thread is not worth its start for fewer rows."""


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
