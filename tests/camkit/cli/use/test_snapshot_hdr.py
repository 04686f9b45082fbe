"""A night photographed through a plate and read back, by the commands that people type."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.runtime.files.picture import read_scene
from tests.hdr_bundle import write_hdr_bundle

LAMPS = ((60, 90, 2.5, 80.0), (130, 180, 2.0, 150.0))
"""(y, x, size, light) of two round lamps."""


@pytest.fixture
def street(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, camkit_command) -> Path:
    """The current folder, with a lamp above a dim street, its capture and what is true of it."""
    monkeypatch.chdir(tmp_path)
    write_hdr_bundle(tmp_path)
    scene = np.full((192, 256, 3), 0.1, np.float32)
    scene[96:] = 0.2
    y, x = np.indices(scene.shape[:2])
    for at_y, at_x, size, light in LAMPS:
        far = np.hypot(y - at_y, x - at_x) / size
        scene += light * np.exp(-0.5 * far**2)[:, :, None].astype(np.float32)
    cv2.imwrite("scene.hdr", scene)
    call = ("simulate", "scene.hdr", "--bundle", "streaks.camkit", "-o", "night.dng")
    outcome = camkit_command(*call, "--truth", "truth.exr")
    assert outcome.code == 0, outcome.err
    return tmp_path


def _processed(camkit_command, name: str, *options: object) -> np.ndarray:
    call = ("process", "night.dng", "--out-dir", name, "--bundle", "streaks.camkit", *options)
    outcome = camkit_command(*call)
    assert outcome.code == 0, outcome.err
    return read_scene(f"{name}/night.exr")


def _db(found: np.ndarray, truth: np.ndarray) -> float:
    gap = np.clip(found, 0, 256) - np.minimum(truth, 256)
    return float(10 * np.log10(256**2 / np.mean(gap**2, dtype=np.float64)))


def test_lamps_are_read_from_their_streaks_and_the_sidecar_says_so(street, camkit_command) -> None:
    truth = read_scene("truth.exr")
    developed = camkit_command("process", "night.dng", "--out-dir", "plain", "--bundle", "none")
    assert developed.code == 0, developed.err
    plain = read_scene("plain/night.exr")
    lit = _processed(camkit_command, "lit")
    assert lit.max() > 20 > plain.max()
    for y, x, _, _ in LAMPS:
        here = np.s_[:, y - 12 : y + 13, x - 12 : x + 13]
        assert lit[here].sum() == pytest.approx(truth[here].sum(), rel=0.2)
        assert plain[here].sum() < 0.2 * truth[here].sum()
    assert _db(lit, truth) > _db(plain, truth) + 4
    sidecar = json.loads(Path("lit/night.camkit.json").read_text())
    told = sidecar["hdr"]
    assert "hdr" not in sidecar["plan"]
    assert set(told) == {
        "regions",
        "saturated_fraction",
        "clipped_streak_fraction",
        "unexplained",
        "peak",
        "window_fraction",
        "fallbacks",
    }
    assert told["regions"] >= 1
    assert told["peak"] > 20


def test_threads_memory_and_method_change_no_byte_of_the_picture(street, camkit_command) -> None:
    one = _processed(camkit_command, "one", "--threads", 1)
    for name, options in (
        ("two", ("--threads", 2)),
        ("small", ("--max-mem", "400M")),
        ("physics", ("--method", "physics")),
    ):
        np.testing.assert_array_equal(_processed(camkit_command, name, *options), one)


def test_a_lamp_at_the_border_is_warned_of(street, camkit_command) -> None:
    scene = np.full((192, 256, 3), 0.1, np.float32)
    scene[:6, 100:108] = 60
    cv2.imwrite("edge.hdr", scene)
    made = camkit_command(
        "simulate", "edge.hdr", "--bundle", "streaks.camkit", "-o", "edge.dng", "--overwrite"
    )
    assert made.code == 0, made.err
    told = json.loads(
        camkit_command("process", "edge.dng", "--bundle", "streaks.camkit", "--json").out
    )
    assert told["status"] == "ok"
    assert any("a light reaches the border of the picture" in note for note in told["warnings"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--depth-m", 1.0), "knows the one depth 5 m"),
        (("--method", "wiener"), "method must be one of physics"),
        (("--method", "net"), "method must be one of physics"),
    ],
)
def test_what_the_camera_cannot_do_is_refused_in_one_line(
    street, camkit_command, options: tuple[object, ...], message: str
) -> None:
    outcome = camkit_command("process", "night.dng", "--bundle", "streaks.camkit", *options)
    assert outcome.code != 0
    assert message in outcome.err
    assert outcome.err.count("\n") == 1
    assert not Path("night.exr").exists()
