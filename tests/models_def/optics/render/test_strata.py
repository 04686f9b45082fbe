import numpy as np
import pytest
import torch

from camkit.models_def.optics.kernel_bank import ChannelResponse, gaussian_response, wavelength_grid
from camkit.models_def.optics.render.strata import draw_wavelengths, pixel_numbers, to_disc


@pytest.mark.parametrize(("spp", "rows"), [(64, 8), (96, 8), (7, 1), (1, 1)])
def test_every_cell_has_one_point(spp: int, rows: int) -> None:
    drawn = pixel_numbers(np.random.default_rng(1), 5, spp, stratified=True)
    for first in (0, 2):
        row = np.floor(drawn[..., first] * rows).astype(int)
        column = np.floor(drawn[..., first + 1] * (spp // rows)).astype(int)
        cells = np.sort(row * (spp // rows) + column, axis=1)
        assert (cells == np.arange(spp)).all()


def test_every_sample_is_uniform_over_pixels() -> None:
    """Whatever its cell: no sample index may have a favourite place."""
    drawn = pixel_numbers(np.random.default_rng(2), 20_000, 16, stratified=True)
    assert np.abs(drawn.mean(axis=0) - 1 / 2).max() < 5 / np.sqrt(12 * 20_000)
    assert np.abs(drawn.var(axis=0) - 1 / 12).max() < 0.005


def test_the_disc_map_keeps_areas() -> None:
    """Moments of the uniform disc: E x^2 = E y^2 = 1/4, E r^4 = 1/3, E x y = 0."""
    u, v = ((torch.arange(400, dtype=torch.float64) + 0.5) / 400).expand(2, -1)
    x, y = to_disc(*torch.meshgrid(u, v, indexing="ij"))
    assert float(torch.hypot(x, y).max()) <= 1
    assert float((x**2).mean()) == pytest.approx(1 / 4, abs=2e-5)
    assert float((y**2).mean()) == pytest.approx(1 / 4, abs=2e-5)
    assert float(((x**2 + y**2) ** 2).mean()) == pytest.approx(1 / 3, abs=2e-5)
    assert float((x * y).mean()) == pytest.approx(0, abs=1e-12)


def test_the_middle_of_the_square_is_the_middle_of_the_disc() -> None:
    half = torch.tensor([0.5])
    assert [float(v) for v in to_disc(half, half)] == pytest.approx([0, 0])


def test_wavelengths_follow_the_response() -> None:
    """Their mean is the response's (linear between its samples), to the width of a stratum."""
    response = gaussian_response(wavelength_grid(9))
    drawn = draw_wavelengths(np.random.default_rng(3), response, 512, stratified=True)
    fine = np.linspace(0.42, 0.68, 20_001)
    for row, waves in zip(response.response, drawn, strict=True):
        density = np.interp(fine, response.wavelengths_um, row)
        assert waves.mean() == pytest.approx((fine * density).sum() / density.sum(), abs=2e-4)
        assert (np.diff(waves) >= 0).all()


def test_colours_that_do_not_see_a_wavelength_do_not_draw_it() -> None:
    waves = np.array([0.4, 0.5, 0.6, 0.7])
    rows = np.array([[0.0, 0.0, 0.5, 0.5], [0.5, 0.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    response = ChannelResponse(wavelengths_um=waves, response=rows, source="test")
    drawn = draw_wavelengths(np.random.default_rng(4), response, 100, stratified=True)
    assert drawn[0].min() > 0.5
    assert drawn[1].max() < 0.6
    assert drawn[2].max() < 0.5


def test_one_wavelength_is_drawn_alone() -> None:
    response = ChannelResponse(
        wavelengths_um=np.array([0.55]), response=np.ones((3, 1)), source="test"
    )
    drawn = draw_wavelengths(np.random.default_rng(5), response, 4, stratified=False)
    assert (drawn == 0.55).all()
