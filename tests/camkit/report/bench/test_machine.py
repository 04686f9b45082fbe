"""The machine: what is told about it, and the matrix product."""

import json

import pytest

from camkit.errors import UnsupportedError
from camkit.report.bench import gemm
from camkit.report.bench.machine import describe_machine, free_memory_bytes, telling_flags


def test_only_vector_and_matrix_instructions_are_told() -> None:
    assert telling_flags("fpu avx2 avx512f amx_tile rdtscp fma asimd asimd") == [
        "amx_tile",
        "asimd",
        "avx2",
        "avx512f",
        "fma",
    ]


def test_the_machine_is_described_without_its_name() -> None:
    import platform

    facts = describe_machine()
    assert facts["threads"] >= 1
    assert facts["providers"][0] == "cpu"
    assert facts["packages"]["numpy"][0].isdigit()
    assert platform.node() not in json.dumps(facts) or not platform.node()


def test_free_memory_is_less_than_all_of_it() -> None:
    free, all_mb = free_memory_bytes(), describe_machine()["memory_mb"]
    if free is None or all_mb is None:
        pytest.skip("this system does not tell its memory")
    assert 0 < free < all_mb * 1e6


def test_a_product_of_n_counts_n_cubed_multiply_adds(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter(range(1000))
    monkeypatch.setattr(gemm.time, "perf_counter", lambda: next(ticks) * 0.5)
    monkeypatch.setattr(gemm.time, "process_time", lambda: 0.0)
    # the clock moves half a second per look, so every product takes 0.5 s
    assert gemm.best_product(100, 0.2) == pytest.approx(100**3 / 0.5 / 1e9)


def test_the_product_is_measured_in_a_process_of_its_own() -> None:
    assert gemm.gemm_peak_gmac_per_s(1, seconds=0.01) > 0.1


def test_a_failing_process_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gemm, "camkit_environment", lambda: {"PYTHONPATH": "/nowhere"})
    monkeypatch.setattr(gemm.sys, "executable", "/bin/false")
    with pytest.raises(UnsupportedError, match="matrix product"):
        gemm.gemm_peak_gmac_per_s(1)
