"""The image circle and the open share of a stop, against rims that geometry alone decides."""

import math
from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.analysis.image_circle import image_radius_mm, open_share
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.scaling import scale_lens
from camkit.models_def.optics.spot import chief_heights, slopes_for_heights

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


def relay() -> Lens:
    """Return a lens that makes an image and a second one that turns it upright."""
    front = Surface(curvature_per_mm=0.04, thickness_mm=0.5, glass="model:1.5,0")
    back = Surface(curvature_per_mm=0.0, thickness_mm=150.0)
    return Lens(
        name="relay",
        surfaces=(
            front,
            back,
            replace(front, semi_diameter_mm=12.0),
            replace(back, thickness_mm=100.0),
        ),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=1.0,
        field_angles_rad=(0.0, 0.05),
    )


def test_an_upright_image_has_a_radius_and_slopes_of_its_heights() -> None:
    lens, slopes = relay(), torch.tensor([0.01, 0.03, 0.06], dtype=torch.float64)
    heights = chief_heights(lens, slopes)
    upside_down = chief_heights(find_lens("double-gauss"), slopes)
    assert float((heights * upside_down).max()) < 0
    assert float(heights[0].abs()) == pytest.approx(50 * 0.01, rel=0.05)
    assert image_radius_mm(lens) > float(heights.abs().max())
    for side in (1.0, -1.0):
        found = slopes_for_heights(lens, side * heights)
        assert found.tolist() == pytest.approx((side * slopes).tolist(), rel=1e-9)
