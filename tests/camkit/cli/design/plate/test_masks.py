"""`camkit plate masks`: etched through the images to the depths told, the plate comes out."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.cli.app import run
from camkit.cli.exit_code import ExitCode
from camkit.models_def.optics.diffraction.plate import read_plate
from tests.camkit.cli.design.plate.test_plate_show import PLATE

FLOAT32 = 1e-6


@pytest.fixture(name="plate")
def small_plate(tmp_path: Path) -> Path:
    path = tmp_path / "line.toml"
    path.write_text(PLATE, encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", ["png", "tiff"])
def test_etching_through_the_masks_makes_the_plate(
    kind: str, plate: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = plate.parent / "new" / "masks"
    words = ["plate", "masks", str(plate), "--out-dir", str(folder), "--format", kind]
    assert run([*words, "--json"]) == ExitCode.DONE
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((folder / "line-masks.json").read_text("utf-8"))
    assert len(told["masks"]) == 3
    glass = np.zeros((128, 128))
    for mask in told["masks"]:
        picture = cv2.imread(str(folder / mask["file"]), cv2.IMREAD_UNCHANGED)
        assert picture.shape == (128, 128)
        assert set(np.unique(picture)) == {0, 255}
        glass -= np.where(picture == 0, mask["depth_um"], 0.0)
        assert mask["etched_share"] == pytest.approx((picture == 0).mean(), abs=1e-6)
    made = read_plate(plate).made_um.numpy()
    np.testing.assert_allclose(glass - glass.min(), made - made.min(), atol=FLOAT32)
    assert {path.suffix for path in folder.iterdir()} == {f".{kind}", ".json"}


def test_what_is_there_stays_unless_it_may_be_replaced(
    plate: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["plate", "masks", str(plate), "--out-dir", str(plate.parent)]
    assert run(words) == ExitCode.DONE
    assert "etch 0.0286 um" in capsys.readouterr().out
    (plate.parent / "line-mask-3.png").write_bytes(b"mine")
    assert run(words) == ExitCode.USAGE
    assert (plate.parent / "line-mask-3.png").read_bytes() == b"mine"
    assert run([*words, "--overwrite"]) == ExitCode.DONE
    assert (plate.parent / "line-mask-3.png").read_bytes() != b"mine"


@pytest.mark.parametrize(
    ("change", "words", "message"),
    [
        (("", ""), ["--format", "gds"], "--format is png or tiff; got 'gds'"),
        (("[etching]\nrange_um = 0.2\nlevels = 8", ""), [], "no table [etching]"),
        (("levels = 8", "levels = 1"), [], "levels are 2, 4, 8"),
        (("levels = 8", "levels = nan"), [], "levels must be a number"),
        (("share = 0.1", "share = nan"), [], "share must be a number"),
    ],
)
def test_what_cannot_be_etched_is_one_line_and_no_file(
    plate: Path,
    change: tuple[str, str],
    words: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    plate.write_text(PLATE.replace(*change, 1), encoding="utf-8")
    folder = plate.parent / "masks"
    code = run(["plate", "masks", str(plate), "--out-dir", str(folder), *words])
    assert code == ExitCode.USAGE
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert message in told[0]
    assert not folder.exists()
