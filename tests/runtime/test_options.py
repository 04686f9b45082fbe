"""Options are refused when wrong, with the choices named."""

import pytest

from camkit.errors import ContractError
from camkit.runtime.options import Options, parse_memory


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"quality": "good"}, "exact, best, adaptive, draft"),
        ({"max_seconds": 0.0}, "max_seconds must be > 0"),
        ({"max_error_db": -1.0}, "max_error_db must be > 0"),
        ({"on_unsafe": "ignore"}, "warn, fallback, fail"),
        ({"dtype": "fp64"}, "fp32, fp16, bf16"),
        ({"dtype": "bf16"}, 'openvino alone; add provider="openvino"'),
        ({"provider": "tpu"}, "cpu, cuda"),
        ({"mode": "quick"}, "exact, fast, whole"),
        ({"demosaic": "best"}, "fast, quality"),
        ({"color": "p3"}, "rec709, acescg, camera"),
        ({"assume": "center"}, "centre, scale"),
        ({"white_balance": (0.0, 1.0, 1.0)}, "gains"),
        ({"exposure_ev": 40.0}, "EV"),
        ({"depth_m": 0.0}, "depth must be > 0"),
        ({"depth_m": float("nan")}, "depth must be > 0"),
        ({"threads": 0}, "threads"),
        ({"max_mem_bytes": 1000}, "at least"),
    ],
)
def test_a_wrong_option_is_refused(choice: dict[str, object], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        Options(**choice)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "size"),
    [("2G", 2 * 10**9), ("900M", 9 * 10**8), ("1.5GiB", 3 * 2**29), ("64kb", 64_000), ("7", 7)],
)
def test_memory_sizes_are_read(text: str, size: int) -> None:
    assert parse_memory(text) == size


@pytest.mark.parametrize("text", ["", "G", "two", "2T", "1e999G"])
def test_what_is_no_memory_size_is_refused(text: str) -> None:
    with pytest.raises(ContractError, match="memory size"):
        parse_memory(text)
