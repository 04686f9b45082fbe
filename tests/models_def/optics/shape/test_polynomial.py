"""Surfaces in powers of r, normalised or not, and Q aspheres: the same surface, the same rays."""

import math
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import (
    Lens,
    Surface,
    format_prescription,
    parse_prescription,
)
from camkit.models_def.optics.scaling import scale_lens
from camkit.models_def.optics.trace import Rays, surface_tensors, trace

INDEX = 1.5
EQUAL_MM = 1e-11
X = torch.tensor([0.0, 0.0, 3.0, -2.0], dtype=torch.float64)
Y = torch.tensor([4.0, -5.0, 1.0, 2.5], dtype=torch.float64)


def _lens(front: Surface) -> Lens:
    """A stop, a singlet of index 1.5 (put in by `_trace`), a sensor."""
    surfaces = (
        Surface(curvature_per_mm=0, thickness_mm=2.0),
        replace(front, thickness_mm=6.0),
        Surface(curvature_per_mm=0, thickness_mm=45.0),
    )
    return Lens(
        name="x",
        surfaces=surfaces,
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=10.0,
    )


def _trace(front: Surface, angle_deg: float = 5.0) -> Rays:
    tensors = surface_tensors(_lens(front), torch.tensor(0.55, dtype=torch.float64))
    tensors = replace(tensors, index=torch.tensor([1.0, 1.0, INDEX, 1.0], dtype=torch.float64))
    angle, one = math.radians(angle_deg), torch.ones_like(X)
    direction = {"l": 0 * X, "m": one * math.sin(angle), "n": one * math.cos(angle)}
    fate = torch.zeros(4, dtype=torch.int8)
    end = trace(tensors, Rays(x=X, y=Y, z=0 * X, **direction, fate=fate), path=True)
    assert bool(end.valid.all())
    return end


def _surface(**numbers: object) -> Surface:
    return Surface(**{"curvature_per_mm": 0.0, "thickness_mm": 1.0, **numbers})  # type: ignore[arg-type]


PARABOLA = _surface(curvature_per_mm=0.03, conic=-1.0)
QUARTIC = _surface(curvature_per_mm=0.03, conic=-1.0, even_asphere=(0.0, 2e-5))
MIXED = _surface(curvature_per_mm=0.03, even_asphere=(1e-4, 2e-6), odd_asphere=(0.0, -3e-5, 1e-7))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (PARABOLA, _surface(even_asphere=(0.015,))),
        (PARABOLA, _surface(even_asphere=(0.015 * 64,), normal_radius_mm=8.0)),
        (PARABOLA, _surface(even_asphere=(0.015,), odd_asphere=(0.0, 0.0))),
        (QUARTIC, replace(PARABOLA, even_asphere=(0.0, 2e-5 * 8**4), normal_radius_mm=8.0)),
        (QUARTIC, replace(PARABOLA, q_con=(2e-5 * 8**4,), normal_radius_mm=8.0)),
        (
            _surface(even_asphere=(0.015, -0.015 / 64)),
            _surface(q_bfs=(0.015 * 64,), normal_radius_mm=8.0),
        ),
        (
            MIXED,
            replace(
                MIXED,
                even_asphere=(1e-4 * 7**2, 2e-6 * 7**4),
                odd_asphere=(0.0, -3e-5 * 7**3, 1e-7 * 7**5),
                normal_radius_mm=7.0,
            ),
        ),
    ],
)
def test_one_surface_written_in_two_ways_bends_rays_alike(one: Surface, other: Surface) -> None:
    first, second = _trace(one), _trace(other)
    assert first.path_mm is not None
    assert second.path_mm is not None
    for name in ("x", "y", "l", "m", "path_mm"):
        assert float((getattr(first, name) - getattr(second, name)).abs().max()) < EQUAL_MM
    lenses = (_lens(replace(s, glass="N-BK7")) for s in (one, other))
    a, b = (paraxial_data(lens).efl_mm for lens in lenses)
    assert a == pytest.approx(b, rel=1e-12)


def test_thirty_terms_of_a_normalised_radius_are_a_conic() -> None:
    """The series of a hyperboloid in t = (r / R)^2, with its 30 terms, in single precision too."""
    c, k, radius = 0.03, -2.5, 12.0
    # h = (1 - sqrt(1 - w)) / ((1 + k) c) with w = (1 + k) c^2 r^2, by the binomial series
    terms, binomial = [], 1.0
    for j in range(1, 31):
        binomial *= (0.5 - (j - 1)) / j
        power = ((1 + k) * c**2 * radius**2) ** j
        terms.append(-binomial * (-1) ** j * power / ((1 + k) * c))
    conic = _surface(curvature_per_mm=c, conic=k)
    extended = _surface(even_asphere=tuple(terms), normal_radius_mm=radius)
    first, second = _trace(conic), _trace(extended)
    assert float((first.y - second.y).abs().max()) < EQUAL_MM
    tensors = surface_tensors(_lens(extended), torch.tensor(0.55)).converted(torch.float32)
    height = tensors.height(1, torch.tensor(100.0))
    wanted = surface_tensors(_lens(conic), torch.tensor(0.55)).height(1, torch.tensor(100.0))
    assert float(height) == pytest.approx(float(wanted), rel=1e-6)


