import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.render.window import Window, centred_window, corner_window


def test_a_centred_window_is_symmetric_about_the_axis() -> None:
    ys, xs = centred_window(4, 7, 5.0).centres_mm()
    assert float((ys + ys.flip(0)).abs().max()) < 1e-15
    assert float((xs + xs.flip(0)).abs().max()) < 1e-15


def test_a_corner_window_begins_half_a_pixel_from_the_axis_and_ends_at_its_radius() -> None:
    window = corner_window(300, 400, 10.0)
    ys, xs = window.centres_mm()
    assert (float(ys[0]), float(xs[0])) == (0.005, 0.005)
    assert window.radius_mm == pytest.approx(5.0)


def test_windows_without_pixels_are_refused() -> None:
    with pytest.raises(ContractError, match="pixels"):
        centred_window(0, 3, 6.0)
    with pytest.raises(ContractError, match="pitch"):
        Window(height_px=1, width_px=1, pitch_um=0.0, top_mm=0.0, left_mm=0.0)
