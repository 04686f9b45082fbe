"""The gain of a bank that restores colours together, on a tiny bundle."""

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
from tools.comparison import bank_gain


def test_gains_are_told_with_their_error_by_iso_copy_and_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_wide_bundle(tmp_path)
    monkeypatch.setattr(
        bank_gain, "fabricated_optics", lambda bundle, *_, **__: bundle.frozen_optics
    )
    (tmp_path / "in").mkdir()
    for name in "ab":
        picture = np.rint(texture(80, 96, seed=ord(name)) * 255).astype(np.uint8)
        cv2.imwrite(str(tmp_path / "in" / f"{name}.png"), picture.transpose(1, 2, 0))
    recipe = tmp_path / "with.toml"
    recipe.write_text(f"[wiener]\n\n{bank_table(TOGETHER)}", encoding="utf-8")
    out = tmp_path / "found" / "bank.json"
    words = [str(recipe), "--bundle", str(bundle.path), "--data", str(tmp_path / "in")]
    bank_gain.main([*words, "--places", "2", "-o", str(out)])
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["captures"] == 2 * 2 * 2
    assert set(found["psnr_db"]) == {"alone", "together", "admm_tv"}
    whole = found["gain_db"]["alone"]["mean"]
    # levels are kept to four digits
    assert whole == pytest.approx(
        found["psnr_db"]["together"] - found["psnr_db"]["alone"], abs=0.01
    )
    assert set(found["by_iso"]) == {"100", "1600"}
    assert set(found["by_copy"]) == {"2001", "2002"}
    of_iso = [part["alone"]["mean"] for part in found["by_iso"].values()]
    assert np.mean(of_iso) == pytest.approx(whole, abs=1e-3)


def test_a_recipe_without_the_model_is_refused(tmp_path: Path) -> None:
    recipe = tmp_path / "plain.toml"
    recipe.write_text("[wiener]\nprior_scale = 1.0\n", encoding="utf-8")
    with pytest.raises(ContractError, match=r"no table \[wiener.together\]"):
        bank_gain.together_of(recipe)
