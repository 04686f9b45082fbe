"""Power, irregularity and wedge against closed forms, and against a slow trace."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.optimize import brentq

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import PupilSamples
from camkit.models_def.optics.shape.phase import Phase
from camkit.models_def.optics.tolerance.deviation import Deviations, no_deviations
from camkit.models_def.optics.tolerance.errors import ErrorWidth, Tolerances
from camkit.models_def.optics.tolerance.fabricated import View, fabricated_tensors, land
from camkit.models_def.optics.tolerance.figure import (
    FRINGE_MM,
    Figure,
    aperture_radii_mm,
    power_curvature,
    refract_at_figure,
)
from camkit.models_def.optics.tolerance.landing import spot_rms_mm
from camkit.models_def.optics.trace import Rays, surface_tensors
from tests.thin_factory import GLASS, index_at

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
COOKE = read_lens(PRESCRIPTIONS / "cooke-triplet.toml")
DUET = read_lens(PRESCRIPTIONS / "duet.toml")
WAVE_UM, RADIUS_MM, BEAM_MM, FAR_MM = 0.55, 10.0, 8.0, 1000.0
FILLED = (BEAM_MM / RADIUS_MM) ** 2
INDEX = index_at(WAVE_UM)


def plate() -> Lens:
    """Return a stop, a thin plane plate, and a sensor far behind."""
    return Lens(
        name="plate",
        surfaces=(
            Surface(curvature_per_mm=0.0, thickness_mm=1.0),
            Surface(
                curvature_per_mm=0.0, thickness_mm=0.01, glass=GLASS, semi_diameter_mm=RADIUS_MM
            ),
            Surface(curvature_per_mm=0.0, thickness_mm=FAR_MM, semi_diameter_mm=RADIUS_MM),
        ),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=BEAM_MM,
        wavelengths_um=(WAVE_UM,),
        reference_wavelength_um=WAVE_UM,
        field_angles_rad=(0.0,),
    )


def view_at(x: np.ndarray, y: np.ndarray, slope: float = 0.0, azimuth_deg: float = 0.0) -> View:
    return View(
        slopes=torch.tensor([slope], dtype=torch.float64),
        azimuths_rad=torch.deg2rad(torch.tensor([azimuth_deg], dtype=torch.float64)),
        wavelengths_um=torch.tensor([WAVE_UM], dtype=torch.float64),
        samples=PupilSamples(x=torch.from_numpy(x), y=torch.from_numpy(y)),
    )


def with_error(lens: Lens, **arrays: list) -> Deviations:
    return replace(no_deviations(lens), **{k: np.array([v], float) for k, v in arrays.items()})


def wavefront_mm(lens: Lens, deviations: Deviations, direction: tuple[float, float]) -> np.ndarray:
    """Return the wavefront along a line through the pupil, from the slopes of its rays."""
    along = np.linspace(0, 1, 41)
    landing = land(lens, deviations, view_at(along * direction[0], along * direction[1]), "none")
    moved = [
        getattr(landing.rays, k).flatten().numpy() - BEAM_MM * along * d
        for k, d in zip("xy", direction, strict=True)
    ]
    slope = (moved[0] * direction[0] + moved[1] * direction[1]) / FAR_MM
    step = np.diff(along) * BEAM_MM
    return np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2 * step)])


def test_a_fringe_is_half_the_green_line_of_mercury() -> None:
    assert pytest.approx(0.546_07e-3 / 2) == FRINGE_MM


@pytest.mark.parametrize("turned_deg", [0.0, 30.0, 75.0])
def test_a_saddle_of_f_fringes_gives_a_wavefront_of_n_less_1_times_f_half_waves(
    turned_deg: float,
) -> None:
    fringes, angle = 2.5, math.radians(turned_deg)
    pair = [fringes * math.cos(2 * angle), fringes * math.sin(2 * angle)]
    drawn = with_error(plate(), irregularity_fringes=[[0, 0], pair, [0, 0]])
    high = wavefront_mm(plate(), drawn, (math.cos(angle), math.sin(angle)))
    low = wavefront_mm(plate(), drawn, (-math.sin(angle), math.cos(angle)))
    between = wavefront_mm(
        plate(), drawn, (math.cos(angle + np.pi / 4), math.sin(angle + np.pi / 4))
    )
    peak_to_valley = FILLED * (INDEX - 1) * fringes * 0.546_07e-3 / 2
    assert abs(high[-1] - low[-1]) == pytest.approx(peak_to_valley, rel=1e-4)
    assert high[-1] == pytest.approx(-low[-1], rel=1e-4)
    np.testing.assert_allclose(between, 0, atol=1e-4 * peak_to_valley)


def test_a_phase_of_the_surface_stays_beside_its_irregularity() -> None:
    """The wavefront of both is the sum of both; the rays' places differ in second order."""
    surfaces = list(plate().surfaces)
    surfaces[1] = replace(surfaces[1], phase=Phase(radius_mm=RADIUS_MM, radial_rad=(-40.0,)))
    lens = replace(plate(), surfaces=tuple(surfaces))
    drawn = with_error(lens, irregularity_fringes=[[0, 0], [2.0, 0], [0, 0]])
    whole, phase = (wavefront_mm(lens, one, (1.0, 0.0)) for one in (drawn, no_deviations(lens)))
    saddle = wavefront_mm(plate(), drawn, (1.0, 0.0))
    assert abs(phase[-1]) > 5 * abs(saddle[-1])
    np.testing.assert_allclose(whole - phase, saddle, atol=1e-2 * abs(saddle[-1]))


