"""Plates and lenses whose diffraction is known in closed form."""

import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Aperture, Bench, Phase
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf

WAVE_UM = 0.55
POINT = PixelGrid(side_px=1, pitch_um=0.01, samples=1)
INDEX = 1.46


def _bare(cells: int) -> torch.Tensor:
    return torch.zeros(cells, cells, dtype=torch.float64)


def _lens(aperture: Aperture = "circle", phase: Phase = "exact") -> Bench:
    return Bench(
        diameter_mm=10, aperture=aperture, focal_length_mm=50, lens_phase=phase, kernel=phase
    )


@pytest.mark.parametrize("phase", ["exact", "parabolic"])
def test_encircled_energy_of_a_circle(phase: Phase) -> None:
    """At the zeros of the Airy pattern: .83778, .90993, .93765 of the light."""
    per_fringe = 25
    grid = PixelGrid(side_px=171, pitch_um=WAVE_UM * 5 / per_fringe, samples=1)
    psf = plate_psf(_bare(512), INDEX, WAVE_UM, bench=_lens(phase=phase), grid=grid)
    place = torch.arange(171, dtype=torch.float64) - 85
    radius = (place[:, None] ** 2 + place[None, :] ** 2).sqrt() / per_fringe
    for zero, energy in ((1.21966989, 0.83778487), (2.23313059, 0.90993054), (3.2383, 0.93764747)):
        assert float(psf[radius <= zero].sum()) == pytest.approx(energy, abs=1.5e-3)


def test_energy_of_a_square() -> None:
    """Within a wavelength times the f-number to each side: .90282 per axis."""
    grid = PixelGrid(side_px=41, pitch_um=WAVE_UM * 5 / 20.5, samples=2)
    psf = plate_psf(_bare(256), INDEX, WAVE_UM, bench=_lens("square"), grid=grid)
    assert float(psf.sum()) == pytest.approx(0.81508997, abs=1e-4)


def test_all_light_arrives() -> None:
    grid = PixelGrid(side_px=401, pitch_um=5.97)
    psf = plate_psf(_bare(1024), INDEX, WAVE_UM, bench=_lens(), grid=grid)
    assert 0.995 < float(psf.sum()) < 1.0
    assert float(psf[200, 200]) == pytest.approx(float(psf.max()))


@pytest.mark.parametrize(("waves", "strehl"), [(0.25, 0.81056947), (0.5, 0.40528473), (1.0, 0.0)])
def test_defocus(waves: float, strehl: float) -> None:
    bench = _lens(phase="parabolic")
    depth_mm = 5.0**2 / (2 * waves * WAVE_UM * 1e-3)
    sharp = plate_psf(_bare(512), INDEX, WAVE_UM, bench=bench, grid=POINT)
    blurred = plate_psf(_bare(512), INDEX, WAVE_UM, bench=bench, grid=POINT, depth_mm=depth_mm)
    assert float(blurred / sharp) == pytest.approx(strehl, abs=2e-4)


@pytest.mark.parametrize(("wave_um", "strehl"), [(0.45, 0.09), (0.55, 0.10), (0.65, 0.17)])
def test_the_equations_of_the_thesis_taken_together_are_no_lens(
    wave_um: float, strehl: float
) -> None:
    """An exact lens phase with a parabolic kernel: 0.8 waves of spherical aberration."""
    bench = Bench(
        diameter_mm=9.16,
        focal_length_mm=50,
        focus_mm=5000,
        lens_phase="parabolic",
        kernel="parabolic",
    )
    right = plate_psf(_bare(1024), INDEX, wave_um, bench=bench, grid=POINT, depth_mm=5000)
    object.__setattr__(bench, "lens_phase", "exact")
    mixed = plate_psf(_bare(1024), INDEX, wave_um, bench=bench, grid=POINT, depth_mm=5000)
    assert float(mixed / right) == pytest.approx(strehl, abs=0.015)


