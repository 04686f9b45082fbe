"""Modules register by lying in a folder."""

import sys
from pathlib import Path

import pytest

from camkit.errors import UnsupportedError
from camkit.report.discovery import discover


def test_a_new_module_registers_without_any_edit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "more_metrics"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "spad.py").write_text("METRIC = 'a new one'")
    monkeypatch.syspath_prepend(tmp_path)
    assert discover("more_metrics", "METRIC", str) == ("a new one",)
    (package / "wrong.py").write_text("METRIC = 3")
    with pytest.raises(UnsupportedError, match=r"more_metrics\.wrong must define METRIC as a str"):
        discover("more_metrics", "METRIC", str)
    for name in ("more_metrics", "more_metrics.spad", "more_metrics.wrong"):
        sys.modules.pop(name, None)
