"""tools/trace_speed.py on few rays."""

import pytest

from tests.tiny_design import run_tool


def test_a_row_for_every_code_and_kind_of_surface(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tools.trace_speed.find_spec", lambda _: None)
    run_tool(monkeypatch, "trace_speed", "--rays", 4096, "--rounds", 1)
    rows = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines()[2:]]
    assert [row[:2] for row in rows] == [["spheres", "camkit"], ["even aspheres", "camkit"]]
    assert all(float(speed) > 0 for row in rows for speed in row[2:])
