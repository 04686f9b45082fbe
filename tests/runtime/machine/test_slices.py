"""Slices of a band: all rows once, on threads that end with the call."""

import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.runtime.machine.slices import LEAST_ROWS, run_parts, run_slices


@given(rows=st.integers(1, 200), threads=st.integers(1, 5), lattice=st.sampled_from([1, 2, 8]))
@settings(deadline=None, max_examples=40)
def test_slices_are_all_rows_once_and_start_on_the_lattice(
    rows: int, threads: int, lattice: int
) -> None:
    found: list[tuple[int, int]] = []
    run_slices(lambda a, b: found.append((a, b)), rows, threads=threads, lattice=lattice)
    assert sorted(row for a, b in found for row in range(a, b)) == list(range(rows))
    assert len(found) <= threads
    assert all(first % lattice == 0 for first, _ in found)


def test_few_rows_stay_on_the_calling_thread() -> None:
    seen: list[threading.Thread] = []
    run_slices(lambda *_: seen.append(threading.current_thread()), 2 * LEAST_ROWS - 1, threads=4)
    assert seen == [threading.current_thread()]


def test_no_thread_outlives_the_call() -> None:
    before = threading.active_count()
    met = threading.Barrier(2)  # passes only if two slices run at the same time
    run_slices(lambda *_: met.wait(timeout=20) and None, 4 * LEAST_ROWS, threads=2)
    assert threading.active_count() == before


@pytest.mark.parametrize("failing", [0, 32])
def test_an_error_in_any_slice_reaches_the_caller(failing: int) -> None:
    def work(first: int, last: int) -> None:
        if first <= failing < last:
            raise ContractError(f"rows {first}..{last}")

    with pytest.raises(ContractError, match="rows"):
        run_slices(work, 64, threads=2)


@pytest.mark.parametrize("counts", [(0, 1, 1), (4, 0, 1), (4, 1, 0)])
def test_counts_below_one_are_refused(counts: tuple[int, int, int]) -> None:
    rows, threads, lattice = counts
    with pytest.raises(ContractError, match="counts >= 1"):
        run_slices(lambda *_: None, rows, threads=threads, lattice=lattice)


@pytest.mark.parametrize("threads", [1, 3])
def test_parts_come_back_in_their_order(threads: int) -> None:
    before = threading.active_count()
    assert run_parts(lambda part: part * part, range(7), threads=threads) == [
        part * part for part in range(7)
    ]
    assert run_parts(lambda part: part, [], threads=threads) == []
    assert threading.active_count() == before


def test_parts_run_at_the_same_time_and_their_errors_reach_the_caller() -> None:
    met = threading.Barrier(2)
    run_parts(lambda _: met.wait(timeout=20), range(2), threads=2)
    with pytest.raises(ZeroDivisionError):
        run_parts(lambda part: 1 // part, [1, 0], threads=2)
