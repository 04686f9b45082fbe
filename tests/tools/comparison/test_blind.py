"""Pictures whose order is kept from who judges them, and the count of the votes."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.errors import ContractError
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle
from tools.comparison import blind


def test_parts_stand_beside_the_truth_in_an_order_of_the_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_wide_bundle(tmp_path)
    monkeypatch.setattr(blind, "fabricated_optics", lambda bundle, *_, **__: bundle.frozen_optics)
    monkeypatch.setattr(blind, "SIDE_PX", 48)
    (tmp_path / "in").mkdir()
    picture = np.rint(texture(96, 96, seed=3) * 255).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "in" / "a.png"), picture.transpose(1, 2, 0))
    names = ["--before", str(bundle.path), "--after", str(bundle.path)]
    words = [*names, "--data", str(tmp_path / "in"), "-o", str(tmp_path / "out")]
    blind.main(words)
    key = json.loads((tmp_path / "out" / "key.json").read_text(encoding="utf-8"))
    assert [entry["scene"] for entry in key.values()] == [
        "a.png",
        *(f"night {number}" for number in range(4)),
    ]
    shown = cv2.imread(str(tmp_path / "out" / "00.png"))
    assert shown.shape == (96, 3 * 96 + 2 * 8, 3)
    # one bundle twice: both halves agree, whatever the order
    assert (shown[:, :96] == shown[:, 104:200]).all()
    blind.main(words)
    assert json.loads((tmp_path / "out" / "key.json").read_text(encoding="utf-8")) == key


def test_votes_are_counted_by_the_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key = {"00": {"left": "before"}, "01": {"left": "after"}, "02": {"left": "after"}}
    (tmp_path / "key.json").write_text(json.dumps(key), encoding="utf-8")
    votes = tmp_path / "votes.txt"
    votes.write_text("00: right\n\n01: left\n02: equal\n", encoding="utf-8")
    blind.main(["--reveal", str(tmp_path)])
    assert json.loads(capsys.readouterr().out) == {"before": 0, "after": 2, "equal": 1}
    votes.write_text("00: both\n", encoding="utf-8")
    with pytest.raises(ContractError, match="left, right or equal"):
        blind.counted(tmp_path)
    votes.write_text("00: left\n00: left\n", encoding="utf-8")
    with pytest.raises(ContractError, match="00 has two votes"):
        blind.counted(tmp_path)
    votes.write_text("01: left\n", encoding="utf-8")
    with pytest.raises(ContractError, match="no vote for 00, 02"):
        blind.counted(tmp_path)


def test_what_is_missing_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        blind.main(["--before", "duet"])
    assert "--after" in capsys.readouterr().err
