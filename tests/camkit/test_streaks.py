"""Parts give the kernel that their definition says; parts that are none are refused."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.streaks import (
    HAZE_STEP_PX,
    MAX_ARMS,
    MAX_CORE_PX,
    MAX_REACH_PX,
    SECTION_STEP_PX,
    StreakOptics,
    arm_axes,
    arm_light,
    haze_taps,
)
from tests.hdr_bundle import CORE_SHARE, HAZE_SHARE, STREAK_SHARE, four_lines
from tests.streak_factory import small_streaks

FLOAT32 = 1e-7


def _line(samples: FloatArray, at: float) -> float:
    """Go along a line between samples; 0 beyond them."""
    low = math.floor(at)
    if at < 0 or at > len(samples) - 1:
        return 0.0
    above = float(samples[min(low + 1, len(samples) - 1)])
    return float(samples[low]) * (1 - at + low) + above * (at - low)


def _slow_pixel(optics: StreakOptics, at: tuple[int, int], y: int, x: int) -> float:
    """Give a pixel (y, x) from the middle, of one depth and wavelength."""
    half = optics.core.shape[-1] // 2
    if max(abs(y), abs(x)) <= half:
        return float(optics.core[(*at, y + half, x + half)])
    light = 0.0
    for arm, angle in enumerate(optics.angles_rad):
        along = math.cos(angle) * x + math.sin(angle) * y
        across = math.cos(angle) * y - math.sin(angle) * x
        section = optics.sections[at[1], arm]
        place = across / SECTION_STEP_PX + len(section) // 2
        light += _line(optics.profiles[(*at, arm)], along) * _line(section, place)
    haze = optics.haze[at]
    squares = len(haze)
    # the outermost squares go on as far as the kernel does
    row, column = (
        min(max(place / HAZE_STEP_PX + squares // 2, 0), squares - 1) for place in (y, x)
    )
    lines = [_line(line, column) for line in haze]
    return light + _line(np.array(lines), row)


def test_dense_kernels_equal_a_loop_over_their_pixels() -> None:
    optics = small_streaks()
    dense = optics.dense()
    assert dense.dtype == np.float32
    assert dense.shape == (2, 2, optics.side_px, optics.side_px)
    middle = optics.side_px // 2
    for at in np.ndindex(2, 2):
        for y, x in np.ndindex(dense.shape[2:]):
            wanted = _slow_pixel(optics, at, y - middle, x - middle)
            assert dense[(*at, y, x)] == pytest.approx(wanted, abs=FLOAT32)


def test_the_kernel_of_the_bare_lens_is_its_core_alone() -> None:
    optics = small_streaks()
    bare, middle = optics.dense(bare=True), optics.side_px // 2
    inner = np.s_[..., middle - 2 : middle + 3, middle - 2 : middle + 3]
    np.testing.assert_array_equal(bare[inner], optics.bare_core)
    assert bare.sum() == pytest.approx(optics.bare_core.sum())


def test_the_kernel_is_as_wide_as_its_longest_part() -> None:
    optics = small_streaks()
    assert optics.reach_px == 10
    assert optics.side_px == 23  # three squares of 8 px
    alone = replace(optics, haze=optics.haze[..., 1:2, 1:2])
    assert alone.side_px == 2 * alone.reach_px + 1


def test_lines_have_the_light_that_they_were_made_with() -> None:
    dense = four_lines().dense()[0, 0]
    middle = len(dense) // 2
    place = np.arange(len(dense)) - middle
    distance = np.hypot(place[:, None], place[None, :])
    assert dense[distance <= 6].sum() == pytest.approx(CORE_SHARE, abs=1e-3)
    assert dense.sum() == pytest.approx(CORE_SHARE + STREAK_SHARE + HAZE_SHARE, abs=1e-3)


def test_an_arm_lies_in_the_direction_of_its_angle() -> None:
    """From +x towards +y, which is down."""
    place = np.arange(-8, 9)
    along, across = arm_axes(place, math.pi / 2)
    np.testing.assert_allclose(along, np.broadcast_to(place[:, None], (17, 17)), atol=1e-12)
    np.testing.assert_allclose(across, np.broadcast_to(-place[None, :], (17, 17)), atol=1e-12)
    light = arm_light(np.ones(6), np.array([0.0, 4, 0]), along, across)
    assert np.argwhere(light).tolist() == [[y, 8] for y in range(8, 14)]


def test_taps_of_the_haze_share_every_pixel_out_among_squares() -> None:
    taps = haze_taps(41, 3)
    np.testing.assert_allclose(taps.sum(axis=1), 1, atol=1e-6)
    assert taps[20].tolist() == [0, 1, 0]
    assert taps[24].tolist() == [0, 0.5, 0.5]
    assert taps[0].tolist() == [1, 0, 0]


def _changed(name: str, index: Any, value: float) -> dict[str, Any]:
    array = getattr(small_streaks(), name).copy()
    array[index] = value
    return {name: array}


SMALL = small_streaks()
WIDE = np.zeros((2, 2, 35, 35), np.float32)
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "NaN": (_changed("core", (0, 0, 0, 0), math.nan), "core must be finite"),
    "inf": (_changed("haze", (0, 0, 0, 0), math.inf), "haze must be finite"),
    "negative": (_changed("profiles", (0, 0, 0, 5), -1e-3), "profiles must be finite and >= 0"),
    "negative bare core": (_changed("bare_core", (0, 0, 0, 0), -1e-3), "bare_core must be"),
    "NaN section": (_changed("sections", (0, 0, 0), math.nan), "sections must be finite"),
    "a core of more than all": (_changed("core", (0, 0, 0, 0), 0.9), "core holds 0 to 1"),
    "a core of nothing": ({"core": 0 * SMALL.core}, "core holds 0 to 1"),
    "an arm of more than all": (_changed("profiles", (0, 0, 0, 5), 1e30), "more than all"),
    "a section of more than all": (_changed("sections", (0, 0, 3), 4.1), "more than all"),
    "haze of more than all": (_changed("haze", (0, 0, 1, 1), 1.1), "more than all"),
    "cores of two sides": ({"bare_core": SMALL.bare_core[..., 1:-1, 1:-1]}, "bare_core must be"),
    "a core that is no square": ({"core": SMALL.core[..., :3, :]}, r"core must be \(2, 2, 5, 5\)"),
    "an even core": (
        {"core": SMALL.core[..., 1:, 1:], "bare_core": SMALL.bare_core[..., 1:, 1:]},
        "core need an odd number",
    ),
    "an even section": ({"sections": SMALL.sections[..., 1:]}, "sections need an odd number"),
    "an even haze": ({"haze": SMALL.haze[..., 1:, 1:]}, "haze need an odd number"),
    "a haze of no square": ({"haze": SMALL.haze[..., :0, :0]}, "haze need an odd number"),
    "too wide a core": ({"core": WIDE, "bare_core": WIDE}, f"1 to {MAX_CORE_PX} px; got 35"),
    "too few depths": ({"depths_mm": np.array([1.0])}, "core must be"),
    "wavelengths that fall": ({"wavelengths_um": np.array([0.6, 0.5])}, "wavelengths_um must be"),
    "a wavelength of inf": ({"wavelengths_um": np.array([0.6, math.inf])}, "must be finite"),
    "a wavelength of NaN": ({"wavelengths_um": np.array([0.6, math.nan])}, "must be > 0"),
    "a depth of 0": ({"depths_mm": np.array([0.0, 1.0])}, "depths_mm must be > 0"),
    "two depths of inf": ({"depths_mm": np.array([math.inf] * 2)}, "depths_mm must be > 0"),
    "no depth": ({"depths_mm": np.zeros(0)}, "depths_mm must be > 0"),
    "a table of depths": ({"depths_mm": np.ones((1, 2))}, "depths_mm must be > 0"),
    "a pitch of 0": ({"pixel_pitch_um": 0.0}, "pixel_pitch_um must be > 0"),
    "a pitch of inf": ({"pixel_pitch_um": math.inf}, "pixel_pitch_um must be > 0"),
    "an angle of NaN": ({"angles_rad": np.array([0, 1, math.nan])}, "finite angles"),
    "an angle too few": ({"angles_rad": np.zeros(2)}, "profiles must be"),
    "too many arms": (
        {
            "angles_rad": np.zeros(MAX_ARMS + 1),
            "profiles": np.zeros((2, 2, MAX_ARMS + 1, 11), np.float32),
            "sections": np.zeros((2, MAX_ARMS + 1, 7), np.float32),
        },
        f"1 to {MAX_ARMS} arms with finite angles; got {MAX_ARMS + 1}",
    ),
    "arms that end in the core": ({"profiles": SMALL.profiles[..., :3]}, "end outside the core"),
    "arms without end": (
        {"profiles": np.zeros((2, 2, 3, MAX_REACH_PX + 2), np.float32)},
        f"within {MAX_REACH_PX} px",
    ),
    "haze without end": ({"haze": np.zeros((2, 2, 257, 257), np.float32)}, "257 squares is too"),
}


@pytest.mark.parametrize(("change", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_parts_that_are_no_optics_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        replace(small_streaks(), **change)


def test_the_farthest_and_widest_parts_that_are_allowed_make_a_kernel() -> None:
    lead = (1, 1)
    optics = StreakOptics(
        core=np.full((*lead, 1, 1), 0.5, np.float32),
        bare_core=np.full((*lead, 1, 1), 1.0, np.float32),
        profiles=np.full((*lead, 1, 200), 1e-3, np.float32),
        sections=np.full((1, 1, 1), 4.0, np.float32),
        angles_rad=np.zeros(1),
        haze=np.zeros((*lead, 1, 1), np.float32),
        depths_mm=np.array([math.inf]),
        wavelengths_um=np.array([0.5]),
        pixel_pitch_um=1.0,
    )
    dense = optics.dense()[0, 0]
    assert dense.shape == (399, 399)
    assert dense[199, 199] == 0.5
    assert (dense[199, 200:] == np.float32(4e-3)).all()
    assert np.count_nonzero(dense) == 200
