"""The bundle of glare is built by its command, the same bytes every time."""

import sys
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import open_bundle
from camkit.bundle.stages import Deglare
from camkit.errors import ParityError
from camkit.export import proving
from camkit.runtime.proof.check import CheckReport, Layer
from tools.hdr import glare_bundle


def test_the_command_builds_the_bundle(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "deglare.camkit"
    monkeypatch.setattr(sys, "argv", ["glare_bundle", "-o", str(out)])
    glare_bundle.main()
    assert capsys.readouterr().out == f"{out.stat().st_size} bytes\n"
    again = tmp_path / "again.camkit"
    glare_bundle.build(again, Deglare())
    assert again.read_bytes() == out.read_bytes()
    assert open_bundle(out).manifest.stage(Deglare) == Deglare()


def test_a_bundle_that_fails_its_check_is_not_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    failed = CheckReport(
        path=tmp_path, layers=(Layer(name="golden", status="fail", message="off"),)
    )
    monkeypatch.setattr(proving, "check_bundle", lambda *_, **__: failed)
    out = tmp_path / "deglare.camkit"
    with pytest.raises(ParityError, match="fails its own check"):
        glare_bundle.build(out, Deglare())
    assert not out.exists()


def test_a_mosaic_holds_every_sample_of_its_colour() -> None:
    planes = np.stack([np.full((4, 6), value, np.float32) for value in (0.1, 0.2, 0.3)])
    mosaic = glare_bundle.mosaic_of(planes)
    step = glare_bundle.WHITE - glare_bundle.BLACK
    levels = [round(glare_bundle.BLACK + value * step) for value in (0.1, 0.2, 0.3)]
    assert mosaic[0, 0] == levels[0]
    assert mosaic[0, 1] == mosaic[1, 0] == levels[1]
    assert mosaic[1, 1] == levels[2]