def _diffractive(phase: Phase) -> tuple[Bench, torch.Tensor]:
    """Give a plate that is an f/5 lens by itself, wrapped to one cycle at WAVE_UM."""
    bench = Bench(diameter_mm=1, sensor_mm=5, lens_phase=phase, kernel=phase)
    cells = 512
    place = (torch.arange(cells, dtype=torch.float64) - (cells - 1) / 2) / cells
    path_um = 1e3 * bench.path_mm(place[:, None] ** 2 + place[None, :] ** 2, math.inf)
    cycle_um = WAVE_UM / (INDEX - 1)
    return bench, torch.remainder(-path_um / (INDEX - 1), cycle_um)


def test_an_ideal_diffractive_lens_has_a_strehl_ratio_of_one() -> None:
    """Its sign included: thick in the middle, as a lens that converges."""
    bench, height_um = _diffractive("exact")
    perfect = Bench(diameter_mm=1, focal_length_mm=5)
    sharp = plate_psf(_bare(512), INDEX, WAVE_UM, bench=perfect, grid=POINT)
    made = plate_psf(height_um, INDEX, WAVE_UM, bench=bench, grid=POINT)
    turned = plate_psf(-height_um, INDEX, WAVE_UM, bench=bench, grid=POINT)
    assert float(made / sharp) == pytest.approx(1.0, abs=0.01)
    assert float(turned / sharp) < 1e-3


@pytest.mark.parametrize(("levels", "share"), [(2, 0.40528), (4, 0.81057), (8, 0.94964)])
def test_levels_cost_light(levels: int, share: float) -> None:
    bench, height_um = _diffractive("exact")
    step_um = WAVE_UM / (INDEX - 1) / levels
    etched = torch.floor(height_um / step_um) * step_um
    whole = plate_psf(height_um, INDEX, WAVE_UM, bench=bench, grid=POINT)
    made = plate_psf(etched, INDEX, WAVE_UM, bench=bench, grid=POINT)
    assert float(made / whole) == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize("wave_um", [0.5, 0.65])
def test_at_another_wavelength_it_focuses_elsewhere_and_less(wave_um: float) -> None:
    """f = f0 l0 / l, and the first order takes sinc^2 of the detuning."""
    _, height_um = _diffractive("parabolic")
    there = Bench(
        diameter_mm=1,
        sensor_mm=5 * WAVE_UM / wave_um,
        lens_phase="parabolic",
        kernel="parabolic",
    )
    perfect = Bench(
        diameter_mm=1,
        focal_length_mm=there.distance_mm,
        lens_phase="parabolic",
        kernel="parabolic",
    )
    sharp = plate_psf(_bare(512), INDEX, wave_um, bench=perfect, grid=POINT)
    made = plate_psf(height_um, INDEX, wave_um, bench=there, grid=POINT)
    expected = torch.sinc(torch.tensor(WAVE_UM / wave_um - 1)) ** 2
    assert float(made / sharp) == pytest.approx(float(expected), abs=0.02)


def test_a_prism_bends_the_light_towards_its_thick_side() -> None:
    slope = 2e-3
    columns = (torch.arange(256, dtype=torch.float64) - 127.5) * 1e4 / 256
    height_um = (slope * columns)[None, :].expand(256, 256)
    grid = PixelGrid(side_px=61, pitch_um=2.0, samples=4)
    psf = plate_psf(height_um, INDEX, WAVE_UM, bench=_lens(), grid=grid)
    row, column = divmod(int(psf.argmax()), 61)
    assert (row, column) == (30, 30 + round((INDEX - 1) * slope * 50e3 / 2.0))


def test_a_lens_is_refocused_by_the_depth_it_was_focused_on() -> None:
    bench = Bench(diameter_mm=9.16, focal_length_mm=50, focus_mm=1000)
    grid = PixelGrid(side_px=21, pitch_um=5.97)
    near = plate_psf(_bare(512), INDEX, WAVE_UM, bench=bench, grid=grid, depth_mm=1000)
    far = plate_psf(_bare(512), INDEX, WAVE_UM, bench=bench, grid=grid)
    assert float(near[10, 10]) > 0.8
    assert float(far[10, 10]) < 0.02