def test_cone_bends_all_rays_alike() -> None:
    """An axicon: inside the glass parallel rays lean by a - asin(sin a / n), tan a its slope."""
    end = _trace(_surface(odd_asphere=(0.1,)), angle_deg=0.0)
    lean = math.atan(0.1)
    inside = lean - math.asin(math.sin(lean) / INDEX)
    radial = (end.l * X + end.m * Y) / torch.hypot(X, Y)
    assert radial.tolist() == pytest.approx([-INDEX * math.sin(inside)] * 4, rel=1e-12)


def test_ray_on_the_axis_passes_the_apex_of_a_cone() -> None:
    lens = _lens(_surface(odd_asphere=(0.1,), glass="N-BK7"))
    tensors = surface_tensors(lens, torch.tensor(0.55, dtype=torch.float64))
    odd = tensors.odd_asphere
    assert odd is not None
    odd.requires_grad_()
    zero = torch.zeros(1, dtype=torch.float64, requires_grad=True)
    rays = Rays(
        x=zero, y=zero, z=zero, l=zero, m=zero, n=zero + 1, fate=torch.zeros(1, dtype=torch.int8)
    )
    end = trace(tensors, rays)
    assert (end.x.tolist(), end.y.tolist()) == ([0.0], [0.0])
    assert bool(torch.isfinite(torch.autograd.grad(end.y.sum(), odd)[0]).all())


@pytest.mark.parametrize(
    ("front", "x", "y", "path", "within"),
    [
        (
            _surface(
                curvature_per_mm=1 / 30,
                conic=-0.5,
                odd_asphere=(0.0, -3e-5, -1e-7),
                even_asphere=(1e-4, 2e-6, 3e-9),
            ),
            [0, 0, 0.534867568824, -0.355564429886],
            [5.002177309653, 3.430838600025, 4.487135508886, 4.744092297522],
            [55.867904402, 56.506075173, 56.094306884, 55.985129186],
            1e-8,
        ),
        (
            _surface(curvature_per_mm=1 / 30, odd_asphere=(0.02, -3e-5)),
            [0, 0, 0.093304265286, -0.072336106711],
            [4.525472085922, 3.900175886515, 4.309453392026, 4.358921387462],
            [55.820855769, 56.539997273, 56.074994513, 55.947625109],
            1e-6,  # its Newton steps end at 1e-7 mm before a cone
        ),
        (
            _surface(
                curvature_per_mm=1 / 35,
                q_bfs=(0.05, -0.02, 0.01, 0.004, -0.002),
                normal_radius_mm=8.0,
            ),
            [0, 0, 0.858486988782, -0.573464896638],
            [5.475499871630, 2.903104184250, 4.615695821294, 5.038620006695],
            [55.896766652, 56.445483070, 56.098452035, 56.003007673],
            1e-8,
        ),
    ],
)
def test_rays_are_those_of_optiland(
    front: Surface, x: list[float], y: list[float], path: list[float], within: float
) -> None:
    """optiland 0.6.3: odd_asphere and forbes_qbfs, the same four rays at 5 degrees."""
    end = _trace(front)
    assert end.path_mm is not None
    assert end.x.tolist() == pytest.approx(x, abs=within)
    assert end.y.tolist() == pytest.approx(y, abs=within)
    assert end.path_mm.tolist() == pytest.approx(path, abs=within)


SHAPES = [
    MIXED,
    replace(MIXED, normal_radius_mm=7.0),
    _surface(curvature_per_mm=0.02, q_bfs=(0.05, -0.02), normal_radius_mm=8.0),
    _surface(curvature_per_mm=0.02, conic=-0.5, q_con=(0.05, -0.02), normal_radius_mm=8.0),
]


@pytest.mark.parametrize("front", SHAPES)
def test_prescription_comes_back_from_toml(front: Surface) -> None:
    lens = _lens(replace(front, curvature_per_mm=1 / 40))
    assert parse_prescription(format_prescription(lens)) == lens


@pytest.mark.parametrize("front", SHAPES)
def test_larger_lens_has_larger_heights(front: Surface) -> None:
    tensors, large = (
        surface_tensors(lens, torch.tensor(0.55))
        for lens in (_lens(front), scale_lens(_lens(front), 3.0))
    )
    rho = torch.tensor([1.0, 9.0, 25.0], dtype=torch.float64)
    assert (3 * tensors.height(1, rho)).tolist() == pytest.approx(
        large.height(1, 9 * rho).tolist(), rel=1e-12
    )


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"q_bfs": (0.1,)}, "needs normal_radius_mm"),
        ({"q_bfs": (0.1,), "normal_radius_mm": 5.0, "even_asphere": (1e-3,)}, "exclude"),
        ({"q_bfs": (0.1,), "normal_radius_mm": 5.0, "conic": -1.0}, "best fit"),
        ({"normal_radius_mm": 5.0}, "without coefficients"),
        ({"odd_asphere": (math.nan,)}, "finite"),
        ({"odd_asphere": (1.0,), "normal_radius_mm": 0.0}, "> 0"),
    ],
)
def test_what_has_no_meaning_is_refused(numbers: dict[str, object], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        _surface(**numbers)
