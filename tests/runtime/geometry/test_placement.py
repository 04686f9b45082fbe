"""Where a capture lies on the sensor, and what is refused."""

from typing import Any

import numpy as np
import pytest

from camkit.bundle.sensor import Extent
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.geometry.placement import place
from tests.bundle_factory import PITCH_UM, tiny_sensor

EXTENT = tiny_sensor().extent
AXIS_PX = (30.0, 40.5)


def _beside() -> Extent:
    """Give the sensor with its axis beside its middle."""
    assert EXTENT is not None
    return EXTENT.model_copy(update={"optical_centre_px": AXIS_PX})


def _capture(width: int, height: int, **facts: Any) -> Capture:
    return Capture(
        samples=np.zeros((height, width), np.uint16),
        cfa="RGGB",
        black_level=np.zeros((2, 2), np.float32),
        white_level=1023.0,
        **facts,
    )


def test_a_whole_frame_lies_at_the_origin() -> None:
    placement = place(_capture(96, 64), EXTENT, None)
    assert placement.window.origin_px == (0.0, 0.0)
    assert (placement.kernel_scale, placement.note) == (1.0, "")


def test_a_recorded_crop_is_honoured() -> None:
    crop = _capture(32, 20, origin_px=(10, 6), sensor_size_px=(96, 64), pixel_pitch_um=PITCH_UM)
    window = place(crop, EXTENT, None).window
    assert (window.origin_px, window.sensor_size_px) == ((10.0, 6.0), (96, 64))


def test_a_crop_that_leaves_the_sensor_is_refused() -> None:
    crop = _capture(32, 20, origin_px=(80, 6), sensor_size_px=(96, 64))
    with pytest.raises(ContractError, match="leaves the sensor"):
        place(crop, EXTENT, None)


def test_another_size_is_refused_naming_both_sides() -> None:
    with pytest.raises(ContractError, match=r"50x40.*96x64"):
        place(_capture(50, 40), EXTENT, None)


def test_another_pitch_is_refused_naming_both_sides() -> None:
    with pytest.raises(ContractError, match=r"4 um.*6 um"):
        place(_capture(96, 64, pixel_pitch_um=4.0), EXTENT, None)


def test_assume_centre_puts_the_middle_on_the_axis() -> None:
    window = place(_capture(51, 40), EXTENT, "centre").window
    x_mm, y_mm = window.to_mm(25.0, 19.5)
    assert (float(x_mm), float(y_mm)) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_assume_scale_spans_the_sensor() -> None:
    placement = place(_capture(48, 32), EXTENT, "scale")
    assert placement.kernel_scale == 0.5
    assert placement.window.pitch_um == 2 * PITCH_UM
    assert "0.5" in placement.note


def test_the_axis_of_the_sensor_comes_with_every_place() -> None:
    crop = _capture(32, 20, origin_px=(10, 6), sensor_size_px=(96, 64))
    for capture in (_capture(96, 64), crop):
        window = place(capture, _beside(), None).window
        assert window.axis_px == AXIS_PX
        x0, y0 = window.origin_px
        x_mm, y_mm = window.to_mm(AXIS_PX[0] - x0, AXIS_PX[1] - y0)
        assert (float(x_mm), float(y_mm)) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_assume_centre_puts_the_middle_on_the_axis_wherever_it_is() -> None:
    window = place(_capture(51, 40), _beside(), "centre").window
    assert window.origin_px == (AXIS_PX[0] - 25.0, AXIS_PX[1] - 19.5)
    x_mm, y_mm = window.to_mm(25.0, 19.5)
    assert (float(x_mm), float(y_mm)) == pytest.approx((0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_assume_scale_keeps_the_axis_at_its_share_of_the_sensor(ratio: float) -> None:
    whole = place(_capture(96, 64), _beside(), None).window
    scaled = place(_capture(round(96 * ratio), round(64 * ratio)), _beside(), "scale").window
    for share in (0.0, 0.3, 1.0):  # of the sensor, from edge to edge
        x_px = share * 96 - 0.5
        found_mm = scaled.to_mm((x_px + 0.5) * ratio - 0.5, 0.0)[0]
        assert float(found_mm) == pytest.approx(float(whole.to_mm(x_px, 0.0)[0]), abs=1e-12)


def test_no_optical_centre_gives_the_places_of_one_in_the_middle() -> None:
    assert EXTENT is not None
    middle = EXTENT.model_copy(update={"optical_centre_px": (47.5, 31.5)})
    for assume in (None, "centre", "scale"):
        plain, stated = (
            place(_capture(96, 64), extent, assume).window for extent in (EXTENT, middle)
        )
        at = np.arange(96.0), np.arange(96.0)
        np.testing.assert_array_equal(plain.to_mm(*at), stated.to_mm(*at))


@pytest.mark.parametrize("pitch_um", [None, 3.5])
def test_a_sensor_without_extent_takes_a_picture_of_any_size(pitch_um: float | None) -> None:
    placement = place(_capture(50, 40, pixel_pitch_um=pitch_um), None, None)
    window = placement.window
    assert (window.size_px, window.sensor_size_px) == ((50, 40), (50, 40))
    assert (window.origin_px, window.axis_px) == ((0.0, 0.0), None)
    assert window.pitch_um == (pitch_um or 1.0)
    assert (placement.kernel_scale, placement.note) == (1.0, "")


def test_a_binned_capture_has_larger_pixels_at_the_same_place() -> None:
    placement = place(_capture(100, 80), _beside(), "scale")
    small = placement.binned(2)
    assert small.window.size_px == (50, 40)
    assert small.window.pitch_um == 2 * placement.window.pitch_um
    assert small.kernel_scale == placement.kernel_scale / 2
    assert small.window.to_mm(0, 0) == pytest.approx(placement.window.to_mm(0.5, 0.5))
