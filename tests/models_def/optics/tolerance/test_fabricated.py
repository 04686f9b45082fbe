import math
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.glass.dispersion import C_LINE_UM, D_LINE_UM, F_LINE_UM
from camkit.models_def.optics.grooves import Grooves
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.psf import trace_psf
from camkit.models_def.optics.pupil import PupilSamples, half_disc, with_fixed_stop
from camkit.models_def.optics.shape.phase import Phase
from camkit.models_def.optics.shape.stance import Stance
from camkit.models_def.optics.spot import rms_radius, slopes_for_heights, trace_spots
from camkit.models_def.optics.tolerance.deviation import Deviations, draw_deviations, no_deviations
from camkit.models_def.optics.tolerance.elements import glass_elements
from camkit.models_def.optics.tolerance.errors import ErrorWidth, Tolerances
from camkit.models_def.optics.tolerance.fabricated import View, fabricated_tensors, land
from camkit.models_def.optics.tolerance.landing import copy_kernels, spot_rms_mm, window_px
from camkit.models_def.optics.tolerance.misaligned_trace import trace_misaligned
from camkit.models_def.optics.tolerance.pose import poses
from camkit.models_def.optics.trace import SurfaceTensors, surface_tensors
from camkit.models_def.optics.tracing.sag import sag
from tests.thin_factory import GLASS, index_at, perfect_lens

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
DUET = read_lens(PRESCRIPTIONS / "duet.toml")
COOKE = read_lens(PRESCRIPTIONS / "cooke-triplet.toml")


