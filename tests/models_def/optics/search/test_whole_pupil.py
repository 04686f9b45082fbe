"""Lenses that are not round in a search: fields at azimuths, through the whole pupil."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.asymmetric.place_psf import trace_place_psf
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.problem import Problem, residuals, trace_batch
from camkit.models_def.optics.search.splat import Pixels, splat_batch
from camkit.models_def.optics.search.variables import FreeLens, Variable
from camkit.models_def.optics.shape.phase import Monomial, Phase
from camkit.models_def.optics.shape.stance import Stance

_COLOURS_UM = torch.tensor([0.46, 0.54, 0.6], dtype=torch.float64)
_PIXELS = Pixels(pitch_um=10.0, kernel_px=65, color_weights=torch.eye(3, dtype=torch.float64))


def _kernels(problem: Problem, scaled: Tensor) -> Tensor:
    traced = trace_batch(problem, scaled[None], math.inf)
    return splat_batch(traced.landings, _PIXELS, whole_pupil=problem.whole_pupil)[0]


def _azimuths(*degrees: float) -> Tensor:
    return torch.deg2rad(torch.tensor(degrees, dtype=torch.float64))


@pytest.fixture
def plated(problem: Problem) -> Problem:
    """Add a cubic plate at the stop, with free coefficients; look to four sides."""
    lens = problem.free.lens
    terms = (
        Monomial(p=3, q=0, coefficient_rad=30.0),
        Monomial(p=0, q=3, coefficient_rad=20.0),
        Monomial(p=2, q=1, coefficient_rad=0.0),
    )
    phase = Phase(radius_mm=5.0, radial_rad=(2.0,), free_rad=terms)
    surfaces = list(lens.surfaces)
    surfaces[3] = replace(surfaces[3], phase=phase)
    phases = (Variable(kind="phase", surface=3, term=i, low=-10.0, high=90.0) for i in range(4))
    free = replace(
        problem.free,
        lens=replace(lens, surfaces=tuple(surfaces)),
        variables=(*problem.free.variables[:3], *phases),
    )
    return replace(
        problem,
        free=free,
        slopes=torch.tensor([0.0, 0.2, 0.2, 0.2, 0.2], dtype=torch.float64),
        azimuths_rad=_azimuths(0, 0, 90, 180, 270),
    )


def test_a_round_lens_has_the_same_kernels_at_every_azimuth(problem: Problem) -> None:
    scaled = problem.free.scaled()
    half = _kernels(problem, scaled)
    around = replace(
        problem,
        slopes=torch.tensor([0.0, 0.2, 0.2], dtype=torch.float64),
        azimuths_rad=_azimuths(0, 0, 90),
    )
    whole = _kernels(around, scaled)
    torch.testing.assert_close(whole[:2], half)
    # the image at +x: rows and columns change places
    torch.testing.assert_close(whole[2], half[1].mT)
    spots = residuals(replace(around, azimuths_rad=_azimuths(0, 0, 233)), scaled[None])
    assert float(spots.square().sum()) == pytest.approx(
        float(
            residuals(replace(around, azimuths_rad=_azimuths(0, 0, 0)), scaled[None]).square().sum()
        )
    )


def test_kernels_of_a_plate_are_those_that_are_frozen() -> None:
    """With the stop in front both see one pupil: light, width and skewness of a corner agree."""
    duet = find_lens("duet")
    terms = (Monomial(p=3, q=0, coefficient_rad=30.0), Monomial(p=0, q=3, coefficient_rad=20.0))
    plate = replace(duet.surfaces[0], phase=Phase(radius_mm=6.25, free_rad=terms))
    lens = replace(duet, surfaces=(plate, *duet.surfaces[1:]))
    problem = Problem(
        free=FreeLens(lens=lens, variables=(), rides=False),
        slopes=torch.tensor([0.0, 0.2], dtype=torch.float64),
        wavelengths_um=_COLOURS_UM,
        samples=half_disc(500),
        azimuths_rad=_azimuths(0, 130),
    )
    traced = trace_batch(problem, torch.zeros(1, 0, dtype=torch.float64), math.inf)
    kernels = splat_batch(traced.landings, _PIXELS, whole_pupil=True)[0]
    landings = traced.landings
    # the landings of chief rays at the middle wavelength, which is that of the reference
    places = [(float(landings.x[0, f, 1, 0]), float(landings.y[0, f, 1, 0])) for f in (0, 1)]
    frozen = trace_place_psf(lens, places, _COLOURS_UM, 65, 10.0, rays=500)
    torch.testing.assert_close(kernels.sum((-2, -1)), frozen.energy_kept, rtol=0, atol=0.01)
    torch.testing.assert_close(_moments(kernels), _moments(frozen.kernels), rtol=0.01, atol=0.05)


def _moments(kernels: Tensor) -> Tensor:
    """Return widths and cubes along rows and columns about the centroid, in pixels."""
    place = torch.arange(kernels.shape[-1], dtype=torch.float64)
    moments = []
    for side in (-1, -2):
        profile = kernels.sum(side) / kernels.sum((-2, -1))[..., None]
        gap = place - (profile * place).sum(-1, keepdim=True)
        moments.append((profile * gap**2).sum(-1).sqrt())
        cube = (profile * gap**3).sum(-1)
        moments.append(cube.sign() * cube.abs() ** (1 / 3))
    return torch.stack(moments)


def test_free_phases_have_the_gradient_of_finite_differences(plated: Problem) -> None:
    """The sum of squares of spots, and a blurred look at the kernels, by every free number."""
    scaled = plated.free.scaled()
    smooth = torch.linspace(-1, 1, 65, dtype=torch.float64).mul(4).square().neg().exp()
    look = smooth[:, None] * smooth[None] * (1 + torch.linspace(-1, 1, 65, dtype=torch.float64))
    following = replace(_PIXELS, window_follows=True)

    def merits(at: Tensor) -> Tensor:
        traced = trace_batch(plated, at[None], math.inf)
        kernels = splat_batch(traced.landings, following, whole_pupil=True)[0]
        spots = residuals(replace(plated, merit="rms"), at[None]).square().sum()
        return torch.stack([spots, (kernels * look).sum()])

    at = scaled.clone().requires_grad_()
    slopes = [torch.autograd.grad(merit, at, retain_graph=True)[0] for merit in merits(at)]
    step = 1e-5
    for i in range(len(scaled)):
        move = torch.zeros_like(scaled)
        move[i] = step
        with torch.no_grad():
            difference = (merits(scaled + move) - merits(scaled - move)) / (2 * step)
        for slope, wanted, tolerance in zip(slopes, difference, (1e-6, 2e-2), strict=True):
            size = float(slope.abs().max())
            assert float(slope[i]) == pytest.approx(float(wanted), rel=1e-4, abs=tolerance * size)


def test_a_plate_is_refused_where_only_half_the_pupil_is_traced(plated: Problem) -> None:
    with pytest.raises(UnsupportedError, match=r"round lens.*optics\.azimuths_deg"):
        replace(plated, azimuths_rad=None)
    with pytest.raises(ContractError, match="5 fields need as many azimuths"):
        replace(plated, azimuths_rad=_azimuths(0, 90))
    bare = plated.free.lens_at(plated.free.scaled())
    tilted = _tilted(bare)
    with pytest.raises(UnsupportedError, match="surface 0 is tilted or decentred"):
        FreeLens(lens=tilted, variables=plated.free.variables)


def _tilted(lens: Lens) -> Lens:
    front, *rest = lens.surfaces
    stance = Stance(decentre_mm=(0.1, 0.0), tilt_rad=(0.0, 0.0))
    return replace(lens, surfaces=(replace(front, stance=stance), *rest))
