"""tools/lens/whole_frames.py: errors taken apart by formula, and a table of a small camera."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.errors import ContractError
from camkit.models_def.training.kind import read_recipe
from tests.bundle_factory import tiny_psf
from tests.haze_factory import tiny_haze
from tests.tiny_design import run_tool
from tools.lens import whole_frames
from tools.lens.haze_trial import RECIPE, build


def test_level_and_detail_are_told_apart() -> None:
    even = np.full((3, 100, 150), 0.1, np.float32)
    found = whole_frames.measures(even, 10)
    assert found["db"] == pytest.approx(20, abs=1e-4)
    assert found["level"] == pytest.approx(20, abs=1e-4)
    assert found["detail"] > 60
    rows, columns = np.indices((128, 192))
    checked = np.broadcast_to(0.1 * (-1.0) ** (rows + columns), (3, 128, 192)).astype(np.float32)
    found = whole_frames.measures(checked, 10)
    assert found["detail"] == pytest.approx(20, abs=1e-4)
    assert found["level"] > 60


def test_level_is_that_of_blocks_which_the_border_may_cut() -> None:
    apart = np.random.default_rng(0).normal(size=(3, 70, 130)).astype(np.float32)
    total = 0.0
    for top in range(0, 70, 64):
        for left in range(0, 130, 64):
            block = apart[:, top : top + 64, left : left + 64]
            total += float(np.square(block.mean(axis=(1, 2))).sum() * block[0].size)
    assert whole_frames.level_square(apart) == pytest.approx(total / apart.size, rel=1e-5)


def test_rim_and_zones_lie_where_they_are() -> None:
    apart = np.full((3, 100, 100), 0.01, np.float32)
    apart[:, 10:-10, 10:-10] = 0.1
    found = whole_frames.measures(apart, 10)
    assert (found["inside"], found["rim"]) == (
        pytest.approx(20, abs=1e-4),
        pytest.approx(40, abs=1e-4),
    )
    assert found["zones"][0] == pytest.approx(20, abs=1e-4)
    assert found["zones"][4] == pytest.approx(40, abs=1e-4)
    assert whole_frames.measures(apart, 100)["inside"] is None


def test_two_bundles_without_names_of_their_own_are_refused() -> None:
    with pytest.raises(ContractError, match="duet-joint: give it a name of its own, NAME=duet-"):
        whole_frames.named_bundles(["duet", "duet-joint"])
    assert list(whole_frames.named_bundles(["duet", "seed=duet-joint"])) == ["", "seed"]


def test_black_is_taken_off_evenly() -> None:
    optics = FrozenOptics(psf=tiny_psf(), haze=tiny_haze())
    kernels = tiny_haze().kernels
    light = kernels.sum(axis=(-2, -1)) + tiny_haze().core_share
    even = (0.2 * light / kernels[0, 0, 0].size)[..., None, None]
    found = whole_frames.without_black(optics, 0.2).haze
    assert found is not None
    np.testing.assert_allclose(found.kernels, np.maximum(kernels - even, 0), atol=1e-8)
    assert (kernels < even).any()
    np.testing.assert_array_equal(found.core_share, tiny_haze().core_share)


def test_a_table_of_a_small_camera_is_made_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    psf = tiny_psf(pitch_um=5.96)
    optics = FrozenOptics(psf=psf, haze=tiny_haze(psf))
    camera = tmp_path / "c.camkit"
    build(read_recipe(RECIPE), optics, camera, terms=32, rounds=3)  # type: ignore[arg-type]
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    blocks = np.random.default_rng(0).integers(40, 220, (3, 4, 3), dtype=np.uint8)
    cv2.imwrite(str(pictures / "p.png"), cv2.resize(blocks, (48, 48), interpolation=0))
    frozen: list[int] = []

    def copy(_: Bundle, seed: int, _folder: Path) -> FrozenOptics:
        frozen.append(seed)
        return optics

    monkeypatch.setattr(whole_frames, "copy_of", copy)
    words = (camera, "--data", pictures, "--frame", 128, 96, "--rim-px", 16, "--copy", 5)
    for _ in range(2):
        run_tool(monkeypatch, "lens.whole_frames", *words, "--out-dir", tmp_path / "out")
    assert frozen == [5]
    told = json.loads((tmp_path / "out" / "whole_frames.json").read_text())
    assert set(told["rows"]) == set(whole_frames.SIMPLE)
    develop, cleared, _ = (told["rows"][name] for name in whole_frames.SIMPLE)
    assert [entry["iso"] for entry in develop] == [100, 1600]
    assert all(b["db"] > a["db"] + 2 for a, b in zip(develop, cleared, strict=True))
    assert "| wiener |" in capsys.readouterr().out


def test_a_camera_without_a_haze_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="no camera with a mosaic and a haze"):
        whole_frames.copy_of(open_bundle(find_bundle("duet")), 1, tmp_path)
