"""The gain of a bank that works from the samples of the mosaic, on a tiny bundle."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.training.bank_fitting import bank_table
from tests.psf_factory import texture
from tests.together_factory import TOGETHER
from tests.wide_bundle import write_wide_bundle
from tools.comparison import mosaic_gain


@pytest.mark.parametrize("size", [None, "M"])
def test_gains_are_told_by_place_and_iso_beside_the_cost(
    size: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_wide_bundle(tmp_path)
    monkeypatch.setattr(
        mosaic_gain, "fabricated_optics", lambda bundle, *_, **__: bundle.frozen_optics
    )
    for name, value in {"ISOS": (100.0,), "PLACES": (0, 3), "ROUNDS": 1}.items():
        monkeypatch.setattr(mosaic_gain, name, value)
    (tmp_path / "in").mkdir()
    for name in "ab":
        picture = np.rint(texture(80, 96, seed=ord(name)) * 255).astype(np.uint8)
        cv2.imwrite(str(tmp_path / "in" / f"{name}.png"), picture.transpose(1, 2, 0))
    recipe = tmp_path / "with.toml"
    near = "[wiener.mosaic]\nwithin_mm = 0.05\n"
    recipe.write_text(f"[wiener]\n\n{bank_table(TOGETHER)}\n{near}", encoding="utf-8")
    out = tmp_path / "found" / "mosaic.json"
    words = ["--recipe", str(recipe), "--bundle", str(bundle.path), "--data", str(tmp_path / "in")]
    behind = [] if size is None else ["--size", size]
    mosaic_gain.main([*words, *behind, "-o", str(out)])
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["behind"] == size
    assert found["captures"] == 2 * 2
    assert set(found["by_place"]) == {"0", "0.75"}
    far = found["by_place"]["0.75"]["100"]
    assert far["mosaic"]["mean"] == 0
    assert far["everywhere"]["mean"] != 0
    assert found["gain_db"]["everywhere"]["mean"] == pytest.approx(
        found["psnr_db"]["everywhere"] - found["psnr_db"]["together"], abs=0.01
    )
    assert {part for way in found["cpu_ms"].values() for part in way} == {"block", "place"}


def test_a_recipe_without_a_mosaic_is_refused(tmp_path: Path) -> None:
    bundle, recipe = write_wide_bundle(tmp_path), tmp_path / "plain.toml"
    recipe.write_text("[wiener]\nprior_scale = 1.0\n", encoding="utf-8")
    with pytest.raises(ContractError, match=r"no tables \[wiener.together\]"):
        mosaic_gain.ways_of(bundle, recipe)