def test_the_etched_cells_throw_light_out_of_the_window() -> None:
    """Stripes of half a wave one cell wide: nothing is left in the middle."""
    height_um = torch.zeros(200, 200, dtype=torch.float64)
    height_um[:, ::2] = WAVE_UM / (INDEX - 1) / 2
    grid = PixelGrid(side_px=11, pitch_um=5.97)
    psf = plate_psf(height_um, INDEX, WAVE_UM, bench=_lens("square"), grid=grid)
    assert float(psf.sum()) < 1e-3


def test_single_precision_does_for_design() -> None:
    height_um = 0.3 * torch.rand(128, 128, generator=torch.Generator().manual_seed(4))
    grid = PixelGrid(side_px=31, pitch_um=5.97)
    single = plate_psf(height_um, INDEX, WAVE_UM, bench=_lens(), grid=grid)
    double = plate_psf(height_um.double(), INDEX, WAVE_UM, bench=_lens(), grid=grid)
    assert single.dtype == torch.float32
    assert float((single - double).abs().max()) < 1e-6


def test_gradients_reach_the_heights() -> None:
    bench = Bench(diameter_mm=0.05, aperture="square", focal_length_mm=5)
    grid = PixelGrid(side_px=3, pitch_um=20.0, samples=2)
    height_um = 0.2 * torch.rand(6, 6, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda h: plate_psf(h, INDEX, WAVE_UM, bench=bench, grid=grid), (height_um,)
    )


def test_cells_that_are_too_wide_are_refused_with_their_limit() -> None:
    grid = PixelGrid(side_px=3, pitch_um=1.0)
    alone = Bench(diameter_mm=1, sensor_mm=5)
    with pytest.raises(ContractError, match=r"rim at 0\.550 um: at most 2\.76 um"):
        plate_psf(_bare(300), INDEX, WAVE_UM, bench=alone, grid=grid)
    wide = PixelGrid(side_px=1001, pitch_um=5.97)
    with pytest.raises(ContractError, match="side_px is 471 at most"):
        plate_psf(_bare(1024), INDEX, WAVE_UM, bench=_lens(), grid=wide)


def test_one_sample_a_fringe_holds_the_light_and_fewer_are_refused() -> None:
    """What falls outside the band folds onto the sum: two per pixel lose 27 % of this core."""
    bench = Bench(diameter_mm=9.162, focal_length_mm=50, focus_mm=5000)
    sums = []
    for samples in (3, None):
        grid = PixelGrid(side_px=31, pitch_um=5.97, samples=samples)
        psf = plate_psf(_bare(382), INDEX, 0.46, bench=bench, grid=grid, depth_mm=5000)
        sums.append(float(psf.sum()))
    assert sums[0] == pytest.approx(sums[1], abs=2e-3)
    two = PixelGrid(side_px=31, pitch_um=5.97, samples=2)
    with pytest.raises(ContractError, match=r"2 samples per pixel .* 0\.460 um: at least 3"):
        plate_psf(_bare(382), INDEX, 0.46, bench=bench, grid=two, depth_mm=5000)


@pytest.mark.parametrize(
    "height_um", [torch.zeros(3, 4), torch.zeros(3), torch.zeros(4, 4, dtype=torch.int64)]
)
def test_what_is_no_height_map_is_refused(height_um: torch.Tensor) -> None:
    with pytest.raises(ContractError, match=r"height map|real numbers"):
        plate_psf(height_um, INDEX, WAVE_UM, bench=_lens(), grid=POINT)


def test_grids_have_a_middle() -> None:
    for wrong in ({"side_px": 4}, {"side_px": 3, "pitch_um": 0.0}, {"side_px": 3, "samples": 0}):
        with pytest.raises(ContractError):
            PixelGrid(**{"pitch_um": 1.0, **wrong})  # type: ignore[arg-type]
