import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.render.window import Window, corner_window


def test_a_corner_window_begins_half_a_pixel_from_the_axis_and_ends_at_its_radius() -> None:
    window = corner_window(300, 400, 10.0)
    ys, xs = window.centres_mm()
    assert (float(ys[0]), float(xs[0])) == (0.005, 0.005)
    assert window.radius_mm == pytest.approx(5.0)


def test_windows_without_pixels_are_refused() -> None:
    with pytest.raises(ContractError, match="pixels"):
        corner_window(0, 3, 6.0)
    with pytest.raises(ContractError, match="pitch"):
        Window(height_px=1, width_px=1, pitch_um=0.0, top_mm=0.0, left_mm=0.0)
