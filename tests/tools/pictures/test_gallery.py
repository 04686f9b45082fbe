"""The pictures of README and gallery: each camera's view, its files, and the chart."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.bundle_factory import write_tiny_bundle
from tests.hdr_bundle import write_hdr_bundle
from tools.hdr import night_gallery as nights
from tools.pictures import gallery, views

SIDE = 24


def write_scene(folder: Path) -> None:
    pixels = np.random.default_rng(3).integers(0, 256, (28, 36, 3), np.uint8)
    cv2.imwrite(str(folder / "scene.png"), pixels)


def check(view: views.View, side: int) -> None:
    for pictures in view.rows.values():
        assert [name.partition(": ")[0] for name in pictures] == ["as taken", "restored", "truth"]
        assert {picture.shape for picture in pictures.values()} == {(3, side, side)}


def test_a_photograph_is_taken_restored_and_cut_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_scene(tmp_path)
    monkeypatch.setattr(views, "SCENES", tmp_path)
    monkeypatch.setattr(views, "SIDE_PX", SIDE)
    monkeypatch.setattr(views, "BORDER_PX", 2)
    view = views.Photograph(scene="scene.png", subject="Noise", middle=(0.9, 0.1))
    made = view(str(write_tiny_bundle(tmp_path)))
    check(made, SIDE)
    assert "Noise" in next(iter(made.rows))


def test_a_night_is_shown_at_every_exposure_and_a_windshield_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(nights, "SIDES_PX", (96, 128))
    monkeypatch.setattr(views, "SIDE_PX", SIDE)
    night = views.Night(stops=(0, -4))(str(write_hdr_bundle(tmp_path).path))
    check(night, SIDE)
    bright, dark = (pictures["truth"] for pictures in night.rows.values())
    assert len(night.rows) == 2
    assert dark.mean() < bright.mean()
    windshield = views.Windshield(seed=6, angle_deg=5.0)("deglare")
    check(windshield, SIDE)
    before, after = (float(name.split()[-2]) for name in list(*windshield.rows.values())[:2])
    assert after > before + 3


def test_photons_are_counted_and_made_finer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_scene(tmp_path)
    monkeypatch.setattr(views, "SCENES", tmp_path)
    view = views.Photons(scene="scene.png", subject="Noise", photons=3000.0)("spad-sr")
    ((title, pictures),) = view.rows.items()
    assert "64x32" in title
    assert {picture.shape for picture in pictures.values()} == {(3, 128, 256)}


def test_the_command_writes_a_view_a_small_one_and_the_chart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = np.full((3, 120, 150), 0.5, np.float32)
    rows = {"A scene": {"as taken: 1.0 dB": picture, "restored: 2.0 dB": picture, "truth": picture}}
    made = views.View(title="toy 1.0", rows=rows)
    monkeypatch.setattr(gallery, "VIEWS", {"toy": lambda _: made})
    monkeypatch.setattr(
        gallery, "write_front_chart", lambda path, _: path.write_bytes(b"front of methods")
    )
    monkeypatch.setattr(sys, "argv", ["gallery", "-o", str(tmp_path), "toy"])
    gallery.main()
    small = cv2.imread(str(tmp_path / "toy-small.jpg"))
    assert small is not None
    assert small.shape == (gallery.SMALL_PX[0], 2 * gallery.SMALL_PX[1] + gallery.GAP_PX, 3)
    assert cv2.imread(str(tmp_path / "toy.jpg")) is not None
    assert (tmp_path / "front.png").read_bytes() == b"front of methods"
    assert "kB in all" in capsys.readouterr().out
