"""Images of points against closed forms of Gaussians."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.report.analysis.point_image import PointImage, band_of, find_peak, likeness
from tests.bundle_factory import tiny_sensor
from tests.camkit.report.analysis.gaussians import gaussian_image, gaussian_line


@pytest.mark.parametrize("sigma_px", [1.5, 3.0, 8.0])
def test_the_width_of_a_gaussian_peak(sigma_px: float) -> None:
    width = gaussian_image(sigma_px).fwhm_px
    assert width == pytest.approx(2 * np.sqrt(2 * np.log(2)) * sigma_px, rel=0.03)


def test_the_width_of_a_peak_on_a_haze_is_that_of_the_peak() -> None:
    peak = gaussian_image(2.0)
    haze = np.full_like(peak.patch, 4e-5)
    # a second peak of more than half its height does not count where it lies apart
    haze[20, 20] = 0.3 * peak.patch.max()
    hazy = PointImage(
        height_mm=0.0,
        field_angle_rad=None,
        patch=0.5 * peak.patch + haze,
        lines=peak.lines,
        near_share=0.5,
        far_share=1.0,
    )
    assert hazy.fwhm_px == pytest.approx(peak.fwhm_px, rel=0.03)


def test_the_mtf_of_a_gaussian_and_of_a_box() -> None:
    cycles = np.array([0.0, 0.02, 0.05, 0.1])
    mtf = gaussian_image(3.0).mtf("radial", cycles)
    np.testing.assert_allclose(mtf, np.exp(-2 * (np.pi * 3.0 * cycles) ** 2), atol=1e-6)
    box = np.zeros(21)
    box[8:13] = 0.2
    image = PointImage(
        height_mm=0.0,
        field_angle_rad=None,
        patch=np.outer(box, box),
        lines={"radial": box, "tangential": box},
        near_share=1.0,
        far_share=1.0,
    )
    # five samples in a row: the Dirichlet kernel
    told = np.abs(np.sin(5 * np.pi * cycles[1:]) / (5 * np.sin(np.pi * cycles[1:])))
    np.testing.assert_allclose(image.mtf("tangential", cycles)[1:], told, atol=1e-9)


@pytest.mark.parametrize(("first", "second"), [(2.0, 2.0), (2.0, 4.0), (1.5, 6.0)])
def test_gaussians_are_as_alike_as_their_widths(first: float, second: float) -> None:
    found = likeness(gaussian_image(first), gaussian_image(second))
    assert found == pytest.approx(2 * first * second / (first**2 + second**2), abs=2e-3)


def test_equal_peaks_are_alike_wherever_they_lie() -> None:
    image = gaussian_image(2.0)
    moved = PointImage(
        height_mm=1.0,
        field_angle_rad=None,
        patch=np.roll(image.patch, (5, -3), axis=(0, 1)),
        lines=image.lines,
        near_share=1.0,
        far_share=1.0,
    )
    assert likeness(image, moved) == pytest.approx(1, abs=1e-6)


def test_the_peak_is_the_densest_disc_and_not_the_highest_pixel() -> None:
    light = np.zeros((101, 101))
    light[30:37, 60:67] = 1.0
    light[80, 20] = 20.0
    peak = find_peak(light)
    assert (peak.row, peak.column) == (33, 63)
    assert peak.patch[64, 64] == 1.0


def test_the_peak_of_two_that_mirror_each_other_lies_between_them() -> None:
    light = np.zeros((101, 101))
    light[40, [30, 70]] = 1.0
    peak = find_peak(light)
    assert (peak.row, peak.column) == (40, 50)


def test_a_colour_is_weighed_by_its_response() -> None:
    band = band_of(tiny_sensor())
    assert band.weights.sum() == pytest.approx(1)
    assert (np.diff(band.wavelengths_um) > 0).all()
    assert band_of(tiny_sensor(), 0.55).wavelengths_um.tolist() == [0.55]
    with pytest.raises(ContractError, match="> 0"):
        band_of(tiny_sensor(), 0.0)


def test_an_image_without_light_is_refused() -> None:
    with pytest.raises(ContractError, match="hold light"):
        PointImage(
            height_mm=0.0,
            field_angle_rad=None,
            patch=np.zeros((3, 3)),
            lines={"radial": gaussian_line(1.0), "tangential": gaussian_line(1.0)},
            near_share=0.0,
            far_share=0.0,
        )
    with pytest.raises(ContractError, match="odd sides"):
        PointImage(
            height_mm=0.0,
            field_angle_rad=None,
            patch=np.ones((4, 4)),
            lines={},
            near_share=0.0,
            far_share=0.0,
        )
