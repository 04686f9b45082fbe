"""The check of plates: a small plate on every row, and the rows that must agree with each other."""

import json
from pathlib import Path

import numpy as np
import pytest

from camkit.models_def.kinds.spad.sampling import gaussian_psf
from tools.spad import plate_check
from tools.spad.plate_check import main

SMALL = ["--cells", "33", "--tiles", "4"]


def test_every_row_is_told_and_the_rows_agree(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, few in (
        ("LEVEL_COUNTS", (4, 8)),
        ("DEFOCUS_MM", (0.4,)),
        ("TURNS_DEG", (10.0,)),
        ("SHIFTS_MM", (0.3,)),
        ("DEPTH_ERRORS", (-0.1, 0.0)),
        ("WIDE", 21),
    ):
        monkeypatch.setattr(plate_check, name, few)
    psf, out = tmp_path / "wide.npz", tmp_path / "out"
    np.savez(psf, psf=gaussian_psf(1.84))
    assert main(["--out-dir", str(out), "--psf", str(psf), *SMALL]) == 0
    record = json.loads((out / "plate.json").read_text(encoding="utf-8"))
    (plate,) = record["plates"]
    assert plate["psf"] == "wide"
    making = plate["making"]
    assert making["descended"]["rmse"] < making["rounded"]["rmse"]
    assert plate["levels"][1] == {"levels": 8, **making["descended"]}
    views = {(v["tiles"], v["defocus_mm"], v["turn_deg"]): v for v in plate["views"]}
    focused = plate["views"][0]
    assert focused["correlation"] > views[1, 0.0, 0.0]["correlation"]
    assert focused["efficiency"] > views[4, 0.4, 0.0]["efficiency"]
    assert focused["correlation"] > views[4, 0.0, 10.0]["correlation"]
    assert 0 < focused["beside"] < 0.3
    etched = {row["depth_error"]: row for row in plate["etching"]}
    assert etched[0.0]["rmse"] == pytest.approx(focused["rmse"], abs=1e-6)
    assert etched[-0.1]["rmse"] > focused["rmse"]
    assert {v["aperture"] for v in plate["views"]} == {"square", "circle"}


def test_without_a_psf_it_takes_the_one_that_comes_with_camkit() -> None:
    assert list(plate_check._targets(None)) == ["spad-sr", "gaussian-1.84"]


def test_a_psf_that_is_none_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="error: cannot read"):
        main(["--psf", str(tmp_path / "none.npz"), "--out-dir", str(tmp_path)])
