"""The wave PSF of lenses against other programs, against all rays traced, and against rays."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest
import torch

from camkit.models_def.optics.analysis.lens_waves import coarse_pupil, traced_waves, wave_psf
from camkit.models_def.optics.analysis.pupil_fit import half_quadrature
from camkit.models_def.optics.analysis.wave_kernels import pixel_light, quadrature_for, waves_of
from camkit.models_def.optics.prescription import Lens, read_prescription, with_focus_shift
from camkit.models_def.optics.psf import trace_psf
from camkit.models_def.optics.pupil import with_fixed_stop
from camkit.models_def.optics.spot import chief_heights
from tests.physics.reference_lenses import thorlabs_al2550

LENSES: Final = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
STOP_MM: Final = 3.85751464
"""Height of the real marginal ray of the Cooke triplet at its stop, by optiland's ray aiming."""

# optiland 0.6.3, CookeTriplet, ScalarHuygensPSF of 129 x 129 points every 0.25 um about the chief
# ray, 384 rays across, summed under the tents of 15 x 15 pixels of 1.5 um and scaled to a sum of 1:
# the row of the centre from it to the right, and the column of the centre. Its pupil is lit evenly.
OPTILAND: Final = {
    0.0: (
        (0.054986, 0.023789, 0.015147, 0.018119),
        (0.018119, 0.015147, 0.023789, 0.054986, 0.023789, 0.015147, 0.018119),
    ),
    20.0: (
        (0.008040, 0.006129, 0.005464, 0.006243),
        (0.008761, 0.010999, 0.002743, 0.008040, 0.009288, 0.005766, 0.020998),
    ),
}


def _slopes(*degrees: float) -> torch.Tensor:
    return torch.tan(torch.deg2rad(torch.tensor(degrees, dtype=torch.float64)))


def _cooke() -> Lens:
    lens = read_prescription(LENSES / "cooke-triplet-f5.toml")
    return replace(lens, aperture_kind="stop_semi_diameter_mm", aperture_value=STOP_MM)


def test_kernels_are_those_of_optiland_but_for_its_pupil_lit_alike() -> None:
    lens, waves_um = _cooke(), torch.tensor([0.55], dtype=torch.float64)
    own = wave_psf(lens, _slopes(0.0, 20.0), waves_um, 15, 1.5).kernels[:, 0].numpy()
    coarse, smooth = coarse_pupil(lens, _slopes(20.0), waves_um)
    assert smooth
    samples = half_quadrature(*quadrature_for(coarse, 0, 0, 15, 1.5))
    assert samples.weight is not None
    alike = replace(waves_of(coarse, 0, 0, 15, 1.5), amplitude=samples.weight)
    light = pixel_light(alike, 15, 1.5).numpy()
    cases = ((0.0, own[0], 0.01), (20.0, own[1], 0.03), (20.0, light / light.sum(), 0.006))
    for degrees, kernel, share in cases:
        row, column = (np.array(values) for values in OPTILAND[degrees])
        assert np.abs(kernel[7, 7:11] - row).max() < share * column.max()
        assert np.abs(kernel[4:11, 7] - column).max() < share * column.max()


@pytest.mark.parametrize(("name", "f_number"), [("cooke-triplet-f5", 4.0), ("double-gauss", 2.8)])
def test_interpolated_waves_are_those_of_all_rays_traced(name: str, f_number: float) -> None:
    lens = read_prescription(LENSES / f"{name}.toml")
    lens = with_fixed_stop(replace(lens, aperture_kind="f_number", aperture_value=f_number))
    waves_um = torch.tensor([0.6], dtype=torch.float64)
    slopes = _slopes(12.0)
    coarse, smooth = coarse_pupil(lens, slopes, waves_um)
    assert smooth
    few = pixel_light(waves_of(coarse, 0, 0, 21, 2.0), 21, 2.0)
    many = pixel_light(traced_waves(lens, slopes[0], coarse, (0, 0), 21, 2.0), 21, 2.0)
    assert float((few - many).abs().sum()) < 1e-4


