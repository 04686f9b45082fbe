"""tools/lens/plate_pinhole.py: denoisers lower noise and keep the level; the table is whole."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.tiny_design import run_tool
from tools.lens import plate_pinhole


@pytest.mark.parametrize("name", list(plate_pinhole.DENOISERS))
def test_a_denoiser_lowers_the_noise_and_keeps_the_level(name: str) -> None:
    noise = np.random.default_rng(0).normal(0, 0.2, (3, 48, 64)).astype(np.float32)
    smooth = plate_pinhole.denoised(np.float32(0.3) + noise, name, 1.0)
    assert smooth.std() < 0.5 * noise.std()
    assert smooth.mean() == pytest.approx(0.3 + noise.mean(), abs=0.01)


def test_the_noise_is_found_on_a_ramp() -> None:
    noise = np.random.default_rng(0).normal(0, 0.2, (3, 60, 80))
    ramp = np.arange(80) / 20 + np.arange(60)[:, None] / 10
    assert plate_pinhole.noise_of((ramp + noise).astype(np.float32)) == pytest.approx(0.2, rel=0.03)


def test_plate_and_pinhole_are_exposed_alike(
    hazy: str,
    clear: str,
    picture: Callable[[str], Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    honest = plate_pinhole.open_camera
    monkeypatch.setattr(
        plate_pinhole,
        "open_camera",
        lambda name, folder: honest(clear if name.startswith("pinhole") else name, folder),
    )
    monkeypatch.setattr(plate_pinhole, "STRENGTHS", (0.5, 2.0))
    out = tmp_path / "out"
    run_tool(
        monkeypatch,
        "lens.plate_pinhole",
        *("--bundle", hazy, "--data", picture("a"), "--tune", picture("bb")),
        *("--frame", 128, 96, "--times", 1, "-o", out),
    )
    told = json.loads((out / "pinhole.json").read_text("utf-8"))
    assert told["pinhole_light"] == pytest.approx((0.8 / 23.4) ** 2, rel=0.03)
    (row,) = told["rows"]
    assert row["plate"]["iso"] == 100
    assert (row["pinhole"]["iso"], row["plate"]["white"]) == (6400, 1)
    assert row["pinhole"]["white"] == pytest.approx(64 * told["pinhole_light"], rel=1e-3)
    assert set(row["strengths"]) == set(plate_pinhole.DENOISERS)
    db = row["psnr_db"]
    assert db["plate filter"] > db["plate developed"] + 2
    assert db["pinhole developed"] < max(db[f"pinhole {n}"] for n in plate_pinhole.DENOISERS) - 2
    assert (out / "pinhole.png").stat().st_size > 5_000


@pytest.mark.parametrize("name", ["duet", "pinhole-0"])
def test_what_is_no_pinhole_is_refused_in_one_line(
    hazy: str,
    picture: Callable[[str], Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
) -> None:
    with pytest.raises(SystemExit, match="a pinhole is"):
        run_tool(
            monkeypatch,
            "lens.plate_pinhole",
            *("--bundle", hazy, "--pinhole", name, "--data", picture("a"), "--tune", picture("b")),
            *("-o", tmp_path / "out"),
        )