def test_power_and_half_as_strong_a_saddle_are_a_cylinder() -> None:
    """Of a cylinder of f fringes along x, rays beside it in y are not bent."""
    fringes = 3.0
    drawn = with_error(
        plate(),
        irregularity_fringes=[[0, 0], [fringes, 0], [0, 0]],
        power_fringes=[0, fringes / 2, 0],
    )
    whole = FILLED * (INDEX - 1) * fringes * FRINGE_MM
    assert abs(wavefront_mm(plate(), drawn, (1.0, 0.0))[-1]) == pytest.approx(whole, rel=1e-4)
    np.testing.assert_allclose(wavefront_mm(plate(), drawn, (0.0, 1.0)), 0, atol=1e-4 * whole)


def test_a_wedge_turns_light_by_n_less_1_times_its_angle() -> None:
    wedge = 1e-3
    drawn = with_error(plate(), wedge_rad=[[0, 0], [wedge, 0], [0, 0]])
    origin = np.zeros(1)
    landing = land(plate(), drawn, view_at(origin, origin), "none")
    # the rear stands at z = wedge y: the glass is thick at +y, where light is turned to
    turned = math.asin(INDEX * math.sin(wedge)) - wedge
    assert float(landing.rays.y) == pytest.approx(FAR_MM * math.tan(turned), rel=1e-9)
    assert turned == pytest.approx((INDEX - 1) * wedge, rel=1e-5)
    aside = land(plate(), drawn, view_at(origin, origin, azimuth_deg=90.0), "none")
    # the field at +x sees the same error from the side
    assert float(aside.rays.y) == pytest.approx(0, abs=1e-12)
    assert float(aside.rays.x) == pytest.approx(-float(landing.rays.y), rel=1e-12)


def test_an_element_with_wedge_is_one_whose_rear_alone_is_tilted() -> None:
    """Cemented glass: each wedge turns the surface behind its own glass."""
    gauss = read_lens(PRESCRIPTIONS / "double-gauss.toml")
    glasses = [i for i, s in enumerate(gauss.surfaces) if s.glass != "air"]
    for i in glasses:
        wedge, tilt = (np.zeros((len(gauss.surfaces), 2)) for _ in range(2))
        wedge[i] = tilt[i + 1] = (3e-4, -2e-4)
        np.testing.assert_array_equal(
            with_error(gauss, wedge_rad=wedge.tolist()).surface_turn_rad,
            with_error(gauss, surface_tilt_rad=tilt.tolist()).surface_turn_rad,
        )