def test_vignetted_pupil_is_cut_as_its_rays_are() -> None:
    """The first and the last rim cut the beam of 12 degrees to two thirds."""
    lens = with_fixed_stop(read_prescription(LENSES / "cooke-triplet-f5.toml"))
    front = replace(lens.surfaces[0], semi_diameter_mm=6.0)
    back = replace(lens.surfaces[-1], semi_diameter_mm=5.0)
    lens = replace(lens, surfaces=(front, *lens.surfaces[1:-1], back))
    slopes, waves_um = _slopes(12.0), torch.tensor([0.55], dtype=torch.float64)
    coarse, smooth = coarse_pupil(lens, slopes, waves_um)
    assert smooth
    few = waves_of(coarse, 0, 0, 31, 3.0)
    many = traced_waves(lens, slopes[0], coarse, (0, 0), 31, 3.0)
    whole = waves_of(replace(coarse, margins=coarse.margins[:0]), 0, 0, 31, 3.0)
    share = float(few.flux.sum() / whole.flux.sum())
    assert 0.4 < share < 0.9
    assert float(many.flux.sum() / whole.flux.sum()) == pytest.approx(share, abs=5e-3)
    apart = pixel_light(few, 31, 3.0) - pixel_light(many, 31, 3.0)
    assert float(apart.abs().sum()) < 0.02


def test_lens_that_loses_rays_beyond_its_rims_is_traced_whole() -> None:
    """Rays at the edge of a wide stop miss a surface, far beyond the rims."""
    lens = read_prescription(LENSES / "cooke-triplet-f5.toml")
    lens = replace(lens, aperture_kind="stop_semi_diameter_mm", aperture_value=9.5)
    rims = [replace(s, semi_diameter_mm=7.0) for s in lens.surfaces]
    lens = replace(lens, surfaces=tuple(rims))
    slopes, waves_um = _slopes(20.0), torch.tensor([0.55], dtype=torch.float64)
    _, smooth = coarse_pupil(lens, slopes, waves_um)
    psf = wave_psf(lens, slopes, waves_um, 5, 20.0)
    rays = trace_psf(lens, chief_heights(lens, slopes), waves_um, 5, 20.0)
    assert float(psf.kernels.sum()) == pytest.approx(1)
    assert float((psf.kernels - rays.kernels).abs().sum()) < 0.25
    assert not smooth


def test_wide_blur_is_that_of_rays_with_their_centre_and_orientation() -> None:
    """Defocused by 0.6 mm at F/5: 14 Airy radii; a point at +y, rows away from the axis."""
    lens = with_focus_shift(read_prescription(LENSES / "cooke-triplet-f5.toml"), 0.6)
    slopes, waves_um = _slopes(0.0, 20.0), torch.tensor([0.55], dtype=torch.float64)
    waves = wave_psf(lens, slopes, waves_um, 41, 6.0)
    rays = trace_psf(lens, chief_heights(lens, slopes), waves_um, 41, 6.0)
    row = torch.arange(41, dtype=torch.float64) - 20
    for field in range(2):
        middles = [float((p.kernels[field, 0].sum(-1) * row).sum()) for p in (waves, rays)]
        assert middles[0] == pytest.approx(middles[1], abs=0.05)
    apart = (waves.kernels - rays.kernels).abs().sum((-2, -1))
    assert float(apart.max()) < 0.35
    assert float((waves.kernels.flip(-2) - rays.kernels).abs().sum((-2, -1))[1, 0]) > 0.5


def test_perfect_lens_has_the_airy_pattern_of_its_cone() -> None:
    """AL2550-A at 780 nm: 62 pm of ray error; half of the peak at 1.029 / 2 wavelengths F."""
    lens = thorlabs_al2550()
    waves_um = torch.tensor([0.78], dtype=torch.float64)
    kernel = wave_psf(lens, torch.zeros(1, dtype=torch.float64), waves_um, 101, 0.05).kernels[0, 0]
    # sin u = 11.5 / f: the lens is free of coma but for the plane's
    half_px = 1.02899397 / 2 * 0.78 * 50.0016 / 23 / 0.05
    line = kernel[50, 50:].numpy() / float(kernel[50, 50])
    assert float(np.interp(-0.5, -line, np.arange(51))) == pytest.approx(half_px, rel=0.03)
    assert math.isclose(float(kernel.sum()), 1, rel_tol=1e-9)


def test_fields_without_waves_are_left_out_whatever_they_hold() -> None:
    """A field so wide that no ray arrives costs nothing to the others."""
    lens, waves_um = _cooke(), torch.tensor([0.5, 0.6], dtype=torch.float64)
    mask = torch.tensor([[True, False], [False, False], [True, True]])
    some = wave_psf(lens, _slopes(0.0, 75.0, 20.0), waves_um, 15, 1.5, mask=mask).kernels
    whole = wave_psf(lens, _slopes(0.0, 20.0), waves_um, 15, 1.5).kernels
    assert torch.equal(some[0, 0], whole[0, 0])
    assert torch.equal(some[2], whole[1])
    assert not bool(some[~mask].any())
