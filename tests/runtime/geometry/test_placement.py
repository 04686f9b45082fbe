"""Where a capture lies on the sensor, and what is refused."""

from typing import Any

import numpy as np
import pytest

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.geometry.placement import place, scale_kernels
from tests.bundle_factory import PITCH_UM, tiny_camera


def _capture(width: int, height: int, **facts: Any) -> Capture:
    return Capture(
        samples=np.zeros((height, width), np.uint16),
        cfa="RGGB",
        black_level=np.zeros((2, 2), np.float32),
        white_level=1023.0,
        **facts,
    )


def test_a_whole_frame_lies_at_the_origin() -> None:
    placement = place(_capture(96, 64), tiny_camera(), None)
    assert placement.window.origin_px == (0.0, 0.0)
    assert (placement.kernel_scale, placement.note) == (1.0, "")


def test_a_recorded_crop_is_honoured() -> None:
    crop = _capture(32, 20, origin_px=(10, 6), sensor_size_px=(96, 64), pixel_pitch_um=PITCH_UM)
    window = place(crop, tiny_camera(), None).window
    assert (window.origin_px, window.sensor_size_px) == ((10.0, 6.0), (96, 64))


def test_a_crop_that_leaves_the_sensor_is_refused() -> None:
    crop = _capture(32, 20, origin_px=(80, 6), sensor_size_px=(96, 64))
    with pytest.raises(ContractError, match="leaves the sensor"):
        place(crop, tiny_camera(), None)


def test_another_size_is_refused_naming_both_sides() -> None:
    with pytest.raises(ContractError, match=r"50x40.*96x64"):
        place(_capture(50, 40), tiny_camera(), None)


def test_another_pitch_is_refused_naming_both_sides() -> None:
    with pytest.raises(ContractError, match=r"4 um.*6 um"):
        place(_capture(96, 64, pixel_pitch_um=4.0), tiny_camera(), None)


def test_assume_centre_puts_the_middle_on_the_axis() -> None:
    window = place(_capture(51, 40), tiny_camera(), "centre").window
    x_mm, y_mm = window.to_mm(25.0, 19.5)
    assert (float(x_mm), float(y_mm)) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_assume_scale_spans_the_sensor() -> None:
    placement = place(_capture(48, 32), tiny_camera(), "scale")
    assert placement.kernel_scale == 0.5
    assert placement.window.pitch_um == 2 * PITCH_UM
    assert "0.5" in placement.note


def _gaussian(side: int, sigma: float) -> FloatArray:
    at = np.arange(side) - side // 2
    line = np.exp(-(at**2) / (2 * sigma**2))
    kernel = np.outer(line, line)
    return (kernel / kernel.sum()).astype(np.float32)[None, None].repeat(3, axis=1)


@pytest.mark.parametrize("ratio", [0.5, 0.8, 1.7])
def test_scaled_kernels_have_scaled_width_and_unit_sum(ratio: float) -> None:
    scaled = scale_kernels(_gaussian(33, 4.0), ratio)
    at = np.arange(scaled.shape[-1]) - scaled.shape[-1] // 2
    width = np.sqrt((scaled[0, 0].sum(axis=0) * at**2).sum())
    assert scaled.shape[-1] % 2 == 1
    np.testing.assert_allclose(scaled.sum(axis=(-2, -1)), 1, atol=1e-5)
    assert width == pytest.approx(4.0 * ratio, rel=0.1)


def test_a_ratio_of_one_changes_nothing() -> None:
    kernels = _gaussian(9, 1.0)
    assert scale_kernels(kernels, 1.0) is kernels


def test_a_ratio_of_zero_is_refused() -> None:
    with pytest.raises(ContractError, match="> 0"):
        scale_kernels(_gaussian(9, 1.0), 0.0)
