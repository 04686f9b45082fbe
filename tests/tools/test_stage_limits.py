"""tools/stage_limits.py on a tiny capture: every stage beside its limit."""

import json
from pathlib import Path

import pytest

from camkit.bundle.reader import find_bundle, open_bundle
from tests.tiny_design import run_tool
from tools import stage_limits

RUN = {"size_px": [600, 400], "cpu": {"network": 0.4, "wiener": 0.2, "undistort": 0.1}}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage_limits, "COPY_BYTES", 2**20)
    monkeypatch.setattr(stage_limits, "SIDE_PX", 64)
    monkeypatch.setattr(stage_limits, "ROUNDS", 1)
    monkeypatch.setattr(stage_limits, "gemm_peak_gmac_per_s", lambda _: 100.0)


def test_limits_grow_with_the_picture_and_the_network_s_is_its_multiplications() -> None:
    bundle = open_bundle(find_bundle("duet"))
    small, large = (stage_limits.limits(bundle, "S", (side, side)) for side in (256, 1024))
    macs = bundle.network_facts("restore", "S").mac_per_pixel
    assert small["network"] == pytest.approx(macs * 256**2 / 1e11)
    assert large["network"] == pytest.approx(16 * small["network"])
    assert set(small) == {*stage_limits.POINTWISE, "undistort", "network", "wiener"}
    assert min(small.values()) > 0


def test_the_record_holds_medians_beside_limits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = iter([json.dumps(RUN), json.dumps({**RUN, "cpu": {"network": 0.6}})])
    monkeypatch.setattr(stage_limits, "run_again", lambda _: next(runs))
    path = tmp_path / "stages.json"
    run_tool(monkeypatch, "stage_limits", "none.dng", "--runs", 2, "-o", path)
    stages = json.loads(path.read_text())["stages"]
    assert stages["network"]["cpu_s"] == 0.5
    assert stages["network"]["limit_s"] > 0
    assert "| network | 0.50 |" in capsys.readouterr().out
