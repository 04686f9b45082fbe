"""Refocusing stretches arms as geometry has it; what is lost is told against the frozen depth."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.frozen_optics import psf_of_streaks
from camkit.bundle.reader import Bundle
from camkit.models_def.optics.diffraction.plate import Plate, plate_members, read_plate
from camkit.report.kinds.hdr.lights import stretched
from camkit.runtime.kinds.hdr.night import night_scene
from tests.hdr_bundle import write_hdr_bundle
from tests.tiny_design import run_tool
from tools.hdr import depths
from tools.hdr.depths import Refocused


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return write_hdr_bundle(tmp_path, members=plate_members(read_plate(Path("streak-4"))))


def _by_stretching(plate: Plate, bundle: Bundle, depth_mm: float) -> Refocused:
    """Stand in for waves: the arms that the bundle knows, as much longer as the sensor is away."""
    moved = replace(plate.bench, focus_mm=depth_mm).distance_mm
    streaks = stretched(bundle.streaks, moved / plate.bench.distance_mm)
    return Refocused(
        depth_mm=depth_mm, distance_mm=moved, psf=psf_of_streaks(streaks, 3), streaks=streaks
    )


def _end_px(camera: Refocused) -> float:
    """Give where the arms have fallen to half of their plateau."""
    arms = camera.streaks.profiles[0, 0].mean(axis=0, dtype=np.float64)
    half = np.median(arms[60:100]) / 2
    last = int(np.flatnonzero(arms > half).max())
    return last + float((arms[last] - half) / (arms[last] - arms[last + 1]))


def test_arms_reach_as_much_farther_as_the_sensor_is_moved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.hdr_bundle.WAVELENGTHS_UM", (0.55,))
    plate = read_plate(Path("streak-4"))
    bundle = write_hdr_bundle(tmp_path, members=plate_members(plate))
    near, usual = (depths.refocused(plate, bundle, far_mm) for far_mm in (1000.0, 5000.0))
    assert near.distance_mm == pytest.approx(1 / (1 / 50 - 1 / 1000))
    longer = near.distance_mm / usual.distance_mm
    assert longer == pytest.approx(1.042, abs=1e-3)
    assert _end_px(near) / _end_px(usual) == pytest.approx(longer, abs=6e-3)
    for camera in (near, usual):
        np.testing.assert_allclose(camera.psf.kernels.sum((-2, -1)), 1.0, atol=1e-5)
        np.testing.assert_array_equal(camera.psf.depths_mm, bundle.psf.depths_mm)


def test_drops_are_told_against_the_depth_of_the_bundle(
    bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.setattr(depths, "refocused", _by_stretching)
    monkeypatch.setattr(depths, "NIGHT_PX", 160)
    picture, out = tmp_path / "lit.hdr", tmp_path / "found.json"
    light = night_scene(3, 160, 160).transpose(1, 2, 0)
    assert cv2.imwrite(str(picture), np.ascontiguousarray(light[..., ::-1]))
    words = ("--bundle", bundle.path, "--seeds", 2, "--pictures", picture, "-o", out)
    assert run_tool(monkeypatch, "hdr.depths", *words, "--depths-m", 0.2, "inf") == 0
    record = json.loads(out.read_text())
    assert record["bundle_sha256"] == bundle.sha256
    assert record["methods"] == ["physics"]
    near, frozen, far = record["depths"]
    assert frozen["arms_longer_percent"] == 0
    assert near["arms_longer_percent"] > 25
    assert far["arms_longer_percent"] == pytest.approx(-1.0, abs=0.01)
    for name in ("night", "pictures"):
        own = near["sets"][name]["frozen"]["physics"]
        assert own["worst_drop_db"] >= own["drop_db"]
        assert frozen["sets"][name]["frozen"]["physics"]["drop_db"] == 0
        lost = near["sets"][name]["frozen"]["physics"]["drop_db"]
        assert lost > near["sets"][name]["told"]["physics"]["drop_db"]
    said = capsys.readouterr().out
    assert "| infinity | -1.0 % |" in said
    assert "pictures" in said


def test_a_camera_without_streaks_is_refused_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SystemExit, match=r"duet holds no streaks\.safetensors"):
        run_tool(monkeypatch, "hdr.depths", "--bundle", "duet")


def test_a_size_that_is_not_held_is_refused(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit, match=r"holds size\(s\) none; asked for M"):
        run_tool(monkeypatch, "hdr.depths", "--bundle", bundle.path, "--sizes", "M")
