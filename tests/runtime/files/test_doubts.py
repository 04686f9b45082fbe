"""A sound photograph raises no doubt; each kind of damage that LibRaw lets pass raises its own."""

import cv2
import numpy as np
import pytest

from camkit.runtime.capture import Capture
from camkit.runtime.files.doubts import LEAST_SIDE_PX, find_doubts, is_noise, notes_behind
from camkit.runtime.files.raw_checks import Levels
from tests.haze_factory import tiny_haze

BLACK, WHITE = 256, 4095
COLOURS = np.array([[0.5, 1.0], [1.0, 0.6]])  # what RGGB gets of a grey light


def levels(black=BLACK, white=WHITE):
    return Levels(black=np.full((2, 2), black, dtype=np.float32), white=white)


def photograph(height=256, width=320, seed=0, light=1.0):
    """Give a mosaic of blobs of every size, deep shadows, highlights and noise."""
    rng = np.random.default_rng(seed)
    scene = sum(
        cv2.GaussianBlur(rng.standard_normal((height, width)), (0, 0), size) * size
        for size in (2, 6, 18)
    )
    scene = (scene - scene.min()) / np.ptp(scene)
    linear = light * scene**2 * np.tile(COLOURS, (height // 2, width // 2))
    dn = BLACK + (WHITE - BLACK) * linear + rng.normal(0, 4, linear.shape)
    return np.clip(np.round(dn), 0, WHITE).astype(np.uint16)


@pytest.mark.parametrize("seed", range(4))
def test_a_sound_photograph_raises_no_doubt(seed):
    mosaic = photograph(seed=seed)
    assert find_doubts(mosaic, levels(), "RGGB") == []
    planes = np.stack([mosaic[::2, ::2], mosaic[::2, 1::2], mosaic[1::2, 1::2]])
    flat = Levels(black=np.full(3, BLACK, np.float32), white=WHITE)
    assert find_doubts(planes, flat, None) == []


def test_rows_of_one_level_each_are_no_damage():
    ramp = np.linspace(300, 4000, 200)[:, None] * np.ones(240)
    for turned in (ramp, np.ascontiguousarray(ramp.T)):
        assert find_doubts(turned.astype(np.uint16), levels(), "RGGB") == []
        planes = np.stack([turned.astype(np.uint16)] * 3)
        flat = Levels(black=np.full(3, BLACK, np.float32), white=WHITE)
        assert find_doubts(planes, flat, None) == []


def test_flat_fields_dark_frames_and_night_are_no_damage():
    rng = np.random.default_rng(1)
    for level in (BLACK, 300, 2000, 4000):
        flat = rng.normal(level, 6, (200, 200)).astype(np.uint16)
        doubts = find_doubts(flat, levels(), "RGGB")
        assert [d for d in doubts if "dark picture" not in d] == []
    night = rng.normal(BLACK, 3, (200, 200)).astype(np.uint16)
    night[90:110, 90:110] = WHITE
    assert find_doubts(night, levels(), "RGGB") == []


def test_a_sharp_edge_along_the_whole_row_is_no_damage():
    scene = photograph()
    scene[128:] = photograph(seed=9)[128:]
    assert find_doubts(scene, levels(), "RGGB") == []


def test_saturation_a_little_above_white_is_no_damage():
    bright = photograph(light=2.5).astype(np.int64)
    assert (
        find_doubts(np.minimum(bright, WHITE).astype(np.uint16), levels(white=3900), "RGGB") == []
    )


@pytest.mark.parametrize(
    ("black", "white", "message"),
    [
        (BLACK, 2000, "lie above white 2000, up to"),
        (BLACK, 65535, "of the range"),
        (900, WHITE, "below black 900"),
    ],
)
def test_levels_that_do_not_fit_the_data_are_named(black, white, message):
    mosaic = photograph(light=0.03 if white == 65535 else 1.0)
    doubts = find_doubts(mosaic, levels(black, white), "RGGB")
    if white == 65535:
        message = "nothing is brighter"
    assert any(message in doubt for doubt in doubts)


def test_a_black_level_of_zero_in_data_that_never_come_near_is_named():
    mosaic = photograph() + np.uint16(500)
    (doubt,) = find_doubts(mosaic, levels(0, 4600), "RGGB")
    assert "nothing is darker than" in doubt


def veiled(offset_dn: int = 0) -> Capture:
    """Return a photograph behind the tiny haze, and black that lies so much too low."""
    haze = tiny_haze().most_share
    sharp = photograph(light=1.6).astype(np.float64) - BLACK
    tones = sharp * np.tile(1 / COLOURS, (128, 160))
    far = cv2.GaussianBlur(tones, (0, 0), 40) / np.tile(1 / COLOURS, (128, 160))
    seen = BLACK + (1 - haze) * sharp + haze * far + offset_dn
    samples = np.clip(np.round(seen), 0, WHITE).astype(np.uint16)
    notes = ("the file has no valid white balance", *find_doubts(samples, levels(), "RGGB"))
    return Capture(
        samples=samples,
        cfa="RGGB",
        black_level=levels().black,
        white_level=WHITE,
        notes=notes,
    )


def test_the_haze_of_the_optics_is_no_fog():
    capture = veiled()
    assert "nothing is darker than" in capture.notes[1]
    assert notes_behind(capture, tiny_haze()) == ["the file has no valid white balance"]


def test_a_black_level_that_haze_does_not_explain_is_named_behind_it_too():
    capture = veiled(offset_dn=1200)
    assert notes_behind(capture, tiny_haze()) == list(capture.notes)
    assert any("nothing is darker than" in note for note in capture.notes)


def test_masked_pixels_say_what_black_is():
    rng = np.random.default_rng(2)
    dark = rng.normal(BLACK, 4, (200, 40)).astype(np.uint16)
    assert find_doubts(photograph(), levels(), "RGGB", [dark]) == []
    assert find_doubts(photograph(), levels(), "RGGB", [dark[:, :2]]) == []
    (doubt,) = find_doubts(photograph(), levels(BLACK - 30), "RGGB", [dark])
    assert "the masked pixels of the sensor lie at 256" in doubt
    lit = photograph()[:, :40]
    assert find_doubts(photograph(), levels(), "RGGB", [lit]) == []


@pytest.mark.parametrize("cfa", ["GRBG", "GBRG"])
def test_a_pattern_whose_greens_disagree_is_named(cfa):
    (doubt,) = find_doubts(photograph(), levels(), cfa)
    assert f"two greens of the CFA {cfa}" in doubt


PLACES = np.mgrid[:300, :420].astype(np.float64)
PATTERNS = {
    **{f"stripes along {name} of {size} px": (turn(*PLACES) // size) % 2
       for size in (4, 6, 8, 16, 32, 64)
       for name, turn in (("a diagonal", np.add), ("the other diagonal", np.subtract),
                          ("rows", lambda y, _: y), ("columns", lambda _, x: x))},
    **{f"star of {count}": np.sin(count * np.arctan2(PLACES[0] - 149.7, PLACES[1] - 209.7)) > 0
       for count in (8, 16, 36, 72)},
    **{f"bars of {size} px": np.where(
           PLACES[0] > 150, np.random.default_rng(1).random(420).repeat(size)[:420] > 0.5, 0.5)
       for size in (1, 2, 5)},
}  # fmt: skip


@pytest.mark.parametrize("name", PATTERNS)
def test_fine_patterns_behind_a_lens_are_neither_noise_nor_a_wrong_pattern(name):
    light = cv2.GaussianBlur(0.02 + 0.8 * PATTERNS[name].astype(np.float64), (0, 0), 0.8)
    linear = light * np.tile(COLOURS, (150, 210))
    noise = np.random.default_rng(0).normal(0, 4, linear.shape)
    dn = np.clip(np.round(BLACK + (WHITE - BLACK) * linear + noise), 0, WHITE).astype(np.uint16)
    found = find_doubts(dn, levels(), "RGGB")
    assert [doubt for doubt in found if "greens" in doubt or "noise" in doubt] == []


def test_rows_that_go_on_shifted_are_named_with_the_place():
    lost = photograph().ravel()
    lost = np.concatenate([lost[: 128 * 320], lost[128 * 320 + 74 :], lost[:74]]).reshape(256, 320)
    (doubt,) = find_doubts(lost, levels(), "RGGB")
    assert "from 50% of the height on the rows are shifted" in doubt


def test_a_wrong_width_is_named():
    wide = photograph(256, 320).ravel()
    skewed = wide[: 256 * 320 // 310 * 310].reshape(-1, 310)[:256]
    assert any("the width or the pixel data" in d for d in find_doubts(skewed, levels(), "RGGB"))


def test_rows_in_another_order_are_named():
    lost = np.roll(photograph(), 0)
    for row in range(120, 256, 2):
        lost[row : row + 2] = np.roll(lost[row : row + 2], row * 86, axis=1)
    (doubt,) = find_doubts(cv2.blur(lost, (9, 1)), levels(), "RGGB")
    assert "of the rows" in doubt
    assert "damaged" in doubt


def test_rows_of_noise_are_named():
    broken = photograph()
    broken[64:] = np.random.default_rng(3).integers(0, WHITE, (192, 320))
    assert any("of the rows are noise" in doubt for doubt in find_doubts(broken, levels(), "RGGB"))
    assert is_noise(broken, levels(), "RGGB")
    assert not is_noise(photograph(), levels(), "RGGB")


@pytest.mark.parametrize("side", ["left", "right", "upper"])
def test_a_rim_without_light_is_named(side):
    mosaic = photograph(light=0.8) // 2 + np.uint16(600)
    place = {"left": np.s_[:, :24], "right": np.s_[:, -24:], "upper": np.s_[:24]}[side]
    mosaic[place] = BLACK
    assert any(f"the {side} 24" in doubt for doubt in find_doubts(mosaic, levels(), "RGGB"))


def test_pictures_too_small_to_judge_raise_no_doubt():
    noise = np.random.default_rng(0).integers(0, 60000, (LEAST_SIDE_PX - 2, 200)).astype(np.uint16)
    assert find_doubts(noise, levels(), "RGGB") == []


def test_one_black_of_a_cell_far_from_the_others_is_named():
    odd = Levels(black=np.array([[0, 256], [256, 256]], dtype=np.float32), white=WHITE)
    assert any("differ by 256" in doubt for doubt in find_doubts(photograph(), odd, "RGGB"))
    near = Levels(black=np.array([[250, 256], [262, 256]], dtype=np.float32), white=WHITE)
    assert find_doubts(photograph(), near, "RGGB") == []


def test_a_picture_that_lies_below_black_but_for_a_rim_is_named():
    lost = np.full((256, 320), BLACK - 60, dtype=np.uint16)
    lost[:, :4] = photograph()[:, :4]
    assert any(
        "half of the samples lie at" in doubt for doubt in find_doubts(lost, levels(), "RGGB")
    )
