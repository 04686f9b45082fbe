from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.errors import UnsupportedError
from camkit.models_def.optics.analysis.lens_waves import wave_psf
from camkit.models_def.optics.analysis.psf_model import psf_model
from camkit.models_def.optics.analysis.spots import field_slopes
from camkit.models_def.optics.prescription import Surface, read_prescription
from camkit.models_def.optics.shape.stance import Stance
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


def test_uneven_lens_goes_by_rays_and_refuses_waves() -> None:
    """Waves are summed from half the pupil, whose other half is its mirror."""
    lens, waves = thorlabs_al2550(), torch.tensor([0.78], dtype=torch.float64)
    askew = Stance(decentre_mm=(0.1, 0.0), tilt_rad=(0.0, 0.0))
    stop = Surface(curvature_per_mm=0.0, thickness_mm=1.0)
    first = replace(lens.surfaces[0], stance=askew)
    lens = replace(lens, surfaces=(stop, first, *lens.surfaces[1:]), stop=0)
    found = psf_model(lens, torch.zeros(1, dtype=torch.float64), waves)
    assert found.regime == "rays"
    assert "this lens is not round" in found.reason
    with pytest.raises(UnsupportedError, match="surface 1"):
        wave_psf(lens, torch.zeros(1, dtype=torch.float64), waves, 9, 2.0)
