from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.variables import FreeLens, Variable


@pytest.fixture
def lens() -> Lens:
    """Give a triplet with its stop inside, about 50 mm at F/5."""
    rows = [
        (1 / 22.01359, 3.25896, "SK16-Hikari"),
        (-1 / 435.76044, 6.00755, "air"),
        (-1 / 22.21328, 0.99997, "F2-Schott"),
        (1 / 20.29192, 4.75041, "air"),
        (1 / 79.68360, 2.95208, "SK16-Hikari"),
        (-1 / 18.39533, 42.3, "air"),
    ]
    surfaces = tuple(Surface(curvature_per_mm=c, thickness_mm=t, glass=g) for c, t, g in rows)
    return Lens(
        name="triplet",
        surfaces=surfaces,
        stop=3,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=10.0,
        field_angles_rad=(0.0, 0.2),
        wavelengths_um=(0.48, 0.55, 0.65),
    )


@pytest.fixture
def free(lens: Lens) -> FreeLens:
    """Free two curvatures, a conic, a gap, a term and the defocus; solve the last curvature."""
    return FreeLens(
        lens=lens,
        variables=(
            Variable(kind="curvature", surface=0, low=0.03, high=0.06),
            Variable(kind="curvature", surface=3, low=0.03, high=0.07),
            Variable(kind="conic", surface=2, low=-2, high=2),
            Variable(kind="thickness", surface=1, low=4, high=8),
            Variable(kind="even_asphere", surface=4, term=1, low=-1e-5, high=1e-5),
            Variable(kind="defocus", low=-1, high=1),
        ),
        solved=5,
        efl_mm=50.0,
    )


@pytest.fixture
def problem(free: FreeLens) -> Problem:
    """Look at two fields in three colours."""
    return Problem(
        free=free,
        slopes=torch.tensor([0.0, 0.2], dtype=torch.float64),
        wavelengths_um=torch.tensor([0.48, 0.55, 0.65], dtype=torch.float64),
        samples=half_disc(30),
        limits=Limits(),
    )


@pytest.fixture
def near_problem(problem: Problem) -> Problem:
    """Look at the same from two near depths."""
    lens = replace(problem.free.lens, object_distance_mm=1000.0)
    free = replace(problem.free, lens=lens)
    return replace(problem, free=free, object_distances_mm=(1000.0, 700.0))