@pytest.mark.parametrize("number", [0, 3, 5])
def test_power_moves_the_focus_as_the_change_of_the_radius_does(number: int) -> None:
    """By ISO 10110-5 a sphere is off by (1 - cos) times the change of its radius at the rim."""
    fringes = 4.0
    surface, count = COOKE.surfaces[number], len(COOKE.surfaces)
    radius = 1 / surface.curvature_per_mm
    cosine = math.sqrt(1 - (aperture_radii_mm(COOKE)[number] / radius) ** 2)
    # the curvature grows towards +z: the radius loses, whatever its sign
    other = radius - fringes * FRINGE_MM / (1 - cosine)
    power = np.where(np.arange(count) == number, fringes, 0.0)
    relative = np.where(np.arange(count) == number, other / radius - 1, 0.0)
    origin = np.zeros(1)
    found, wanted = (
        land(COOKE, with_error(COOKE, **error), view_at(origin, origin), "paraxial").refocus_mm
        for error in ({"power_fringes": power.tolist()}, {"radius": relative.tolist()})
    )
    assert abs(float(wanted)) > 1e-3
    # to first order: the error of the radius is not small beside the radius itself
    assert float(found) == pytest.approx(float(wanted), rel=2 * abs(other / radius - 1))


@pytest.mark.parametrize("conic", [0.0, -1.0, -3.0, 0.4])
def test_power_lies_so_many_fringes_beside_the_surface_at_its_rim(conic: float) -> None:
    c, rim, fringes = 1 / 40, 15.0, 1.0

    def sag(curvature: float, r: float) -> float:
        return curvature * r**2 / (1 + math.sqrt(1 - (1 + conic) * (curvature * r) ** 2))

    def distance(r: float) -> float:
        """Return the distance of a point of the new surface from that at the rim of the old."""
        return math.hypot(r - rim, sag(bent, r) - sag(c, rim))

    tensors = (torch.tensor(v, dtype=torch.float64) for v in (c, conic, rim))
    bent = c + fringes * float(power_curvature(*tensors))
    nearest = min(distance(r) for r in np.linspace(rim - 1e-3, rim + 1e-3, 200_001))
    assert nearest == pytest.approx(FRINGE_MM, rel=1e-3)


