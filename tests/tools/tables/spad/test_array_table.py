"""Tables 4.1 and 4.2: networks trained once, rows measured once, what is missing said."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from camkit.bundle.stages import SuperResolve
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.sampling import make_sampling
from camkit.models_def.networks.bicubic import SCALE
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance
from camkit.runtime.kinds.spad.finer.linear import Grid, linear_estimate
from tests.tools.tables.spad.array_rig import SIGMA, Rig, rig, write_run, write_sets
from tools.tables import runner
from tools.tables.spad.array_record import THESIS
from tools.tables.spad.array_table import ROWS, linear_restorer, network_mac_per_px
from tools.tables.table_rows import chosen_rows

__all__ = ["rig"]
LEVELS = ["noise-free", "10000", "1000", "100"]


def _measured(rig: Rig, folder: Path, *words: Any) -> tuple[dict[str, Any], str]:
    out = folder / "record.json"
    given = ("--runs", folder / "runs", "--data", folder / "tests", "-o", out, "--overwrite")
    said = rig("measure", *given, *words)
    return json.loads(out.read_text(encoding="utf-8")), said


def test_rows_are_measured_once_with_seeds_gains_and_what_is_missing(
    rig: Rig, tmp_path: Path
) -> None:
    write_sets(tmp_path / "tests")
    for name in ("learned.M-1", "learned.M-2", "low_fill.M-1"):
        write_run(tmp_path / "runs", name)
    record, said = _measured(rig, tmp_path)
    assert record["pictures"] == {"set5": 1, "set14": 2}
    assert record["photons"] == LEVELS
    learned = record["rows"]["learned.M"]
    for level in LEVELS:
        score = learned["scores"][level]["set5"]["psnr_db"]
        assert len(score["seeds"]) == 2
        assert score["mean"] == pytest.approx(sum(score["seeds"]) / 2, rel=1e-4)
        assert score["spread"] is not None
    assert learned["trained"].keys() == {"learned.M-1", "learned.M-2"}
    assert learned["mac_per_px"] > 1000
    assert record["seeds_left_out"]["learned.M"] == [3]
    assert record["rows_left_out"]["learned.dbpn"] == "not trained yet"
    assert record["sets_left_out"].keys() == {"bsd100_half_a"}
    gain = record["gains"]["learned.M over low_fill.M"]["1000"]["set14"]
    low = record["rows"]["low_fill.M"]["scores"]["1000"]["set14"]["psnr_db"]["mean"]
    own = learned["scores"]["1000"]["set14"]["psnr_db"]["mean"]
    assert gain["db"] == pytest.approx(own - low, abs=1e-3)
    assert gain["spread"] is not None
    assert gain["se_of_pictures"] is not None
    assert str(tmp_path) not in json.dumps(record)
    assert "learned.M-1 on set5" in said
    assert "seeds 3 are not trained yet" in said
    assert "24.26 / 0.8336" in said  # the thesis beside it
    again, quiet = _measured(rig, tmp_path)
    assert again == record
    assert " on set5" not in quiet


def test_a_full_pixel_collects_more_light_than_at_equal_counts(rig: Rig, tmp_path: Path) -> None:
    write_sets(tmp_path / "tests")
    write_run(tmp_path / "runs", "full_fill.M-1")
    record, _ = _measured(rig, tmp_path, "--rows", "full_fill.M", "full_fill.M=equal")
    own, equal = (record["rows"][key]["scores"] for key in ("full_fill.M", "full_fill.M=equal"))
    assert own["noise-free"]["set14"]["psnr_db"] == equal["noise-free"]["set14"]["psnr_db"]
    for level in LEVELS[1:]:
        bright, dim = (s[level]["set14"]["psnr_db"]["mean"] for s in (own, equal))
        assert bright > dim


def test_a_network_is_trained_once_by_the_recipe_of_its_row(rig: Rig, tmp_path: Path) -> None:
    words = ("train", "--out-dir", tmp_path / "runs", "--cpu-minutes", 0.002, "--rows")
    assert "training for 0.002 CPU-minutes" in rig(*words, "gaussian.M")
    text = (tmp_path / "runs" / "gaussian.M-1" / "recipe.toml").read_text(encoding="utf-8")
    assert f'mode = "gaussian"\nsigma = {SIGMA}' in text
    assert "training for" not in rig(*words, "gaussian.M-1")


def test_bicubic_interpolation_knows_the_phase(rig: Rig, tmp_path: Path) -> None:
    write_sets(tmp_path / "tests")
    record, _ = _measured(rig, tmp_path, "--rows", "low_fill.bicubic", "learned.linear")
    assert (tmp_path / "runs" / runner.JOURNAL).is_file()
    found = record["rows"]["low_fill.bicubic"]
    assert found["mac_per_px"] is None
    assert found["thesis"]["set5"] == [24.26, 0.8336]
    scores = [found["scores"][level]["set14"]["psnr_db"]["mean"] for level in LEVELS]
    assert scores == sorted(scores, reverse=True)


def test_what_cannot_be_measured_is_refused(rig: Rig, tmp_path: Path) -> None:
    out = tmp_path / "record.json"
    words = ("measure", "--runs", tmp_path / "runs", "--data", tmp_path, "-o", out)
    with pytest.raises(SystemExit, match="holds none of set5, set14, bsd100_half_a"):
        rig(*words)
    with pytest.raises(SystemExit, match=r"there is no row 'dream'; there are learned\.M"):
        rig(*words, "--rows", "dream")
    out.write_text("{}", encoding="utf-8")
    with pytest.raises(SystemExit, match="give --overwrite"):
        rig(*words)


def test_every_row_of_the_thesis_is_judged() -> None:
    keys = {row.key for row in ROWS}
    assert set(THESIS) <= keys
    assert len(keys) == len(ROWS)
    assert [row.key for row in chosen_rows(ROWS, ["learned.S"])] == ["learned.S"]


def test_work_is_counted_for_a_pixel_of_the_array() -> None:
    network = nn.Conv2d(2, 16, 3, padding=1)
    assert network_mac_per_px(network) == 2 * 16 * 9


def test_the_estimate_is_taken_at_the_light_that_the_pixels_collect() -> None:
    full = make_sampling("full_fill")
    planes = torch.from_numpy(np.random.default_rng(0).random((1, 2, 9, 12), np.float32))
    mean = float(planes[:, :1].mean())
    covariance, grid = PictureCovariance.of(SuperResolve()), Grid(scale=SCALE, phase=full.phase)
    for photons, of_pixel in ((10.0, 160 * mean), (math.inf, math.inf)):
        found = linear_restorer(full, Exposure(photons=photons))(planes)
        wanted = linear_estimate(full.kernel, grid, covariance, of_pixel)(planes[0, :1].numpy())
        np.testing.assert_array_equal(found[0].numpy(), wanted)
