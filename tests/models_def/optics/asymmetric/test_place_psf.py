"""Kernels of lenses that are not round, against round ones, symmetries and closed forms."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.asymmetric.place_psf import trace_place_psf
from camkit.models_def.optics.asymmetric.places import fields_of_places
from camkit.models_def.optics.asymmetric.turning import round_part, turned_lens
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.prescription import Lens, read_prescription
from camkit.models_def.optics.psf import trace_psf
from camkit.models_def.optics.shape.phase import Phase, parse_monomials
from camkit.models_def.optics.shape.stance import Stance
from camkit.models_def.optics.spot import chief_heights
from camkit.models_def.optics.trace import Rays, surface_tensors, trace

PRESCRIPTIONS = Path(__file__).parents[4] / "models_def" / "prescriptions"
WAVES = torch.tensor([0.5, 0.6], dtype=torch.float64)
CUBIC = Phase(radius_mm=6.0, free_rad=parse_monomials({"x3": 60.0, "y3": 60.0}))
SIDE_PX, PITCH_UM = 65, 4.0


@pytest.fixture(scope="module")
def triplet() -> Lens:
    """A Cooke triplet at F/5, its stop a surface of its own."""
    lens = read_prescription(PRESCRIPTIONS / "cooke-triplet-f5.toml")
    surfaces = list(lens.surfaces)
    flint = surfaces[lens.stop]
    stop = replace(flint, curvature_per_mm=0.0, thickness_mm=1.0, semi_diameter_mm=math.inf)
    surfaces[lens.stop] = replace(flint, thickness_mm=flint.thickness_mm - 1.0)
    surfaces.insert(lens.stop + 1, stop)
    return replace(lens, surfaces=tuple(surfaces), stop=lens.stop + 1)


def _with_phase(lens: Lens, phase: Phase) -> Lens:
    surfaces = list(lens.surfaces)
    surfaces[lens.stop] = replace(surfaces[lens.stop], phase=phase)
    return replace(lens, surfaces=tuple(surfaces))


def _kernels(lens: Lens, *places: tuple[float, float]) -> torch.Tensor:
    return trace_place_psf(lens, places, WAVES, SIDE_PX, PITCH_UM, rays=256).kernels


def test_kernels_of_a_round_lens_are_those_from_half_its_pupil(triplet: Lens) -> None:
    heights = torch.tensor([0.0, 5.0], dtype=torch.float64)
    wanted = trace_psf(triplet, heights, WAVES, SIDE_PX, PITCH_UM, rays=256)
    found = trace_place_psf(triplet, [(0.0, 0.0), (0.0, 5.0)], WAVES, SIDE_PX, PITCH_UM, rays=256)
    # both find the field to 1e-9 mm
    assert float((found.kernels - wanted.kernels).abs().max()) < 1e-7
    assert float((found.energy_kept - wanted.energy_kept).abs().max()) < 1e-12


def test_cubic_plate_lights_one_quadrant(triplet: Lens) -> None:
    """A cubic phase bends every ray towards +x and +y; the picture without it is a point."""
    lens = _with_phase(triplet, replace(CUBIC, order=30.0))
    (kernel,) = _kernels(lens, (0.0, 0.0))[:, 0]
    middle = SIDE_PX // 2
    assert float(kernel[middle - 4 :, middle - 4 :].sum()) > 0.999
    assert float(kernel[: middle - 4].sum()) < 0.01
    assert float(kernel[middle + 4 :, middle + 4 :].sum()) > 0.3


def test_kernels_swap_axes_as_the_cubic_plate_does(triplet: Lens) -> None:
    """x^3 + y^3 stays where x and y are swapped, so the kernel at (a, b) is that at (b, a)."""
    lens = _with_phase(triplet, replace(CUBIC, order=10.0))
    one, other = _kernels(lens, (4.0, 1.5), (1.5, 4.0))
    assert float((one - other.transpose(-1, -2)).abs().sum((-2, -1)).max()) < 0.1


def test_lens_turned_is_seen_turned(triplet: Lens) -> None:
    lens = _with_phase(triplet, CUBIC)
    tensors = surface_tensors(lens, WAVES)
    turned = surface_tensors(turned_lens(lens, math.pi / 2), WAVES)
    # a direction at +x is turned to +y: x = y', y = -x', so x^3 + y^3 = y'^3 - x'^3
    assert tensors.phases[lens.stop] is not None
    form = turned.phases[lens.stop]
    assert form is not None
    assert turned.phase is not None
    terms = dict(zip(form.powers, turned.phase[lens.stop].tolist(), strict=True))
    assert terms.pop((0, 3)) == pytest.approx(60.0)
    assert terms.pop((3, 0)) == pytest.approx(-60.0)
    assert max(map(abs, terms.values())) < 1e-12


def test_chief_ray_of_a_place_lands_there(triplet: Lens) -> None:
    """Of a lens whose front element is decentred and tilted: its image is elsewhere."""
    front = replace(
        triplet.surfaces[0], stance=Stance(decentre_mm=(0.1, -0.2), tilt_rad=(0.01, 0.005))
    )
    lens = replace(triplet, surfaces=(front, *triplet.surfaces[1:]))
    (field,) = fields_of_places(lens, ((3.0, -2.0),))
    (straight,) = fields_of_places(triplet, ((3.0, -2.0),))
    assert straight.azimuth_rad == pytest.approx(math.atan2(3.0, -2.0))
    assert chief_heights(triplet, torch.tensor([straight.slope], dtype=torch.float64)).tolist() == (
        pytest.approx([math.hypot(3.0, 2.0)], abs=1e-6)
    )
    assert abs(field.slope - straight.slope) > 1e-4
    kernels = _kernels(lens, (3.0, -2.0), (0.0, 0.0))
    # a decentred element makes coma on the axis: no symmetry about either line
    on_axis = kernels[1, 0]
    assert float((on_axis - on_axis.flip(0)).abs().sum()) > 0.1
    assert float((on_axis - on_axis.flip(1)).abs().sum()) > 0.1


def test_decentred_lens_as_a_whole_images_as_it_did(triplet: Lens) -> None:
    """Every element shifted alike, seen from its own axis: the same kernel, shifted."""
    shift = (0.3, -0.2)
    media = ["air", *(s.glass for s in triplet.surfaces)]
    surfaces = tuple(
        replace(s, stance=Stance(decentre_mm=shift))
        if s.glass != "air" and media[i] == "air"
        else s
        for i, s in enumerate(triplet.surfaces)
    )
    lens = replace(triplet, surfaces=surfaces)
    tensors, plain = (surface_tensors(v, WAVES) for v in (lens, triplet))
    x = torch.linspace(-3, 3, 7, dtype=torch.float64)[:, None]
    zero, one = torch.zeros_like(x), torch.ones_like(x)
    fate = torch.zeros(x.shape, dtype=torch.int8)
    rays = Rays(x=x, y=x / 2, z=zero, l=0.1 * one, m=zero, n=math.sqrt(0.99) * one, fate=fate)
    moved = replace(rays, x=rays.x + shift[0], y=rays.y + shift[1])
    end, wanted = trace(tensors, moved, path=True), trace(plain, rays, path=True)
    assert float((end.x - shift[0] - wanted.x).abs().max()) < 1e-12
    assert float((end.y - shift[1] - wanted.y).abs().max()) < 1e-12
    assert end.path_mm is not None
    assert wanted.path_mm is not None
    assert float((end.path_mm - wanted.path_mm).abs().max()) < 1e-12


def test_optics_of_an_uneven_lens_lie_on_a_grid(triplet: Lens) -> None:
    lens = _with_phase(triplet, CUBIC)
    optics = LensOptics(lens=lens, rays=64)
    layout = optics.layout(6.0, 25)
    assert layout.symmetry == "grid"
    assert layout.count == 35
    assert float(np.hypot(layout.x_mm, layout.y_mm).max()) == pytest.approx(6.0, rel=2e-3)
    light = optics.illumination(layout)
    assert light.shape == (35,)
    assert light[17] == pytest.approx(1.0)
    traced = optics.kernels(
        layout, WAVES.numpy(), depth_mm=math.inf, side_px=SIDE_PX, pitch_um=PITCH_UM
    )
    assert traced.kernels.shape == (35, 2, SIDE_PX, SIDE_PX)
    assert round_part(lens) == triplet


def test_ways_that_need_a_round_lens_refuse_others_by_name(triplet: Lens) -> None:
    lens = _with_phase(triplet, CUBIC)
    zero = torch.zeros(1, dtype=torch.float64)
    with pytest.raises(UnsupportedError, match=f"surface {lens.stop} has a free phase"):
        trace_psf(lens, zero, WAVES, SIDE_PX, PITCH_UM)


def test_even_sides_and_far_places_are_refused(triplet: Lens) -> None:
    with pytest.raises(ContractError, match="odd"):
        trace_place_psf(triplet, [(0.0, 0.0)], WAVES, 4, PITCH_UM)
    with pytest.raises(ContractError):
        fields_of_places(_with_phase(triplet, CUBIC), ((500.0, 0.0),))
