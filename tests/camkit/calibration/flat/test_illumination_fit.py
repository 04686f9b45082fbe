"""A lens that is known comes back from noisy pictures of an uneven display."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from camkit.calibration.flat.illumination_fit import FlatFacts, measure_flat
from camkit.errors import ContractError, DecodeError
from camkit.runtime.output.dng import camkit_description
from tests.camkit.calibration.display_factory import GOOD, Flats, Shift

TOLERANCE = 0.01
PITCH_UM = 5.0
LENS = Flats(centre=(0.02, -0.03))


def _error(facts: FlatFacts, lens: Flats = LENS) -> float:
    radius = facts.heights_mm / (lens.radius_px * PITCH_UM / 1000)
    return float(np.abs(facts.relative_illumination / lens.lens(radius) - 1).max())


def _measured(files: list[Path], shifts: Sequence[Shift], lens: Flats = LENS) -> FlatFacts:
    return measure_flat(files, *lens.said(shifts), pixel_pitch_um=PITCH_UM)


def test_raw_pictures_give_vignetting_to_one_percent(tmp_path: Path) -> None:
    facts = _measured(LENS.write(tmp_path), GOOD)
    assert facts.separated
    assert facts.notes == ()
    assert _error(facts) < TOLERANCE
    assert facts.relative_illumination[-1] < 0.55
    assert facts.heights_mm[0] == 0
    assert facts.relative_illumination[0] == 1
    x, y = ((n - 1) / 2 + c * LENS.radius_px for n, c in zip((360, 240), LENS.centre, strict=True))
    assert facts.centre_px == pytest.approx((x, y), abs=1.0)
    assert 0.3 < facts.display < 0.6
    assert facts.rest < 0.004  # noise of blocks of 8x8 pixels is 0.26 %


def test_heights_end_where_the_pictures_end(tmp_path: Path) -> None:
    facts = _measured(LENS.write(tmp_path), GOOD)
    corner_mm = (LENS.radius_px * (1 + math.hypot(*LENS.centre))) * PITCH_UM / 1000
    assert 0.95 * corner_mm < facts.heights_mm[-1] < corner_mm


def test_linear_pictures_do_too(tmp_path: Path) -> None:
    facts = _measured(LENS.write_planes(tmp_path, GOOD), GOOD)
    assert facts.separated
    assert _error(facts) < TOLERANCE
    assert facts.rest < 0.001


def test_one_picture_is_a_guess_and_says_so(tmp_path: Path) -> None:
    (file,) = LENS.write(tmp_path, GOOD[:1])
    facts = measure_flat([file], None, None, pixel_pitch_um=PITCH_UM)
    assert not facts.separated
    assert "one picture does not tell the lens" in facts.notes[0]
    assert _error(facts) > TOLERANCE


def test_turns_alone_say_so_too(tmp_path: Path) -> None:
    turns: list[Shift] = [(0, 0, 0), (0, 0, 90), (0, 0, 180)]
    lens = Flats()
    facts = _measured(lens.write(tmp_path, turns), turns, lens)
    assert not facts.separated
    assert "these poses do not tell" in facts.notes[0]
    assert _error(facts, lens) > TOLERANCE


def test_a_turn_is_known_from_the_orientation_of_the_files(tmp_path: Path) -> None:
    # to be turned 90 degrees counterclockwise to stand upright, so it lies turned clockwise
    files = LENS.write(tmp_path, GOOD, orientations=(1, 1, 1, 8))
    facts = measure_flat(files, LENS.said(GOOD)[0], None, pixel_pitch_um=PITCH_UM)
    assert [round(math.degrees(pose.turn_rad)) for pose in facts.poses] == [0, 0, 0, 90]
    assert _error(facts) < TOLERANCE


def test_poses_counted_the_other_way_are_refused(tmp_path: Path) -> None:
    files = LENS.write_planes(tmp_path, GOOD)
    for sign_x, sign_turn, what in ((-1, 1, "the shifts"), (1, -1, "the turns"), (-1, -1, "shifts and turns")):  # noqa: E501 # fmt: skip
        wrong = [(sign_x * x, sign_x * y, sign_turn * turn) for x, y, turn in GOOD]
        with pytest.raises(ContractError, match=f"fit with {what} reversed"):
            _measured(files, wrong)


def test_a_crop_knows_pitch_and_middle_of_its_sensor(tmp_path: Path) -> None:
    plain = Flats()
    lens = Flats(centre=(22 / plain.radius_px, 15 / plain.radius_px))
    place = camkit_description(
        bundle="b", origin_px=(20, 10), sensor_size_px=(444, 290), pixel_pitch_um=PITCH_UM
    )
    files = lens.write(tmp_path, description=place)
    facts = measure_flat(files, *lens.said(GOOD))
    assert facts.centre_px == pytest.approx((221.5, 144.5), abs=1.0)
    record = facts.to_record()
    assert (record["width_px"], record["height_px"]) == (444, 290)
    assert _error(facts, lens) < TOLERANCE


def test_a_crop_without_the_optical_centre_is_refused(tmp_path: Path) -> None:
    place = camkit_description(
        bundle="b", origin_px=(0, 0), sensor_size_px=(4000, 300), pixel_pitch_um=PITCH_UM
    )
    files = LENS.write(tmp_path, GOOD, description=place)
    with pytest.raises(DecodeError, match=r"0\.dng is a crop that the optical centre does not lie in"):  # noqa: E501 # fmt: skip
        measure_flat(files, *LENS.said(GOOD))


def test_heights_are_in_proportion_to_the_pitch(tmp_path: Path) -> None:
    files = LENS.write_planes(tmp_path, GOOD)
    twice = measure_flat(files, *LENS.said(GOOD), pixel_pitch_um=2 * PITCH_UM)
    assert twice.heights_mm == pytest.approx(2 * _measured(files, GOOD).heights_mm)


def test_the_record_is_plain_and_holds_what_was_said(tmp_path: Path) -> None:
    record = _measured(LENS.write_planes(tmp_path, GOOD), GOOD).to_record()
    assert record["separated"] is True
    assert record["pixel_pitch_um"] == PITCH_UM
    assert len(record["heights_mm"]) == len(record["relative_illumination"]) == 17
    assert record["pictures"][3] == {"file": "3.png", "shift_px": [0.0, 0.0], "turn_deg": 90.0}
    assert {"display_percent", "residual_percent", "centre_px", "centre_found"} <= set(record)


def test_wrong_wishes_are_refused(tmp_path: Path) -> None:
    files = LENS.write_planes(tmp_path, GOOD[:2])
    shifts, turns = LENS.said(GOOD[:2])
    (tmp_path / "small").mkdir()
    small = Flats(width=180, height=120).write_planes(tmp_path / "small", GOOD[:1])
    for call, told in (
        (lambda: measure_flat(files, shifts, turns), "add pixel_pitch_um"),
        (lambda: measure_flat(files, shifts, turns, pixel_pitch_um=-1.0), "must be > 0"),
        (lambda: measure_flat(files, shifts[:1], turns, pixel_pitch_um=1.0), "given 1 times for 2"),
        (lambda: measure_flat(files[:1] * 2, shifts, turns, pixel_pitch_um=1.0), "given twice"),
    ):
        with pytest.raises(ContractError, match=told):
            call()
    with pytest.raises(DecodeError, match=r"pictures differ: 1\.png is 360x240 planes, 0\.png 180"):
        measure_flat([files[1], *small], shifts, turns, pixel_pitch_um=1.0)
