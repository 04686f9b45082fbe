"""tools/lens/out_of_focus.py: widths are those of closed forms, and blur is not taken for haze."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.frozen_optics import FrozenOptics
from tests.bundle_factory import tiny_psf
from tests.haze_factory import tiny_haze
from tests.tiny_design import run_tool
from tools.lens import out_of_focus


def test_an_edge_behind_a_disc_is_as_wide_as_its_closed_form() -> None:
    """10 and 90 % of the area lie at -0.6870 and 0.6870 of the radius."""
    scene = out_of_focus.edge_scene(64.0)
    assert out_of_focus.edge_width_px(scene[0, 0].astype(np.float64)) == pytest.approx(
        0.6870 * 64, abs=0.3
    )


def test_an_edge_that_is_one_sample_wide_is_sharp() -> None:
    line = np.repeat([0.2, 0.6], 300)
    assert out_of_focus.edge_width_px(line) == pytest.approx(0.8, abs=1e-6)
    assert out_of_focus.edge_width_px(1 - line[::-1]) == pytest.approx(0.8, abs=1e-6)


def test_the_share_of_a_disc_is_that_of_its_samples() -> None:
    y, x = np.indices((801, 801)) - 400.0
    inside = np.hypot(x, y) <= 400
    for at in (-250.0, 0.0, 130.0):
        share = (inside & (x + at > 0)).sum() / inside.sum()
        assert out_of_focus.disc_rise(np.array([at]), 800.0)[0] == pytest.approx(share, abs=2e-3)


def test_blur_before_the_camera_is_left_as_it_is(
    hazy: str, picture: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    psf = tiny_psf(pitch_um=5.96)
    near: list[float] = []

    def frozen(lens: Any, *_: object, **__: object) -> tuple[FrozenOptics, None]:
        near.append(lens.object_distance_mm)
        return FrozenOptics(psf=psf, haze=tiny_haze(psf)), None

    monkeypatch.setattr(out_of_focus, "freeze_hazy", frozen)
    monkeypatch.setattr(out_of_focus, "EDGE_PX", (384, 96))
    monkeypatch.setattr(out_of_focus, "ROWS_PX", 32)
    monkeypatch.setattr(out_of_focus, "REACH_PX", 96)
    out = tmp_path / "out"
    run_tool(
        monkeypatch,
        "lens.out_of_focus",
        *("--bundle", hazy, "--data", picture("a"), picture("bb"), "--frame", 192, 128),
        *("--discs-px", 0, 40, "--depths-m", 0.5, "-o", out),
    )
    assert near == [500.0]
    told = json.loads((out / "focus.json").read_text("utf-8"))
    sharp, wide, traced = told["edges"]
    assert sharp["widths_px"]["filter"] < 5
    assert sharp["widths_px"]["develop"] > sharp["widths_px"]["filter"]
    assert wide["scene_px"] == pytest.approx(0.687 * 40, abs=0.5)
    assert wide["widths_px"]["filter"] == pytest.approx(wide["scene_px"], rel=0.1)
    assert (traced["kind"], traced["size"]) == ("depth", 0.5)
    # the same optics: what is traced is what the camera knows
    assert traced["widths_px"]["filter"] == pytest.approx(sharp["widths_px"]["filter"], abs=0.5)
    assert told["picture"]["psnr_db"]["filter"] > told["picture"]["psnr_db"]["develop"]
    for name in ("focus.png", "focus-picture.png"):
        assert (out / name).stat().st_size > 5_000