def disc(rays: int) -> PupilSamples:
    half = half_disc(rays // 2)
    return PupilSamples(x=torch.cat([half.x, -half.x]), y=torch.cat([half.y, half.y]))


def view_of(lens: Lens, slopes: list[float], azimuths_deg: list[float], rays: int = 64) -> View:
    return View(
        slopes=torch.tensor(slopes, dtype=torch.float64),
        azimuths_rad=torch.deg2rad(torch.tensor(azimuths_deg, dtype=torch.float64)),
        wavelengths_um=torch.tensor(lens.wavelengths_um, dtype=torch.float64),
        samples=disc(rays),
    )


def with_error(lens: Lens, **arrays: list) -> Deviations:
    return replace(no_deviations(lens), **{k: np.array([v], float) for k, v in arrays.items()})


@pytest.mark.parametrize("lens", [DUET, COOKE], ids=["stop first", "stop inside"])
def test_a_copy_without_errors_lands_like_the_nominal_lens(lens: Lens) -> None:
    view = view_of(lens, [0.0, 0.2, 0.3], [0.0, 45.0, 270.0])
    landing = land(lens, no_deviations(lens), view, "spot")
    spots = trace_spots(with_fixed_stop(lens), view.slopes, view.wavelengths_um, view.samples)
    torch.testing.assert_close(landing.rays.x[0], spots.x_mm, rtol=0, atol=1e-12)
    torch.testing.assert_close(landing.rays.y[0], spots.y_mm, rtol=0, atol=1e-12)
    torch.testing.assert_close(landing.chief_y_mm[0], spots.chief_y_mm, rtol=0, atol=1e-12)
    assert float(landing.refocus_mm) == 0


def test_a_field_beside_is_traced_as_if_launched_beside() -> None:
    """The field at +x by turned errors against rays launched towards +x through the errors."""
    drawn = draw_deviations(DUET, Tolerances(), range(2), 5)
    view = view_of(DUET, [0.3], [90.0])
    landing = land(DUET, drawn, view, "none")
    tensors = fabricated_tensors(DUET, drawn, view.wavelengths_um)
    ahead = torch.zeros(1, dtype=torch.float64)
    stands = poses(drawn, glass_elements(DUET), tensors.thickness_mm[:, :, 0, 0, 0], ahead)
    radius = with_fixed_stop(DUET).aperture_value
    slope = torch.full((2, 1, 3, 1), 0.3, dtype=torch.float64)
    towards_y = launch(view.samples.x * radius, view.samples.y * radius, slope, math.inf)
    # turned by 90 degrees: +y becomes +x
    rays = replace(towards_y, x=towards_y.y, y=-towards_y.x, l=towards_y.m, m=-towards_y.l)
    beside = trace_misaligned(tensors, stands, rays)
    torch.testing.assert_close(landing.rays.y, beside.x, rtol=0, atol=1e-12)
    torch.testing.assert_close(landing.rays.x, -beside.y, rtol=0, atol=1e-12)


def test_rays_of_a_misaligned_copy_fill_the_real_stop() -> None:
    """Let the stop's rim be where the aim says: one part in a million less cuts the edge rays."""
    edge = PupilSamples(
        x=torch.tensor([1.0, 0.0, -1.0, 0.0], dtype=torch.float64),
        y=torch.tensor([0.0, 1.0, 0.0, -1.0], dtype=torch.float64),
    )
    view = replace(view_of(COOKE, [0.2], [0.0]), samples=edge)
    drawn = draw_deviations(COOKE, Tolerances(), range(3), 2)
    stop_mm = with_fixed_stop(COOKE).aperture_value
    for scale, arrive in ((1 + 1e-6, True), (1 - 1e-6, False)):
        surfaces = list(COOKE.surfaces)
        surfaces[COOKE.stop] = replace(surfaces[COOKE.stop], semi_diameter_mm=stop_mm * scale)
        cut = replace(
            COOKE,
            surfaces=tuple(surfaces),
            aperture_kind="stop_semi_diameter_mm",
            aperture_value=stop_mm,
        )
        if arrive:
            assert bool((land(cut, drawn, view, "none").weight > 0).all())
        else:
            with pytest.raises(ContractError, match="light of a Monte-Carlo sample is lost"):
                land(cut, drawn, view, "none")


@pytest.mark.parametrize("distance_mm", [math.inf, 800.0])
def test_paraxial_refocus_is_the_move_of_the_paraxial_image(distance_mm: float) -> None:
    lens = with_fixed_stop(replace(COOKE, object_distance_mm=distance_mm))
    drawn = draw_deviations(lens, Tolerances(), range(1), 4)
    built = replace(
        lens,
        surfaces=tuple(
            replace(
                s,
                curvature_per_mm=s.curvature_per_mm / (1 + drawn.radius[0, i]),
                thickness_mm=s.thickness_mm + drawn.thickness_mm[0, i],
                index_offset=drawn.index[0, i],
            )
            for i, s in enumerate(lens.surfaces)
        ),
    )
    moved = paraxial_image(built).distance_mm - paraxial_image(lens).distance_mm
    found = land(lens, drawn, view_of(lens, [0.0], [0.0]), "paraxial").refocus_mm
    assert abs(moved) > 0.01
    assert float(found) == pytest.approx(moved, rel=1e-9)


@pytest.mark.parametrize("compensator", ["paraxial", "spot", "none"])
def test_focus_error_is_left_by_the_compensator(compensator) -> None:
    view = view_of(DUET, [0.0, 0.3], [0.0, 0.0])
    drawn = replace(no_deviations(DUET), focus_mm=np.array([0.1]))
    landing = land(DUET, drawn, view, compensator)
    assert float(landing.refocus_mm) == pytest.approx(0, abs=1e-12)
    still = land(DUET, no_deviations(DUET), view, compensator)
    rays = still.rays
    torch.testing.assert_close(landing.rays.y, rays.y + 0.1 * rays.m / rays.n, rtol=0, atol=1e-12)


def test_spot_refocus_undoes_a_longer_last_gap_of_glass_errors() -> None:
    """A lens focused on its least spot is on its least spot again after the compensator."""
    view = view_of(DUET, [0.0, 0.2], [0.0, 90.0])
    drawn = draw_deviations(DUET, Tolerances().only("index"), range(1), 1)
    landing = land(DUET, drawn, view, "spot")

    def square(shift_mm: float, found) -> float:
        rays, way = found.rays, shift_mm / found.rays.n
        moved = replace(rays, x=rays.x + way * rays.l, y=rays.y + way * rays.m)
        return float((spot_rms_mm(replace(found, rays=moved)) ** 2).sum())

    def least(found) -> float:
        low, middle, high = (square(s, found) for s in (-1.0, 0.0, 1.0))
        return (low - high) / (2 * (low - 2 * middle + high))

    nominal = land(DUET, no_deviations(DUET), view, "spot")
    assert abs(float(landing.refocus_mm)) > 0.01
    assert least(landing) == pytest.approx(least(nominal), abs=1e-9)


def test_abbe_error_changes_dispersion_and_keeps_the_index_at_the_d_line() -> None:
    lines = torch.tensor([D_LINE_UM, F_LINE_UM, C_LINE_UM], dtype=torch.float64)
    drawn = with_error(DUET, abbe=[0, 0.02, 0, 0, 0])
    before = fabricated_tensors(DUET, no_deviations(DUET), lines).index[2].flatten()
    after = fabricated_tensors(DUET, drawn, lines).index[2].flatten()
    assert float(after[0]) == pytest.approx(float(before[0]), abs=1e-15)
    abbe = [(float(n[0]) - 1) / float(n[1] - n[2]) for n in (before, after)]
    assert abbe[1] == pytest.approx(1.02 * abbe[0], rel=1e-12)


def _grooved_parabola(bend_per_mm: float, depth_um: float) -> Lens:
    """Give a stop, a plane into glass, and a relief of -a r^2 out of it."""
    return Lens(
        name="relief",
        surfaces=(
            Surface(curvature_per_mm=0.0, thickness_mm=1.0),
            Surface(curvature_per_mm=0.0, thickness_mm=3.0, glass=GLASS),
            Surface(
                curvature_per_mm=0.0,
                thickness_mm=80.0,
                even_asphere=(-bend_per_mm,),
                semi_diameter_mm=9.0,
                grooves=Grooves(depth_um=depth_um),
            ),
        ),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=8.0,
    )


def test_deeper_grooves_bend_light_by_what_their_slopes_have_grown() -> None:
    """A ray along the axis meets z = s (h - k d) under atan(s h'), and Snell does the rest."""
    lens, depth_mm, bend = _grooved_parabola(0.01, 100.0), 0.1, 0.01
    view = view_of(lens, [0.0], [0.0], 40)
    errors = np.array([0.02, -0.03, 0.0])
    drawn = draw_deviations(lens, Tolerances(), range(3), 1)
    none = {f.name: np.zeros_like(getattr(drawn, f.name)) for f in fields(drawn)}
    none["groove_depth"] = errors[:, None] * np.array([0.0, 0.0, 1.0])
    landing = land(lens, Deviations(**none), view, "none")
    radius = 8.0 * np.hypot(view.samples.x.numpy(), view.samples.y.numpy())
    height = -bend * radius**2
    scale = 1 + errors[:, None]
    z_mm = scale * (height - depth_mm * np.trunc(height / depth_mm))
    lean = np.arctan(2 * bend * radius * scale)
    turned = np.arcsin(index_at(0.55) * np.sin(lean)) - lean
    wanted = radius - (80.0 - z_mm) * np.tan(turned)
    outward = np.hypot(landing.rays.x.numpy(), landing.rays.y.numpy())[:, 0, 0]
    assert bool((landing.weight > 0).all())
    np.testing.assert_allclose(outward, np.abs(wanted), rtol=0, atol=1e-9)
    # to first order the shift is that of the phase: proportional to the error
    shift = wanted[:2] - wanted[2]
    np.testing.assert_allclose(shift[0] / 0.02, shift[1] / -0.03, rtol=0.05)


def test_deeper_grooves_are_refocused_by_their_power() -> None:
    lens = _grooved_parabola(0.01, 100.0)
    focus_mm = 1 / (0.02 * (index_at(0.55) - 1))
    found = land(
        lens,
        with_error(lens, groove_depth=[0.0, 0.0, 0.01]),
        view_of(lens, [0.0], [0.0]),
        "paraxial",
    )
    assert float(found.refocus_mm) == pytest.approx(focus_mm / 1.01 - focus_mm, rel=1e-9)


def test_a_deeper_profile_is_the_same_at_every_radius_but_so_many_times_higher() -> None:
    lens = perfect_lens(40.0, 6.0, grooves=Grooves(depth_um=110.0))
    one = torch.tensor([0.55], dtype=torch.float64)
    plain, deep = (
        fabricated_tensors(lens, with_error(lens, groove_depth=[0.0, 0.0, error]), one)
        for error in (0.0, 0.1)
    )
    square = torch.linspace(0, 36, 50, dtype=torch.float64)

    def height(tensors: SurfaceTensors) -> torch.Tensor:
        c, k = (v[2].flatten() for v in (tensors.curvature_per_mm, tensors.conic))
        return sag(c, k, torch.zeros(0, dtype=torch.float64), square)

    torch.testing.assert_close(height(deep), 1.1 * height(plain), rtol=1e-12, atol=0)
    assert deep.grooves[2].depth_mm == pytest.approx(0.121)  # type: ignore[union-attr]
    assert deep.grooves[:2] == plain.grooves[:2] == (None, None)
    assert bool(torch.equal(plain.conic, fabricated_tensors(lens, no_deviations(lens), one).conic))


def test_grooves_of_different_depths_are_no_one_set_of_tensors() -> None:
    lens = _grooved_parabola(0.01, 100.0)
    wide = replace(Tolerances(), groove_depth=ErrorWidth(half_width=0.01))
    drawn = draw_deviations(lens, wide, range(2), 1)
    with pytest.raises(ContractError, match="traced one by one"):
        fabricated_tensors(lens, drawn, torch.tensor([0.55], dtype=torch.float64))


def test_a_decentred_lens_carries_its_image_along() -> None:
    singlet = Lens(
        name="singlet",
        surfaces=(
            Surface(curvature_per_mm=1 / 50, thickness_mm=4.0, glass="N-BK7"),
            Surface(curvature_per_mm=-1 / 50, thickness_mm=47.0),
        ),
        stop=0,
        aperture_kind="f_number",
        aperture_value=8.0,
        field_angles_rad=(0.0,),
    )
    singlet = replace(singlet, wavelengths_um=(0.55,))
    moved = with_error(singlet, element_decentre_mm=[[0.05, -0.03]])
    view = view_of(singlet, [0.1], [0.0])
    found = land(singlet, moved, view, "paraxial")
    still = land(singlet, no_deviations(singlet), view, "paraxial")
    assert float(found.chief_x_mm - still.chief_x_mm) == pytest.approx(0.05, abs=1e-9)
    assert float(found.chief_y_mm - still.chief_y_mm) == pytest.approx(-0.03, abs=1e-9)
    torch.testing.assert_close(spot_rms_mm(found), spot_rms_mm(still), rtol=1e-6, atol=0)


def test_nominal_kernels_are_those_of_the_mirrored_tracer() -> None:
    heights = torch.tensor([0.0, 10.0], dtype=torch.float64)
    waves = torch.tensor(DUET.wavelengths_um, dtype=torch.float64)
    slopes = slopes_for_heights(DUET, heights).tolist()
    landing = land(DUET, no_deviations(DUET), view_of(DUET, slopes, [0.0, 180.0], 512), "paraxial")
    kernels, kept = copy_kernels(landing, torch.eye(3, dtype=torch.float64), 65, 6.0)
    traced = trace_psf(DUET, heights, waves, 65, 6.0, rays=256)
    torch.testing.assert_close(kernels[0], traced.kernels, rtol=0, atol=1e-9)
    torch.testing.assert_close(kept[0], traced.energy_kept.amin(1), rtol=1e-9, atol=0)


def test_spot_radius_of_one_wavelength_is_that_of_the_spot_module() -> None:
    mono = replace(DUET, wavelengths_um=(0.54,))
    view = view_of(mono, [0.0, 0.3], [0.0, 0.0])
    found = spot_rms_mm(land(mono, no_deviations(mono), view, "none"))
    spots = trace_spots(with_fixed_stop(mono), view.slopes, view.wavelengths_um, view.samples)
    torch.testing.assert_close(found[0], rms_radius(spots)[:, 0], rtol=1e-9, atol=0)


def test_window_is_the_least_that_keeps_the_light() -> None:
    kernels = torch.zeros(2, 3, 9, 9)
    kernels[..., 4, 4] = 0.9
    kernels[..., 2, 4] = 0.08
    kernels[..., 0, 0] = 0.02
    assert window_px(kernels, 0.15) == 1
    assert window_px(kernels, 0.05) == 5
    assert window_px(kernels, 0.001) == 9


def test_even_kernels_and_absurd_errors_are_refused() -> None:
    landing = land(DUET, no_deviations(DUET), view_of(DUET, [0.0], [0.0]), "none")
    with pytest.raises(ContractError, match="odd"):
        copy_kernels(landing, torch.eye(3, dtype=torch.float64), 8, 6.0)
    tight = replace(DUET, surfaces=tuple(replace(s, semi_diameter_mm=6.3) for s in DUET.surfaces))
    huge = Tolerances(element_decentre=ErrorWidth(half_width=50.0)).only("element_decentre")
    drawn = draw_deviations(tight, huge, range(4), 1, at_limits=True)
    with pytest.raises(ContractError, match="light of a Monte-Carlo sample is lost"):
        land(tight, drawn, view_of(tight, [0.0], [0.0]), "none")


def test_paraxial_data_are_untouched_by_misalignment() -> None:
    drawn = draw_deviations(COOKE, Tolerances().only("element_tilt"), range(3), 1)
    found = land(COOKE, drawn, view_of(COOKE, [0.0], [0.0]), "paraxial")
    assert paraxial_data(COOKE).efl_mm > 0
    torch.testing.assert_close(found.refocus_mm, torch.zeros(3, dtype=torch.float64))


def test_copy_without_errors_of_a_lens_of_every_shape_lands_like_it() -> None:
    """Odd and Q terms, a radial phase; with errors of radius the phase stays."""
    front, *rest = COOKE.surfaces
    second, third, *rest = rest
    surfaces = (
        replace(front, odd_asphere=(0.0, 1e-6), even_asphere=(0.0, 1e-7)),
        replace(second, q_con=(1e-3, -2e-4), normal_radius_mm=9.0),
        replace(third, phase=Phase(radius_mm=8.0, radial_rad=(-40.0, 3.0))),
        *rest,
    )
    lens = replace(COOKE, surfaces=surfaces)
    view = view_of(lens, [0.0, 0.2], [0.0, 45.0])
    landing = land(lens, no_deviations(lens), view, "none")
    spots = trace_spots(with_fixed_stop(lens), view.slopes, view.wavelengths_um, view.samples)
    torch.testing.assert_close(landing.rays.x[0], spots.x_mm, rtol=0, atol=1e-10)
    torch.testing.assert_close(landing.rays.y[0], spots.y_mm, rtol=0, atol=1e-10)
    drawn = draw_deviations(lens, Tolerances(), range(1), 5)
    tensors = fabricated_tensors(lens, drawn, view.wavelengths_um)
    nominal = surface_tensors(lens, view.wavelengths_um)
    assert tensors.phase is not None
    assert nominal.phase is not None
    assert torch.equal(tensors.phase.flatten(), nominal.phase.flatten())


def test_tolerances_of_an_uneven_lens_are_refused_by_name() -> None:
    front = replace(COOKE.surfaces[0], stance=Stance(decentre_mm=(0.1, 0.0)))
    lens = replace(COOKE, surfaces=(front, *COOKE.surfaces[1:]))
    with pytest.raises(UnsupportedError, match="surface 0 is tilted or decentred"):
        land(lens, no_deviations(lens), view_of(lens, [0.0], [0.0]), "none")
