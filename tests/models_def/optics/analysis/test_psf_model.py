from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.analysis.psf_model import psf_model
from camkit.models_def.optics.analysis.spots import field_slopes
from camkit.models_def.optics.prescription import read_prescription
from tests.physics.reference_lenses import thorlabs_al2550

DUET = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions" / "duet.toml"


def test_lens_with_wide_blur_is_traced_by_rays() -> None:
    lens = read_prescription(DUET)
    slopes = field_slopes(lens)[[0, 4, 8]]
    waves = torch.tensor([0.54], dtype=torch.float64)
    found = psf_model(lens, slopes, waves)
    assert found.regime == "rays"
    assert "times the Airy radius" in found.reason
    assert float((found.blur_mm / found.airy_mm).min()) > 5


def test_sharp_lens_is_summed_from_waves() -> None:
    """AL2550-A at 780 nm: rays meet within 63 pm, the Airy disc is 2.1 um in radius."""
    lens = thorlabs_al2550()
    slopes = torch.zeros(1, dtype=torch.float64)
    waves = torch.tensor([0.78], dtype=torch.float64)
    found = psf_model(lens, slopes, waves)
    assert found.regime == "waves"
    # 1.22 wavelength / (2 sin u) with sin u = 11.5 / f for a lens without coma
    assert float(found.airy_mm) == pytest.approx(1.21967 * 0.78e-3 * 50.0016 / 23, rel=0.05)


def test_lens_without_light_is_told_so() -> None:
    lens = thorlabs_al2550()
    pinhole = replace(lens.surfaces[-1], semi_diameter_mm=0.1)
    blocked = replace(lens, surfaces=(lens.surfaces[0], pinhole))
    far = torch.tensor([1.0], dtype=torch.float64)
    found = psf_model(blocked, far, torch.tensor([0.78], dtype=torch.float64))
    assert found.regime == "rays"
    assert "no ray" in found.reason
