"""Third order against optiland's sums, a CODE V listing and real rays."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.analysis.first_order import paraxial_rays
from camkit.models_def.optics.analysis.seidel import seidel_sums
from camkit.models_def.optics.prescription import Lens, Surface, read_prescription
from camkit.models_def.optics.trace import surface_tensors, trace
from tests.physics.reference_lenses import cooke_triplet

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
PRINTED_MM = 6e-13
LISTED = 6e-7


def _double_gauss() -> Lens:
    lens = read_prescription(PRESCRIPTIONS / "double-gauss-f2.toml")
    # the listing's lines have four digits
    return replace(lens, reference_wavelength_um=0.5876, wavelengths_um=(0.4861, 0.5876, 0.6563))


def test_cooke_triplet_sums_equal_optiland() -> None:
    lens = replace(cooke_triplet(), field_angles_rad=(0.0, math.radians(20)))
    expected = [-0.006960263349, 0.001234887512, 0.008906606905, -0.025715842849, 0.001858817838]
    assert seidel_sums(lens).sums_mm.tolist() == pytest.approx(expected, abs=PRINTED_MM)


def test_double_gauss_transverse_aberrations_equal_code_v() -> None:
    expected = {
        "SA": -0.306954,
        "TCO": 0.037071,
        "TAS": -0.074910,
        "SAS": -0.160505,
        "PTB": -0.203302,
        "DST": -0.232420,
        "AX": -0.035003,
        "LAT": 0.012274,
        "PTZ": -0.002616,
    }
    found = seidel_sums(_double_gauss()).transverse_mm()
    assert found == pytest.approx(expected, abs=LISTED)


def test_lagrange_invariant_of_the_cooke_triplet() -> None:
    rays = paraxial_rays(cooke_triplet(), math.tan(math.radians(20)))
    assert float(rays.invariant_mm) == pytest.approx(-1.81985117133, abs=6e-12)
    n, u, ubar = rays.tensors.index, rays.marginal.slope, rays.chief.slope
    y, ybar = rays.marginal.height_mm, rays.chief.height_mm
    along = n[1:] * (u[1:] * ybar - ubar[1:] * y)
    assert torch.allclose(along, rays.invariant_mm.expand_as(along), rtol=0, atol=1e-12)


def _asphere(conic: float, a2: float, a4: float) -> Lens:
    return Lens(
        name="asphere",
        surfaces=(
            Surface(
                curvature_per_mm=1 / 30,
                thickness_mm=5.0,
                glass="N-BK7-Schott",
                conic=conic,
                even_asphere=(a2, a4),
            ),
            Surface(curvature_per_mm=-1 / 80, thickness_mm=40.0),
        ),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=1.0,
        field_angles_rad=(0.0, 0.01),
    )


@pytest.mark.parametrize(
    ("conic", "a2", "a4"), [(0, 0, 0), (-2.3, 0, 0), (0, 0, -9e-6), (0.7, 2e-3, 5e-6)]
)
def test_spherical_aberration_is_the_cubic_term_of_real_rays(
    conic: float, a2: float, a4: float
) -> None:
    """At the paraxial focus a real ray misses by SA (h / edge)^3, r^2 and r^4 terms included."""
    lens = _asphere(conic, a2, a4)
    rays = paraxial_rays(lens, 0.01)
    focus = -rays.marginal.height_mm[-1] / rays.marginal.slope[-1]
    tensors = surface_tensors(lens, torch.tensor(0.55, dtype=torch.float64))
    moved = replace(tensors, thickness_mm=torch.stack([tensors.thickness_mm[0], focus]))
    height = torch.tensor([0.5, 0.25], dtype=torch.float64)
    zero = torch.zeros((), dtype=torch.float64)
    miss = trace(moved, launch(zero, height, zero, math.inf)).y
    # the fifth order is taken out by two heights: y = SA + B at 1, SA / 8 + B / 32 at 1/2
    cubic = (32 * miss[1] - miss[0]) / 3
    sums = seidel_sums(lens)
    assert float(cubic) == pytest.approx(sums.transverse_mm()["SA"], rel=2e-5)


def test_stop_shift_leaves_spherical_and_petzval_and_moves_coma_by_the_theorem() -> None:
    """S_II* = S_II + (dy / y) S_I for a stop moved along the axis of a lens with asphere."""
    lens = _asphere(-0.5, 1e-3, 3e-6)
    front = Surface(curvature_per_mm=0.0, thickness_mm=7.0)
    shifted = replace(lens, surfaces=(front, *lens.surfaces))
    one, other = seidel_sums(lens), seidel_sums(shifted)
    base, moved = one.sums_mm.tolist(), other.sums_mm.tolist()
    assert moved[0] == pytest.approx(base[0], rel=1e-12)
    assert moved[3] == pytest.approx(base[3], rel=1e-12)
    share = float(math.tan(0.01) * 7.0 / 0.5)
    assert moved[1] == pytest.approx(base[1] + share * base[0], rel=1e-9)
    assert moved[2] == pytest.approx(base[2] + 2 * share * base[1] + share**2 * base[0], rel=1e-9)


def test_colour_sums_tell_the_shift_of_the_paraxial_focus() -> None:
    """C_L / (n'u'^2) is the distance between the foci of both colours, to first order."""
    lens = replace(cooke_triplet(), wavelengths_um=(0.549, 0.551))
    found = seidel_sums(lens)
    foci = [
        -float(r.marginal.height_mm[-1] / r.marginal.slope[-1])
        for r in (paraxial_rays(lens, 0.0, w) for w in lens.wavelengths_um)
    ]
    ours = float(found.axial_colour_mm.sum() / found.image_slope**2)
    assert abs(ours) == pytest.approx(abs(foci[1] - foci[0]), rel=2e-3)