def slow_refraction(
    height: Callable[[float, float], float], start: np.ndarray, into: np.ndarray, ratio: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return where a ray meets z = height(x, y), and its direction behind it."""

    def gap(way: float) -> float:
        x, y, z = start + way * into
        return z - height(x, y)

    point = start + brentq(gap, -20.0, 20.0, xtol=1e-15) * into
    step = 1e-4
    lean = [
        (height(point[0] + dx, point[1] + dy) - height(point[0] - dx, point[1] - dy)) / (2 * step)
        for dx, dy in ((step, 0.0), (0.0, step))
    ]
    normal = np.array([-lean[0], -lean[1], 1.0]) / math.hypot(*lean, 1.0)
    cosine = into @ normal
    out = ratio * into + (math.sqrt(1 - ratio**2 * (1 - cosine**2)) - ratio * cosine) * normal
    return point, out


@pytest.mark.parametrize(("conic", "term"), [(0.0, 0.0), (-1.5, 0.0), (0.4, 2e-5)])
@pytest.mark.parametrize(
    ("x", "y", "slopes"),
    [(5.0, 3.0, (0.0, 0.4)), (-7.0, 2.0, (0.3, -0.2)), (0.0, 8.0, (0.0, -0.5))],
)
def test_rays_are_bent_as_by_the_irregular_surface_itself(
    conic: float, term: float, x: float, y: float, slopes: tuple[float, float]
) -> None:
    """A slow trace of the displaced surface; what is left falls with the square of the error."""
    c = 1 / 30
    lens = Lens(
        name="one",
        surfaces=(
            Surface(
                curvature_per_mm=c,
                thickness_mm=5.0,
                glass=GLASS,
                conic=conic,
                even_asphere=(0.0, term),
            ),
            Surface(curvature_per_mm=0.0, thickness_mm=5.0),
        ),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=10.0,
    )
    tensors = surface_tensors(lens, torch.tensor([WAVE_UM], dtype=torch.float64))
    into = np.array([*slopes, 1.0]) / math.hypot(*slopes, 1.0)
    start = np.array([x, y, 0.0])
    values = (torch.tensor([v], dtype=torch.float64) for v in (*start, *into))
    rays = Rays(
        **dict(zip(("x", "y", "z", "l", "m", "n"), values, strict=True)),
        fate=torch.zeros(1, dtype=torch.int8),
    )

    def left(a: float, b: float) -> tuple[float, float, float]:
        def height(x: float, y: float) -> float:
            rho = x * x + y * y
            root = math.sqrt(1 - (1 + conic) * c * c * rho)
            # displaced along the normal: 1 / its z more along the axis
            error = a * (x * x - y * y) + 2 * b * x * y
            lean = math.sqrt(rho) * (c / root + 4 * term * rho)
            return c * rho / (1 + root) + term * rho**2 + error * math.hypot(1.0, lean)

        point, out = slow_refraction(height, start, into, 1 / INDEX)
        figure = Figure(
            along_per_mm=torch.tensor(a, dtype=torch.float64),
            across_per_mm=torch.tensor(b, dtype=torch.float64),
        )
        found = refract_at_figure(figure, tensors, rays, 0)
        at = np.array([float(v) for v in (found.x, found.y, found.z)])
        to = np.array([float(v) for v in (found.l, found.m, found.n)])
        # how far the ray runs beside the other one
        beside = np.linalg.norm(np.cross(at - point, out))
        return float(beside), float(np.linalg.norm(to - out)), float(np.linalg.norm(to - nominal))

    nominal = np.array([float(v) for v in _nominal(tensors, rays)])
    a, b = 5 * FRINGE_MM / 2 / 100, -3 * FRINGE_MM / 2 / 100
    beside_mm, angle, effect = left(a, b)
    assert effect > 1e-5
    assert angle < 1e-3 * effect
    assert beside_mm < 1e-6
    assert left(10 * a, 10 * b)[1] < 300 * angle + 1e-9


def _nominal(tensors, rays: Rays) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    none = torch.zeros((), dtype=torch.float64)
    flat = refract_at_figure(Figure(along_per_mm=none, across_per_mm=none), tensors, rays, 0)
    return flat.l, flat.m, flat.n


def test_irregular_surfaces_along_x_and_y_are_the_same_on_the_axis() -> None:
    gauss = read_lens(PRESCRIPTIONS / "double-gauss.toml")
    half = np.linspace(0.1, 1.0, 12)
    golden = 2.4 * np.arange(12)
    x = np.concatenate([half * np.cos(golden + k * np.pi / 2) for k in range(4)])
    y = np.concatenate([half * np.sin(golden + k * np.pi / 2) for k in range(4)])
    spots = []
    for sign in (1.0, -1.0):
        fringes = np.zeros((len(gauss.surfaces), 2))
        fringes[3, 0] = sign * 2
        drawn = with_error(gauss, irregularity_fringes=fringes.tolist())
        spots.append(float(spot_rms_mm(land(gauss, drawn, view_at(x, y), "none"))))
    assert spots[0] == pytest.approx(spots[1], rel=1e-9)


def test_fringes_are_counted_over_the_rim_or_as_far_as_light_reaches() -> None:
    rims = aperture_radii_mm(DUET)
    assert rims == tuple(s.semi_diameter_mm for s in DUET.surfaces)
    bare = replace(
        DUET, surfaces=tuple(replace(s, semi_diameter_mm=math.inf) for s in DUET.surfaces)
    )
    # the design's rims leave a little room around the light
    np.testing.assert_array_less(aperture_radii_mm(bare), np.array(rims) + 1e-9)
    np.testing.assert_allclose(aperture_radii_mm(bare), rims, rtol=0.1)


def test_power_of_a_plane_bends_it() -> None:
    lens = plate()
    drawn = with_error(lens, power_fringes=[0, 2.0, 0])
    curvature = fabricated_tensors(lens, drawn, torch.tensor([WAVE_UM])).curvature_per_mm
    assert float(curvature[1].squeeze()) == pytest.approx(2 * 2 * FRINGE_MM / RADIUS_MM**2)


def test_wrong_sizes_are_refused() -> None:
    for key in ("power", "irregularity"):
        with pytest.raises(ContractError, match="100 fringes"):
            Tolerances(**{key: ErrorWidth(half_width=101.0)})
    with pytest.raises(ContractError, match="tilts"):
        Tolerances(wedge=ErrorWidth(half_width=1.0))
