"""The image circle and the open share of a stop, against rims that geometry alone decides."""

import math

import pytest

from camkit.models_def.optics.analysis.image_circle import image_radius_mm, open_share
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.scaling import scale_lens

STOP_MM, GAP_MM, TRACK_MM = 2.0, 10.0, 25.0


def two_rims(second_mm: float) -> Lens:
    """Return a stop and a rim in air, and no glass: rays are straight."""
    stop = Surface(curvature_per_mm=0.0, thickness_mm=GAP_MM, semi_diameter_mm=STOP_MM)
    rim = Surface(curvature_per_mm=0.0, thickness_mm=TRACK_MM - GAP_MM, semi_diameter_mm=second_mm)
    return Lens(
        name="two rims",
        surfaces=(stop, rim),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=STOP_MM,
    )


@pytest.mark.parametrize("rim_mm", [1.0, 6.0, 30.0])
def test_the_outermost_field_has_a_ray_that_grazes_the_rim(rim_mm: float) -> None:
    """It passes the stop at its edge and the rim at its, on the other side."""
    expected_mm = (rim_mm + STOP_MM) * TRACK_MM / GAP_MM
    assert image_radius_mm(two_rims(rim_mm)) == pytest.approx(expected_mm, rel=1e-2)


@pytest.mark.parametrize("factor", [0.25, 4.0])
def test_a_lens_twice_as_large_images_twice_as_far(factor: float) -> None:
    lens = find_lens("double-gauss")
    scaled_mm = image_radius_mm(scale_lens(lens, factor))
    assert scaled_mm == pytest.approx(factor * image_radius_mm(lens), rel=2e-4)


@pytest.mark.parametrize("rim_mm", [0.5, 1.0, 1.7, 2.5, math.inf])
def test_the_open_share_is_the_area_that_the_narrower_rim_leaves(rim_mm: float) -> None:
    expected = min(1.0, rim_mm / STOP_MM) ** 2
    assert open_share(two_rims(rim_mm)) == pytest.approx(expected, abs=2e-3)
