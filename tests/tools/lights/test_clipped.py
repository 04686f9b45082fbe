"""Every way to explain lights is scored; a reach of none is the way of old bundles."""

import sys
from pathlib import Path

import pytest

from camkit.bundle.reader import open_bundle
from camkit.bundle.stages import Wiener
from tests.bundle_factory import write_tiny_bundle
from tools.lights import clipped


def test_three_ways_are_scored_and_averaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_tiny_bundle(tmp_path)
    monkeypatch.setattr(clipped, "SCENE_PX", (64, 96))
    monkeypatch.setattr(clipped, "BORDER_PX", 4)
    monkeypatch.setattr(clipped, "SCENES", ((7, 6.0, (0, 0)),))
    monkeypatch.setattr(sys, "argv", ["clipped", "--bundles", str(bundle), "--size", "M"])
    clipped.main()
    rows = [line for line in capsys.readouterr().out.splitlines() if "mean" in line]
    assert [row.split("|")[5].strip() for row in rows] == list(clipped.WAYS)


@pytest.mark.parametrize(
    ("way", "rounds_kept", "reach_px"), [("none", False, None), ("near", True, 16)]
)
def test_a_way_changes_the_bank_alone(
    tmp_path: Path, way: str, rounds_kept: bool, reach_px: int | None
) -> None:
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    before = bundle.manifest.stage(Wiener)
    after = clipped._explaining(bundle, way).manifest.stage(Wiener)
    assert before is not None
    assert after is not None
    assert after.clip_reach_px == reach_px
    assert after.clip_iterations == (before.clip_iterations if rounds_kept else 0)
