"""The table of losses on two rows of a tiny camera: table, journal, nothing done again."""

import json
from pathlib import Path

import numpy as np
import pytest

from camkit.models_def.kinds.bayer import training
from camkit.models_def.kinds.bayer.material import BayerMaterial
from tests.bayer_recipe import bank, material, one_picture_to_validate_on, recipe  # noqa: F401
from tests.normed_recipe import NORMED_RECIPE, recipe_path  # noqa: F401
from tests.tiny_design import run_tool
from tools.comparison import loss_table
from tools.comparison.classical import METHODS, TUNABLE
from tools.comparison.domain import METRICS

FREE = ["capture", "wiener", *METHODS]


@pytest.fixture
def recipes(tmp_path, monkeypatch, material):  # noqa: F811
    """The tiny camera at home, and with more light; its kernels need no tracing."""
    monkeypatch.setattr(training, "trace_material", lambda *_: material)
    lab, wild = tmp_path / "lab.toml", tmp_path / "wild.toml"
    lab.write_text(NORMED_RECIPE, encoding="utf-8")
    brighter = NORMED_RECIPE.replace("[data]", "[data]\nlamp_share = 1.0\nexposure_max_ev = 2.0")
    wild.write_text(brighter, encoding="utf-8")
    return lab, wild


def test_rows_are_trained_once_and_judged_at_home_and_abroad(
    recipes: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lab, wild = recipes
    out = tmp_path / "out"
    options = [lab, "--wild", wild, "--rows", "l1", "adversarial", "--samples", 2]
    options += ["--minutes", 10, "--tune", 2, "--out-dir", out]
    assert run_tool(monkeypatch, "comparison.loss_table", *options) == 0
    report = json.loads((out / "loss_table.json").read_text(encoding="utf-8"))
    rows = report["rows"]
    assert list(rows) == [*FREE, "l1", "adversarial"]
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
    for name, tunable in TUNABLE.items():
        (numbers, best_db), *others = rows[name]["tuned"]
        assert rows[name]["numbers"] == numbers
        assert all(db <= best_db for _, db in others)
        assert tunable.start in [tried for tried, _ in rows[name]["tuned"]]
    (pair,) = report["overfitting"]
    assert (pair["supervised"], pair["other"]) == ("l1", "adversarial")
    each = [rows[name]["wild"]["each"]["psnr_db"] for name in ("l1", "adversarial")]
    assert pair["psnr_db"]["wild"][0] == pytest.approx(np.subtract(*each).mean(), abs=1e-3)
    said = (out / "loss_table.md").read_text(encoding="utf-8")
    assert "| adversarial |" in said
    assert "l1 against adversarial, psnr_db" in said
    with monkeypatch.context() as again:
        again.setattr(loss_table, "measure", lambda *_: pytest.fail("measured again"))
        assert run_tool(again, "comparison.loss_table", *options) == 0
    # other conditions: weights of before are not gone on with
    faster = lab.read_text(encoding="utf-8").replace("warmup_steps = 2", "warmup_steps = 1")
    lab.write_text(faster, encoding="utf-8")
    assert run_tool(monkeypatch, "comparison.loss_table", *options) == 0
    anew = json.loads((out / "loss_table.json").read_text(encoding="utf-8"))["rows"]
    assert anew["l1"]["lab"]["psnr_db"] != rows["l1"]["lab"]["psnr_db"]
    assert anew["wiener"]["lab"] == rows["wiener"]["lab"]


def test_one_recipe_is_trained_before_a_display_and_judged_outside(
    recipes: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    options = [recipes[0], "--rows", "l1", "--samples", 2, "--minutes", 10, "--tune", 0]
    options += ["--out-dir", out]
    assert run_tool(monkeypatch, "comparison.loss_table", *options, "--only-recipes") == 0
    assert sorted(path.name for path in out.iterdir()) == [
        f"lab_{name}.toml" for name in ("display", "display_judged", "wild", "wild_judged")
    ]
    made = []

    def killed(row: loss_table.Row, given: loss_table.Conditions) -> loss_table.Entry:
        if row.size == "l1" and not made:
            made.append(row)
            raise KeyboardInterrupt
        return measure(row, given)

    measure = loss_table.measure
    monkeypatch.setattr(loss_table, "measure", killed)
    with pytest.raises(KeyboardInterrupt):
        run_tool(monkeypatch, "comparison.loss_table", *options)
    rest = (out / "loss_table.md").read_text(encoding="utf-8")
    assert "| cross-channel |" in rest
    assert "| l1 |" not in rest
    # what was finished is not done again
    monkeypatch.setattr(loss_table, "UNTRAINED", dict.fromkeys(loss_table.UNTRAINED))
    assert run_tool(monkeypatch, "comparison.loss_table", *options) == 0
    report = json.loads((out / "loss_table.json").read_text(encoding="utf-8"))
    assert (report["lab"], report["wild"]) == ("lab_display", "lab_wild")
    assert report["rows"]["l1"]["trained"]["steps"] == 3
    assert "no verdict" in (out / "loss_table.md").read_text(encoding="utf-8")


def test_what_is_wrong_with_a_recipe_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    options = [tmp_path / "none.toml", "--rows", "l1", "--out-dir", tmp_path / "out"]
    with pytest.raises(SystemExit, match="error: cannot read recipe"):
        run_tool(monkeypatch, "comparison.loss_table", *options)


def test_a_row_of_another_lens_has_two_recipes_of_its_own(
    recipes: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lab, wild = recipes
    assert loss_table.row_of("S", lab, wild) == loss_table.Row(size="S", lab=lab, wild=wild)
    own = loss_table.row_of("S=a.toml,b.toml", lab, wild)
    assert (own.lab, own.wild) == (Path("a.toml"), Path("b.toml"))
    for word in ("S=a.toml", "S=a,b,c"):
        with pytest.raises(SystemExit, match=r"SIZE=LAB\.toml,WILD\.toml"):
            loss_table.row_of(word, lab, wild)

    def traced(_recipe: object, _folder: Path, cache: Path) -> BayerMaterial:
        return BayerMaterial(bank=gaussian, designed={"prescription.toml": cache.name.encode()})

    gaussian = training.trace_material(None, None, None).bank  # type: ignore[arg-type]
    monkeypatch.setattr(training, "trace_material", traced)
    row = loss_table.Row(size="l1", lab=lab, wild=wild)
    with pytest.raises(SystemExit, match="are of two lenses"):
        loss_table.measure(row, conditions(tmp_path))


def conditions(folder: Path) -> loss_table.Conditions:
    return loss_table.Conditions(
        data=None, fresh=None, sharp=None, vgg=None, minutes=1.0, samples=1, tune=0, out_dir=folder
    )
