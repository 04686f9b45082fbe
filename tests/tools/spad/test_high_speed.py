"""The fan: its angle is found in pictures that show it, and every way is told of."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.runtime.kinds.spad.finer.camera import FineCamera
from tests.spad_bundle import write_spad_bundle
from tools.spad import high_speed
from tools.spad.fan import Fan
from tools.spad.high_speed import fan_before, main, ways_of

FAN = Fan(size_px=(128, 256))


@pytest.mark.parametrize("angle_deg", [0.0, 13.0, 59.0, 61.0, 118.0])
def test_the_angle_of_a_still_fan_is_found(angle_deg: float) -> None:
    angle = math.radians(angle_deg)
    found = FAN.angle_of(FAN.still(angle))
    assert math.degrees(abs(FAN.off_by(found, angle))) < 0.01


def test_a_fan_that_turns_is_found_at_its_mean_angle() -> None:
    frames, angles = FAN.frames(3)
    for picture, angle in zip(frames, angles, strict=True):
        assert math.degrees(abs(FAN.off_by(FAN.angle_of(picture), angle))) < 0.05
    assert np.diff(angles) == pytest.approx([FAN.turn_rad] * 2)


def test_blades_look_alike() -> None:
    assert FAN.off_by(math.radians(119), 0.0) == pytest.approx(math.radians(-1))
    np.testing.assert_allclose(FAN.still(0.3), FAN.still(0.3 + 2 * math.pi / 3), atol=1e-5)


def test_the_fan_turns_eighteen_degrees_a_frame(tmp_path: Path) -> None:
    fan = fan_before(FineCamera.of(write_spad_bundle(tmp_path)))
    assert math.degrees(fan.turn_rad) == pytest.approx(18)


def test_every_way_is_told_of_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(high_speed, "PHOTONS", (1000.0,))
    bundle = write_spad_bundle(tmp_path)
    out = tmp_path / "out"
    assert main(["--bundle", str(bundle.path), "--frames", "3", "--out-dir", str(out)]) == 0
    record = json.loads((out / "high-speed.json").read_text(encoding="utf-8"))
    told = {(row["plate"], row["method"]) for row in record["rows"]}
    assert told == {(True, "net S"), (True, "linear"), (False, "linear"), (False, "bicubic")}
    assert all(row["angle_rms_deg"] < 2 for row in record["rows"])
    assert record["frames_per_second"] == 1250
    assert cv2.imread(str(out / "high-speed.png")) is not None
    assert cv2.VideoCapture(str(out / "high-speed.mp4")).get(cv2.CAP_PROP_FRAME_COUNT) == 3


def test_a_network_without_a_plate_stands_beside_the_others(tmp_path: Path) -> None:
    camera = FineCamera.of(write_spad_bundle(tmp_path))
    told = [(way.plate, way.method) for way in ways_of(camera, camera)]
    assert (False, "net S") in told
    assert len(told) == 5


def test_a_bundle_without_a_network_for_no_plate_is_refused(tmp_path: Path) -> None:
    path = str(write_spad_bundle(tmp_path).path)
    with pytest.raises(SystemExit, match="has no role 'low_fill'"):
        main(["--bundle", path, "--baselines", path, "--out-dir", str(tmp_path)])
