"""The peak memory is that of this process, not of the one that started it."""

import subprocess
import sys

import numpy as np
import pytest

from camkit.runtime import memory


def test_a_large_array_raises_the_peak() -> None:
    before = memory.peak_rss_mb()
    held = np.ones(int(before * 1e6 / 8) + 20_000_000)
    assert memory.peak_rss_mb() > before
    del held


@pytest.mark.skipif(sys.platform != "linux", reason="reads the kernel's high-water mark")
def test_a_child_does_not_inherit_the_peak_of_its_parent() -> None:
    held = np.ones(40_000_000)
    code = "from camkit.runtime.memory import peak_rss_mb; print(peak_rss_mb())"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert float(told.stdout) < 200
    del held


def test_without_the_mark_getrusage_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory.Path, "read_text", lambda *_, **__: "")
    assert memory.peak_rss_mb() > 10
