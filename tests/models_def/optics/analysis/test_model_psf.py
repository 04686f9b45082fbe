"""Rays or waves by one rule, wherever kernels are made."""

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest
import torch

from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.analysis.lens_waves import wave_psf
from camkit.models_def.optics.analysis.model_psf import model_psf
from camkit.models_def.optics.analysis.psf_model import WAVE_BELOW, checked_regime, psf_model
from camkit.models_def.optics.kernel_bank import colour_kernels, gaussian_response, wavelength_grid
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.prescription import Lens, read_prescription, with_focus_shift
from camkit.models_def.optics.psf import trace_psf
from camkit.models_def.optics.spot import slopes_for_heights
from camkit.models_def.training.kind import read_recipe

MODELS: Final = Path(__file__).resolve().parents[4] / "models_def"
GREEN: Final = torch.tensor([0.52, 0.56], dtype=torch.float64)


def _cooke() -> Lens:
    return read_prescription(MODELS / "prescriptions" / "cooke-triplet-f5.toml")


def _heights(*values_mm: float) -> torch.Tensor:
    return torch.tensor(values_mm, dtype=torch.float64)


def test_sharp_kernels_are_those_of_waves_and_wide_ones_those_of_rays() -> None:
    """On the axis 1.3 Airy radii; defocused by 0.7 mm 14 of them."""
    sharp, wide = _cooke(), with_focus_shift(_cooke(), 0.7)
    heights = _heights(0.0)
    found = model_psf(sharp, heights, GREEN, 15, 3.0, regime="waves", rays=500)
    waves = wave_psf(sharp, slopes_for_heights(sharp, heights), GREEN, 15, 3.0)
    assert torch.equal(found.kernels, waves.kernels)
    axis = torch.zeros(1, dtype=torch.float64)
    assert float(psf_model(wide, axis, GREEN).ratio.min()) > WAVE_BELOW
    found = model_psf(wide, heights, GREEN, 41, 6.0, regime="waves", rays=500)
    assert torch.equal(found.kernels, trace_psf(wide, heights, GREEN, 41, 6.0, rays=500).kernels)


def test_rays_are_what_they_were() -> None:
    heights = _heights(0.0, 8.0)
    found = model_psf(_cooke(), heights, GREEN, 21, 6.0, regime="rays", rays=500)
    assert torch.equal(
        found.kernels, trace_psf(_cooke(), heights, GREEN, 21, 6.0, rays=500).kernels
    )


def test_window_of_waves_ends_where_their_light_does() -> None:
    psf = model_psf(_cooke(), _heights(0.0), GREEN, 201, 6.0, regime="waves", rays=500, light=0.98)
    filled = psf.kernels[0, 0].sum(0) > 0
    assert 11 < int(filled.sum()) < 61
    assert 0.975 < float(psf.energy_kept.min()) < 0.999


def test_colour_is_judged_with_all_its_light() -> None:
    """Duet's axial colour: each wavelength alone is sharper than the colours that they make."""
    lens = find_lens("duet")
    slopes = torch.zeros(1, dtype=torch.float64)
    waves = torch.tensor([0.44, 0.47, 0.50], dtype=torch.float64)
    alone = psf_model(lens, slopes, waves)
    together = psf_model(lens, slopes, waves, torch.full((1, 3), 1 / 3, dtype=torch.float64))
    assert float(together.ratio[0, 0]) > float(alone.ratio.min()) + 1


@pytest.mark.parametrize("name", ["duet", "duet_joint", "trio_edof", "thin_plate"])
def test_built_in_cameras_are_frozen_by_rays(name: str) -> None:
    """So that freezing them again gives their bits."""
    recipe = read_recipe(MODELS / "recipes" / f"{name}.toml")
    assert isinstance(recipe.sensor, ColorSensor)
    lens = find_lens(name.replace("_", "-"), MODELS / "recipes")
    optics = LensOptics(lens=lens).by_rule(recipe.sensor)
    assert optics.regime == "rays"
    assert optics.blur_airy is not None
    assert optics.blur_airy > WAVE_BELOW
    assert optics.facts["psf_model"] == "rays"
    assert optics.lost_diffraction == ""


def test_sharp_lens_takes_waves_unless_told_otherwise() -> None:
    sensor = read_recipe(MODELS / "recipes" / "duet.toml").sensor
    assert isinstance(sensor, ColorSensor)
    optics = LensOptics(lens=find_lens("double-gauss"))
    assert optics.by_rule(sensor).regime == "waves"
    assert optics.by_rule(sensor).lost_diffraction == ""
    rays = optics.by_rule(sensor, regime="rays")
    assert rays.regime == "rays"
    assert "rays leave out diffraction, which counts here" in rays.lost_diffraction
    with pytest.raises(ContractError, match="rays, waves"):
        optics.by_rule(sensor, regime="both")


def test_grooves_are_never_waves() -> None:
    sensor = read_recipe(MODELS / "recipes" / "duet.toml").sensor
    assert isinstance(sensor, ColorSensor)
    optics = LensOptics(lens=find_lens("thin-plate-stop"))
    assert optics.by_rule(sensor).regime == "rays"
    with pytest.raises(UnsupportedError, match="grooves"):
        optics.by_rule(sensor, regime="waves")


def test_training_kernels_hold_the_light_of_waves() -> None:
    response = gaussian_response(wavelength_grid(3, 0.5, 0.6))
    lens = replace(_cooke(), aperture_value=4.0)
    kernels, energy = colour_kernels(
        lens, response, np.array([0.0]), size_px=31, pitch_um=6.0, rays=400, regime="waves"
    )
    by_rays, _ = colour_kernels(lens, response, np.array([0.0]), size_px=31, pitch_um=6.0, rays=400)
    assert 0.97 < energy < 1
    assert np.abs(kernels - by_rays)[0, 1].sum() > 0.2
    assert kernels.sum((-2, -1)) == pytest.approx(1, abs=1e-5)


def test_unknown_model_is_refused_by_the_name_of_its_key() -> None:
    assert checked_regime("") is None
    with pytest.raises(ContractError, match=r"lens\.psf_model is one of rays, waves; got 'light'"):
        checked_regime("light", "lens.psf_model")
