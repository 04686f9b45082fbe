"""What the focus of a unit is worth, on a small camera whose copies differ in nothing else."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle
from camkit.models_def.training.bank_fitting import bank_table
from camkit.runtime.bank.psf import _in_focus
from tests.focus_bundle import write_focus_bundle
from tests.psf_factory import texture
from tests.together_factory import TOGETHER
from tools.capture.simulated import color_sensor
from tools.comparison import unit_focus
from tools.comparison.copies import transfer_error

FOCUS_UM = {1: 30.0, 2: 0.0, 3: -25.0}


def _copy(bundle: Bundle, copy: int, **_: Any) -> FrozenOptics:
    """A copy of the camera with a focus of its own."""
    kernels = np.asarray(_in_focus(bundle.psf, FOCUS_UM[copy]), np.float32)
    psf = replace(bundle.psf, kernels=kernels, focus_um=None, focus_kernels=None)
    return FrozenOptics(psf=psf)


def test_copies_are_measured_and_what_they_gain_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_focus_bundle(tmp_path)
    monkeypatch.setattr(unit_focus, "fabricated_optics", _copy)
    monkeypatch.setattr(unit_focus, "refocusable", lambda bundle, _: (bundle, 40.0))
    monkeypatch.setattr(unit_focus, "blend_errors", lambda *_: {})
    monkeypatch.setattr(unit_focus, "TARGET_SHARES", (0.0, 0.9))
    (tmp_path / "in").mkdir()
    for name in "ab":
        picture = np.rint(texture(96, 112, seed=ord(name)) * 255).astype(np.uint8)
        cv2.imwrite(str(tmp_path / "in" / f"{name}.png"), picture.transpose(1, 2, 0))
    recipe = tmp_path / "with.toml"
    recipe.write_text(f"[wiener]\n\n{bank_table(TOGETHER)}", encoding="utf-8")
    out = tmp_path / "found" / "unit.json"
    words = ["--bundle", str(bundle.path), "--data", str(tmp_path / "in"), "--recipe", str(recipe)]
    unit_focus.main([*words, "--copies", "1", "2", "--outliers", "3", "-o", str(out)])
    found = json.loads(out.read_text(encoding="utf-8"))
    assert (found["kernels_to_um"], found["pictures"]) == (40.0, 2)
    one, two = found["copies"]["each"]
    (three,) = found["outliers"]["each"]
    assert one["focus_um"] == pytest.approx(30, abs=1)
    assert three["focus_um"] == pytest.approx(-25, abs=1)
    assert "from the nominal one" in two["why"]
    for judged in (one, three):
        assert judged["transfer_error"]["unit"] < 0.2 * judged["transfer_error"]["nominal"]
        assert judged["gain"]["alone"]["mean_db"] > 0.05
        assert judged["gain"]["alone"]["captures"] == 4
        assert judged["gain"]["alone"]["se_db"] > 0
    assert two["gain"]["together"]["mean_db"] == 0
    mean = (one["gain"]["together"]["mean_db"] + 0) / 2
    assert found["copies"]["gain"]["together"]["mean_db"] == pytest.approx(mean, abs=1e-3)


def test_without_captures_there_is_no_gain() -> None:
    assert unit_focus.gain((), ()) is None
    assert unit_focus.gain((0.5,), (1,)) == {"mean_db": 0.5, "se_db": None, "captures": 1}


def test_kernels_of_a_moved_sensor_join_a_built_in_bundle() -> None:
    from camkit.bundle.reader import find_bundle, open_bundle

    bundle, reach_um = unit_focus.refocusable(open_bundle(find_bundle("duet")), 30.0)
    assert reach_um == 30.0
    assert bundle.psf.focus_um is not None
    assert bundle.psf.focus_um.tolist() == [-30.0, 30.0]
    assert transfer_error(bundle.psf, bundle.psf, color_sensor(bundle)) == 0
    moved = transfer_error(bundle.psf, bundle.psf, color_sensor(bundle), focus_um=20.0)
    assert moved > 0.03
    blend = unit_focus.blend_errors(bundle, reach_um)
    assert set(blend) == {"-15", "15"}
    for errors in blend.values():
        assert errors["linear"] < errors["nominal"] / 5
