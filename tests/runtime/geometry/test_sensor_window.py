import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.geometry.sensor_window import SensorWindow, centred_origin


def window(**changes: object) -> SensorWindow:
    fields = {
        "size_px": (60, 40),
        "origin_px": (0, 0),
        "sensor_size_px": (60, 40),
        "pitch_um": 10.0,
    }
    return SensorWindow(**(fields | changes))  # type: ignore[arg-type]


def test_axis_lies_at_the_middle_of_the_sensor() -> None:
    x_mm, y_mm = window().to_mm(29.5, 19.5)
    assert (float(x_mm), float(y_mm)) == (0.0, 0.0)


def test_crop_keeps_its_place_on_the_sensor() -> None:
    whole, crop = window(), window(size_px=(10, 8), origin_px=(20, 12))
    np.testing.assert_allclose(crop.to_mm(3, 4), whole.to_mm(23, 16))


def test_millimetres_and_pixels_are_inverse() -> None:
    crop = window(size_px=(10, 8), origin_px=(20.5, 12.5))
    x, y = np.arange(10.0), np.linspace(0, 7, 10)
    np.testing.assert_allclose(crop.to_px(*crop.to_mm(x, y)), (x, y), atol=1e-12)


def test_corner_radius_is_that_of_the_farthest_pixel() -> None:
    assert window().corner_radius_mm == pytest.approx(np.hypot(29.5, 19.5) * 0.01)
    assert window(size_px=(2, 2), origin_px=(58, 0)).corner_radius_mm == pytest.approx(
        np.hypot(29.5, 19.5) * 0.01
    )


def test_centred_origin_falls_on_the_cfa_cell() -> None:
    assert centred_origin((11, 7), (60, 40)) == (24, 16)
    assert centred_origin((60, 40), (60, 40)) == (0, 0)


@pytest.mark.parametrize(
    "changes", [{"size_px": (0, 4)}, {"pitch_um": 0.0}, {"origin_px": (float("nan"), 0)}]
)
def test_impossible_window_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ContractError):
        window(**changes)


def test_the_axis_lies_where_it_is_said_to() -> None:
    beside = window(axis_px=(10.0, 35.5))
    assert beside.known_axis_px == (10.0, 35.5)
    x_mm, y_mm = beside.to_mm(10.0, 35.5)
    assert (float(x_mm), float(y_mm)) == (0.0, 0.0)
    np.testing.assert_allclose(beside.centre_mm, [(29.5 - 10) * 0.01, (19.5 - 35.5) * 0.01])
    assert beside.corner_radius_mm == pytest.approx(np.hypot(59 - 10, 35.5) * 0.01)
    crop = window(size_px=(10, 8), origin_px=(20.5, 12.5), axis_px=(10.0, 35.5))
    x, y = np.arange(10.0), np.linspace(0, 7, 10)
    np.testing.assert_allclose(crop.to_px(*crop.to_mm(x, y)), (x, y), atol=1e-12)
    np.testing.assert_allclose(crop.to_mm(x, y), beside.to_mm(x + 20.5, y + 12.5))


def test_no_axis_gives_the_bits_of_one_in_the_middle() -> None:
    x, y = np.meshgrid(np.arange(60), np.arange(40))
    for origin_px in ((0, 0), (7, 11), (3.5, 2.5)):
        plain, stated = (
            window(origin_px=origin_px, axis_px=axis_px) for axis_px in (None, (29.5, 19.5))
        )
        np.testing.assert_array_equal(plain.to_mm(x, y), stated.to_mm(x, y))
        np.testing.assert_array_equal(plain.centre_mm, stated.centre_mm)
        assert plain.corner_radius_mm == stated.corner_radius_mm


def test_an_origin_may_fall_on_any_pixel_where_there_is_no_mosaic() -> None:
    assert centred_origin((11, 7), (60, 40), multiple=1) == (24, 16)
    assert centred_origin((11, 7), (61, 42), multiple=1) == (25, 17)


def test_an_axis_that_is_nowhere_is_refused() -> None:
    with pytest.raises(ContractError, match="axis must be finite"):
        window(axis_px=(float("inf"), 0.0))
