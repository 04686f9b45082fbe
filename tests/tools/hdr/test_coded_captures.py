"""Scenes whose truth is known: response, shift, gain and PSF are found, and lights come back."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.data_folder import data_path
from tests.tools.hdr import coded_scene_factory as known
from tools.hdr import coded_captures, coded_judge, coded_optics, coded_registration, coded_scene

LIGHT_TOLERANCE = 0.02
"""Of light, and of exposures in stops: what codes of 8 bits leave open."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with one scene."""
    home = tmp_path_factory.mktemp("coded")
    known.write_scene(home / "lamps")
    return home


@pytest.fixture(scope="module")
def scene(folder: Path) -> coded_scene.CodedScene:
    """Give the scene as it is read."""
    return coded_scene.read_scene(folder / "lamps")


def test_light_is_found_from_codes_alone(scene: coded_scene.CodedScene) -> None:
    truth = known.true_light()
    stops = dict(zip(known.STOPS, scene.facts["stops_measured"], strict=True))
    bright = truth > 0.05
    misses = scene.facts["disagreement_codes"]
    assert abs(scene.black_offset - known.OFFSET) <= 0.1
    assert all(abs(stops[name] - true) < LIGHT_TOLERANCE for name, true in known.STOPS.items())
    assert np.abs(scene.reference / truth - 1)[bright].max() < LIGHT_TOLERANCE
    assert np.abs(np.median((scene.reference / truth)[bright]) - 1) < 0.01
    assert misses["linear_with_offset"] < min(misses["linear"], misses["srgb"])
    assert scene.clipping_codes.tolist() == [253, known.GREEN_END, 253]
    assert (scene.clipped == (scene.capture >= scene.levels[:, None, None])).all()


def test_colours_that_are_not_mixed_end_full() -> None:
    light = np.stack([known.true_light()[n] * g for n, g in enumerate((1, 0.9, 0.8))])
    assert coded_scene.clipping_codes(known.codes_of(light, mixed=False)).tolist() == [253] * 3


@pytest.mark.parametrize("way", ["as stated", "half turn"])
def test_the_way_to_hold_the_psf_is_told_by_the_capture(
    scene: coded_scene.CodedScene, way: str
) -> None:
    psf = known.dual_peak()
    seen = np.clip(
        coded_optics.seen_through(known.laid_light(), coded_optics.TURNS[way](psf)), 0, 1
    )
    other = replace(scene, capture=seen, clipped=seen >= 1)
    where = coded_registration.around_light(other.clipped)
    found, misfits = coded_captures.best_turn(other, psf, where)
    assert found == way
    assert misfits[way] < 0.5 * min(m for name, m in misfits.items() if name != way)


def test_a_reference_is_laid_on_the_capture_and_explains_it(
    scene: coded_scene.CodedScene,
) -> None:
    psf = known.dual_peak()
    where = coded_registration.around_light(scene.clipped)
    expected = coded_optics.seen_through(scene.reference, psf)
    laid = coded_registration.lay(scene.capture, expected, where)
    told = coded_optics.explained(scene.capture, laid.on(scene.reference), psf, where)
    assert np.allclose(laid.shift_px, known.SHIFT_PX, atol=0.15)
    assert np.allclose(laid.gain, known.GAIN, atol=0.02)
    for part in ("core", "peak", "opposite"):
        assert np.allclose(told["factors"][part], 1, atol=0.1), part
    assert max(told["misfit_as_stated"]) < 0.05


def test_blocks_say_where_a_picture_lies_elsewhere() -> None:
    rng = np.random.default_rng(5)
    one = np.abs(rng.normal(0.3, 0.1, (3, 256, 256))).astype(np.float32)
    other = one.copy()
    other[:, 128:, 128:] = np.roll(one, (3, -4), (1, 2))[:, 128:, 128:]
    found = coded_registration.local_shifts(other, one, np.zeros(one.shape, bool))
    assert found == [[0, 0, 0, 0], [0, 128, 0, 0], [128, 0, 0, 0], [128, 128, 3, -4]]


def test_background_goes_and_the_core_comes_to_the_middle() -> None:
    psf = known.dual_peak()
    level = 0.1 / psf[0].size
    spoilt = np.roll(0.9 * psf, (1, -1), (1, 2)) + np.float32(level)
    clean, facts = coded_optics.cleaned_psf(spoilt)
    assert np.allclose(facts["background_share"], 0.1, atol=0.02)
    assert np.allclose(facts["core_off_middle_px"], (1, -1), atol=0.05)
    assert np.abs(clean - psf).max() < 0.03 * psf.max()
    assert np.allclose(clean.sum(axis=(1, 2)), 1, atol=1e-5)


