"""The processor: what the system says of it, where it says something."""

from pathlib import Path

import pytest

from camkit.runtime.machine import processor
from camkit.runtime.machine.processor import lacks_bfloat16, processor_fact


@pytest.mark.parametrize(
    ("flags", "lacks"),
    [
        ("flags : fpu avx2 avx512f", True),
        ("flags : fpu avx512f avx512_bf16", False),
        ("flags : amx_tile amx_bf16", False),
        ("Features : fp asimd", False),
    ],
)
def test_bfloat16_is_lacking_where_the_flags_are_told_and_none_names_it(
    flags: str, lacks: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = tmp_path / "cpuinfo"
    told.write_text(f"processor : 0\nmodel name : Tester 1\n{flags}\n")
    monkeypatch.setattr(processor, "_CPUINFO", told)
    assert processor_fact("model name") == "Tester 1"
    assert processor_fact("bogus") is None
    assert lacks_bfloat16() is lacks


def test_a_system_that_tells_nothing_is_believed_to_lack_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processor, "_CPUINFO", tmp_path / "none")
    assert processor_fact("flags") is None
    assert not lacks_bfloat16()
