"""Where a capture lies on the sensor, and what is refused."""

from typing import Any

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.geometry.placement import place
from tests.bundle_factory import PITCH_UM, tiny_sensor

EXTENT = tiny_sensor().extent


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