def test_lights_come_back_and_pictures_are_written(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out, pictures = tmp_path / "found.json", tmp_path / "pictures"
    arguments = ["coded_captures", str(folder), "-o", str(out), "--out-dir", str(pictures)]
    monkeypatch.setattr(sys, "argv", arguments)
    coded_captures.main()
    scene = json.loads(out.read_text())["scenes"]["lamps"]
    frame = scene["scores"]["frame"]
    sheet = cv2.imread(str(pictures / "lamps.png"))
    assert sheet is not None
    assert sheet.shape[1] % len(coded_captures.SHOWN) == 0
    assert frame["solve"]["stops_rmse"] < frame["capture"]["stops_rmse"] - 0.5
    assert frame["solve"]["hdr_psnr_db"] > frame["capture"]["hdr_psnr_db"] + 2
    assert abs(frame["solve"]["hdr_psnr_db"] - frame["simulated solve"]["hdr_psnr_db"]) < 2
    assert scene["explained"]["psnr_db"] > 30
    assert "| simulated solve |" in capsys.readouterr().out


def test_a_peak_of_its_own_is_told_apart_from_the_ceiling() -> None:
    truth = np.full((3, 32, 32), 0.1, np.float32)
    truth[:, 10:20, 10:20] = 16
    clipped = truth > 1
    seen = coded_judge.Seen.of(np.minimum(truth, 1), clipped, np.ones(3, np.float32))
    judge = coded_judge.Judge(seen, truth, {"all": (slice(None),) * 3})
    judge.add("capture", seen.light)
    scores = judge.scores["all"]["capture"]
    assert scores["hdr_psnr_db"] - scores["own_peak_psnr_db"] == pytest.approx(24.08, abs=0.02)
    assert scores["clipped_light_ratio"] == pytest.approx(1 / 16, abs=0.005)


def test_lights_whose_peaks_are_hidden_keep_what_they_started_from() -> None:
    light = np.full((3, 160, 160), 0.1, np.float32)
    light[:2, 60:100, 60:100] = 20
    ends, found = np.full(3, 253), {}
    for name, psf in (
        ("peaks", known.dual_peak()),
        ("star", coded_judge.star_psf(known.dual_peak())),
    ):
        found[name] = coded_judge.light_by_start(coded_judge.simulated(light, psf, ends, 0.0), psf)
    assert found["peaks"][2] is None
    assert max(f for f in found["peaks"][:2] if f is not None) < 0.5
    assert min(f for f in found["star"][:2] if f is not None) > 0.7


def test_a_star_has_its_share_in_its_arms() -> None:
    star = coded_judge.star_psf(known.dual_peak())
    half = star.shape[1] // 2
    core = star[:, half - 7 : half + 8, half - 7 : half + 8].sum(axis=(1, 2))
    assert np.allclose(star.sum(axis=(1, 2)), 1, atol=1e-5)
    assert np.allclose(core, 1 - coded_judge.STAR_SHARE, atol=0.015)
    assert np.allclose(star, star[:, ::-1, ::-1], atol=1e-4)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: (f / "lamps" / "wPSF_0_stop.png").unlink(), "expected folders in it"),
        (lambda f: (f / "MeasuredPSF.npz").write_bytes(b"no"), "expected an npz file"),
        (lambda f: np.savez(f / "MeasuredPSF.npz", psf_val=np.ones((4, 4, 1, 3))), "n odd"),
        (lambda f: np.savez(f / "MeasuredPSF.npz", psf_val=np.zeros((3, 3, 1, 3))), "finite"),
        (
            lambda f: [file.unlink() for file in (f / "lamps").glob("woutPSF_*")],
            "expected one wPSF",
        ),
        (
            lambda f: (f / "lamps" / "woutPSF_0.00_stop.png").rename(
                f / "lamps" / "woutPSF_x_stop.png"
            ),
            "expected stops",
        ),
        (
            lambda f: (f / "lamps" / "woutPSF_0.00_stop.png").write_bytes(b"no"),
            "three colours of 8 bits",
        ),
        (
            lambda f: cv2.imwrite(
                str(f / "lamps" / "wPSF_0_stop.png"), np.zeros((20, 20, 3), np.uint8)
            ),
            "differ in size",
        ),
        (
            lambda f: cv2.imwrite(
                str(f / "lamps" / "wPSF_0_stop.png"),
                np.zeros((known.SIDE_PX, known.SIDE_PX, 3), np.uint8),
            ),
            "nothing clipped",
        ),
    ],
)
def test_what_cannot_be_read_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, spoil: object, message: str
) -> None:
    known.write_scene(tmp_path / "lamps")
    assert callable(spoil)
    spoil(tmp_path)
    monkeypatch.setattr(sys, "argv", ["coded_captures", str(tmp_path)])
    with pytest.raises(SystemExit, match=message) as refused:
        coded_captures.main()
    assert "\n" not in str(refused.value)


def test_too_few_common_pixels_leave_the_stated_stops() -> None:
    frames = [np.full((3, 20, 20), code, np.uint8) for code in (255, 100, 50)]
    found = coded_scene.measured_stops(frames, np.array([4.0, 2.0, 0.9]), 0.0)
    assert found.tolist() == [0.0, -2.0, -3.0]


def test_frames_that_share_nothing_or_are_alike_tell_no_offset() -> None:
    rng = np.random.default_rng(1)
    one = rng.integers(20, 200, (3, 40, 40)).astype(np.uint8)
    dark = np.zeros_like(one)
    even = np.full_like(one, 90)
    for frames, stops in (([one, dark[:, :1]], (1.0, 0.0)), ([even, even // 2], (1.0, 0.0))):
        shapes_alike = frames[0][:, : frames[1].shape[1]]
        assert coded_scene.black_offset([shapes_alike, frames[1]], np.array(stops)) == 0
    assert coded_scene.black_offset([one, one], np.array([0.05, 0.0])) == 0


def test_a_sheet_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "x.png").mkdir()
    with pytest.raises(OSError, match="cannot write"):
        coded_captures.write_sheet(tmp_path / "x.png", {"x": np.zeros((3, 8, 8), np.float32)})


def test_real_captures_are_linear_with_green_that_ends_below() -> None:
    folder = data_path("hdr_coded")
    scene = coded_scene.read_scene(folder / "David")
    _, facts = coded_optics.cleaned_psf(coded_optics.read_psf(folder / "MeasuredPSF.npz"))
    misses = scene.facts["disagreement_codes"]
    assert misses["linear_with_offset"] < min(misses["linear"], misses["estimate"])
    assert misses["estimate"] < misses["srgb"]
    assert scene.clipping_codes.tolist() == [253, 231, 253]
    assert scene.reference.max() > 64
    assert facts["background_share"][1] > 0.03
