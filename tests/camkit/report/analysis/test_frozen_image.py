"""Images of points of frozen optics: nothing of core and haze is lost, wherever the peak lies."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.errors import ContractError
from camkit.report.analysis.frozen_image import (
    frozen_images,
    sensor_heights_mm,
    within_cells,
)
from camkit.report.analysis.point_image import FAR_PX, NEAR_PX, band_of
from tests.bundle_factory import tiny_sensor
from tests.haze_bundle import hazy_optics
from tests.haze_factory import CELL_PX


def test_lines_hold_the_light_of_core_and_haze() -> None:
    optics = hazy_optics()
    heights = optics.psf.field_heights_mm
    for image in frozen_images(optics, band_of(tiny_sensor()), heights):
        for line in image.lines.values():
            assert line.size % 2 == 1
            assert line.sum() == pytest.approx(1, abs=1e-6)
        assert 0 < image.near_share <= image.far_share <= 1 + 1e-9


def test_a_core_alone_is_the_kernel() -> None:
    optics = hazy_optics()
    bare = type(optics)(psf=optics.psf)
    (image,) = frozen_images(bare, band_of(tiny_sensor()), np.zeros(1))
    assert image.far_share == pytest.approx(1)
    kernel = image.patch[image.patch.sum(axis=1) > 0]
    assert kernel.shape[0] <= optics.psf.kernels.shape[-2]
    assert image.patch.sum() == pytest.approx(1, abs=1e-6)


def test_haze_takes_its_share_from_the_peak() -> None:
    optics = hazy_optics()
    band = band_of(tiny_sensor(), float(optics.psf.wavelengths_um[0]))
    assert optics.haze is not None
    core = float(optics.haze.core_share[0, 0, 0])
    share = core / (core + float(optics.haze.kernels[0, 0, 0].sum()))
    (hazy,) = frozen_images(optics, band, np.zeros(1))
    reach = optics.psf.kernels.shape[-1] // 2
    assert reach < NEAR_PX
    # beside the core there is the haze that lies upon it
    assert share < hazy.near_share < 1
    assert hazy.near_share - share == pytest.approx(
        (1 - share) * _haze_near(optics.haze.kernels[0, 0, 0]), rel=1e-3
    )


def _haze_near(cells: np.ndarray) -> float:
    return within_cells(cells / cells.sum(), CELL_PX, (0, 0), NEAR_PX)


@pytest.mark.parametrize("off_px", [(0, 0), (40, -25)])
def test_an_even_haze_lies_within_a_disc_by_its_area(off_px: tuple[int, int]) -> None:
    cells = np.full((41, 41), 1 / 41**2)
    told = np.pi * 100.0**2 / (41 * 16) ** 2
    assert within_cells(cells, 16, off_px, 100.0) == pytest.approx(told, rel=2e-3)
    assert within_cells(cells, 16, (0, 0), FAR_PX) == pytest.approx(1)


def test_kernels_on_a_grid_are_seen_along_their_radius() -> None:
    """A smear of 6 px outward and 1 px across, brighter about the axis; on the diagonal, turned."""
    at_mm = np.linspace(-0.4, 0.4, 5)
    y_mm, x_mm = (axis.ravel() for axis in np.meshgrid(at_mm, at_mm, indexing="ij"))
    height_mm = np.hypot(x_mm, y_mm)
    kernels = np.stack([_smear(x, y) for x, y in zip(x_mm, y_mm, strict=True)])
    psf = replace(
        hazy_optics().psf,
        kernels=kernels[:, None, None].repeat(3, axis=2),
        field_heights_mm=height_mm,
        symmetry="grid",
        grid_x_mm=at_mm,
        grid_y_mm=at_mm,
        relative_illumination=1 - height_mm,
    )
    heights = np.array([0.0, 0.2, 0.4]) * np.sqrt(2)
    images = frozen_images(FrozenOptics(psf=psf), band_of(tiny_sensor()), heights)
    assert [i.illumination for i in images] == pytest.approx((1 - heights).tolist(), abs=1e-6)
    for image in images[1:]:
        wide = {name: _width(line) for name, line in image.lines.items()}
        assert wide["radial"] == pytest.approx(6, rel=0.1)
        assert wide["tangential"] == pytest.approx(1, rel=0.2)


def _smear(x_mm: float, y_mm: float) -> np.ndarray:
    far = np.hypot(x_mm, y_mm)
    out = (0.0, 1.0) if far == 0 else (x_mm / far, y_mm / far)
    y, x = np.mgrid[-20:21, -20:21]
    along, across = x * out[0] + y * out[1], x * out[1] - y * out[0]
    spread = np.exp(-((along / 6) ** 2 + across**2) / 2) if far else np.exp(-(x**2 + y**2) / 2)
    return (spread / spread.sum()).astype(np.float32)


def _width(line: np.ndarray) -> float:
    at = np.arange(line.size) - line.size // 2
    middle = (line * at).sum() / line.sum()
    return float(np.sqrt((line * (at - middle) ** 2).sum() / line.sum()))


def test_one_wavelength_that_nothing_is_known_of_is_refused() -> None:
    with pytest.raises(ContractError, match=r"known from 0\.45 to 0\.62 um; .* at 5 um"):
        frozen_images(hazy_optics(), band_of(tiny_sensor(), 5.0), np.zeros(1))


def test_heights_end_at_the_corner() -> None:
    sensor = tiny_sensor(320, 240)
    heights = sensor_heights_mm(sensor, 5)
    assert heights[0] == 0
    assert heights[-1] == pytest.approx(200 * sensor.pixel_pitch_um / 1000)
