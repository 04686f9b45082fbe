"""The table of losses on two rows of a tiny camera: table, journal, nothing done again."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.models_def.kinds.bayer import training
from tests.bayer_recipe import bank, material, one_picture_to_validate_on, recipe  # noqa: F401
from tests.normed_recipe import NORMED_RECIPE, recipe_path  # noqa: F401
from tools.tables.losses import loss_table
from tools.tables.losses.classical import METHODS
from tools.tables.losses.domain import METRICS

FREE = ["capture", "wiener", *METHODS]
Command = Callable[..., str]


@pytest.fixture
def losses(tmp_path, monkeypatch, material, command):  # noqa: F811
    """Give the command of the tiny camera, whose kernels need no tracing."""
    monkeypatch.setattr(training, "trace_material", lambda *_: material)
    tiny, runs = tmp_path / "tiny.toml", tmp_path / "runs"
    tiny.write_text(NORMED_RECIPE, encoding="utf-8")
    ways = {
        "train": (tiny, "--out-dir", runs, "--workers", 0, "--cpu-minutes", 10),
        "measure": ("--runs", runs, "-o", tmp_path / "losses.json", "--overwrite", "--samples", 2),
    }
    return lambda way, *words: command("losses", way, *ways[way], *words)


def _record(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "losses.json").read_text(encoding="utf-8"))
    return found


def test_rows_are_trained_once_and_judged_at_home_and_abroad(
    losses: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trained = ("train", "--rows", "l1", "adversarial")
    assert losses(*trained).count("training for 10 CPU-minutes") == 2
    assert "training for" not in losses(*trained)
    said = losses("measure")
    report = _record(tmp_path)
    rows = report["rows"]
    assert (report["lab"], report["wild"]) == ("tiny_display", "tiny_wild")
    assert sorted(rows) == sorted([*FREE, "l1", "adversarial"])
    assert all(
        set(METRICS) <= set(row[where]) for row in rows.values() for where in ("lab", "wild")
    )
    assert rows["l1"]["trained"]["steps"] == 3
    # three steps from the bank: still close to it
    gap = rows["l1"]["lab"]["psnr_db"] - rows["wiener"]["lab"]["psnr_db"]
    assert abs(gap) < 3
    assert rows["capture"]["lab"]["psnr_db"] != rows["capture"]["wild"]["psnr_db"]
    best = report["classical"]["best"]
    assert rows[best]["lab"]["psnr_db"] == max(rows[name]["lab"]["psnr_db"] for name in FREE[1:])
    (pair,) = report["overfitting"]
    assert (pair["supervised"], pair["other"]) == ("l1", "adversarial")
    each = [rows[name]["wild"]["each"]["psnr_db"] for name in ("l1", "adversarial")]
    assert pair["psnr_db"]["wild"][0] == pytest.approx(np.subtract(*each).mean(), abs=1e-3)
    assert "| adversarial |" in said
    assert "l1 against adversarial, psnr_db" in said
    monkeypatch.setattr(loss_table, "_scores", lambda *_: pytest.fail("measured again"))
    losses("measure")
    assert _record(tmp_path) == report


def test_weights_of_another_recipe_are_not_gone_on_with(losses: Command, tmp_path: Path) -> None:
    losses("train", "--rows", "l1")
    faster = NORMED_RECIPE.replace("warmup_steps = 2", "warmup_steps = 1")
    (tmp_path / "tiny.toml").write_text(faster, encoding="utf-8")
    with pytest.raises(SystemExit, match="l1-1 was begun by another recipe: remove"):
        losses("train", "--rows", "l1")


def test_without_a_row_the_recipes_are_written_and_nothing_is_trained(
    losses: Command, tmp_path: Path
) -> None:
    with pytest.raises(SystemExit, match=r"must hold one recipe \*_display.toml; it has 0"):
        losses("measure")
    losses("train", "--rows")
    assert sorted(path.name for path in (tmp_path / "runs").glob("*.toml")) == [
        f"tiny_{name}.toml" for name in ("display", "display_judged", "wild", "wild_judged")
    ]
    said = losses("measure")
    assert sorted(_record(tmp_path)["rows"]) == sorted(FREE)
    assert "no verdict" in said


def test_one_sample_tells_no_error_and_is_refused(losses: Command) -> None:
    with pytest.raises(SystemExit):
        losses("measure", "--samples", 1)


def test_what_is_wrong_with_a_recipe_is_one_line(command: Command, tmp_path: Path) -> None:
    words = ("losses", "train", tmp_path / "none.toml", "--rows", "l1", "--out-dir", tmp_path)
    with pytest.raises(SystemExit, match="error: cannot read recipe"):
        command(*words)
