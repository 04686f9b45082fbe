"""tools/lens/haze_trial.py on a small frame: undoing the haze gains, and the table says so."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.haze_file import write_haze
from camkit.bundle.psf_file import write_psf
from camkit.bundle.reader import open_bundle
from tests.bundle_factory import tiny_psf
from tests.haze_factory import CELL_PX, tiny_haze
from tests.tiny_design import run_tool
from tools.lens.whole_frames import SIMPLE


def test_the_table_says_what_is_gained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    psf = tiny_psf(pitch_um=5.96)
    write_psf(tmp_path / "psf.st", psf)
    write_haze(tmp_path / "haze.st", tiny_haze(psf))
    blocks = np.random.default_rng(0).integers(40, 220, (3, 4, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "p.png"), cv2.resize(blocks, (48, 48), interpolation=0))
    kept = tmp_path / "kept.camkit", tmp_path / "kept.dng"
    run_tool(
        monkeypatch,
        "lens.haze_trial",
        *(tmp_path / name for name in ("psf.st", "haze.st", "p.png")),
        *("--size", 128, 96, "-o", kept[0], "--keep", kept[1]),
    )
    said = capsys.readouterr().out
    rows = [line.split("|") for line in said.splitlines() if line.startswith("| ")][1:]
    assert [row[1].strip() for row in rows] == list(SIMPLE)
    develop, haze, _ = (float(row[2]) for row in rows)
    assert haze > develop + 3
    assert kept[1].stat().st_size > 0
    assert open_bundle(kept[0]).manifest.has_haze
    assert open_bundle(kept[0]).haze.cell_px == CELL_PX
