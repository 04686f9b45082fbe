"""Elements that stand tilted or decentred by design: closed forms, gradients, files."""

import math
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.lens_file.zmx_writer import format_zmx
from camkit.models_def.optics.prescription import (
    Lens,
    Surface,
    format_prescription,
    parse_prescription,
)
from camkit.models_def.optics.reverse import launch_with_slopes, trace_to_scene
from camkit.models_def.optics.scaling import scale_lens
from camkit.models_def.optics.shape.stance import Stance
from camkit.models_def.optics.trace import Rays, SurfaceTensors, refract, surface_tensors, trace

INDEX = 1.5
WAVE = torch.tensor(0.55, dtype=torch.float64)


def _lens(*surfaces: Surface) -> Lens:
    stop = Surface(curvature_per_mm=0.0, thickness_mm=5.0)
    return Lens(
        name="x",
        surfaces=(stop, *surfaces),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=4.0,
    )


def _plate(stance: Stance) -> Lens:
    return _lens(
        Surface(curvature_per_mm=0.0, thickness_mm=3.0, glass="N-BK7", stance=stance),
        Surface(curvature_per_mm=0.0, thickness_mm=10.0),
    )


def _singlet(stance: Stance | None) -> Lens:
    return _lens(
        Surface(curvature_per_mm=0.03, thickness_mm=4.0, glass="N-BK7", stance=stance),
        Surface(curvature_per_mm=-0.01, thickness_mm=40.0),
    )


def _tensors(lens: Lens) -> SurfaceTensors:
    tensors = surface_tensors(lens, WAVE)
    index = torch.where(tensors.index > 1.1, INDEX, 1.0).to(torch.float64)
    return replace(tensors, index=index)


def _rays(x: list[float], y: list[float], l: float = 0.0, m: float = 0.0) -> Rays:  # noqa: E741
    tx, ty = (torch.tensor(v, dtype=torch.float64) for v in (x, y))
    one = torch.ones_like(tx)
    n = math.sqrt(1 - l * l - m * m)
    fate = torch.zeros(tx.shape, dtype=torch.int8)
    return Rays(x=tx, y=ty, z=0 * one, l=l * one, m=m * one, n=n * one, fate=fate)


def test_tilted_plate_shifts_rays_and_lengthens_their_path() -> None:
    """Displacement t sin a (1 - cos a / sqrt(n^2 - sin^2 a)), the direction unchanged.

    The path is the one in air plus t (sqrt(n^2 - sin^2 a) - cos a).
    """
    a, t = 0.3, 3.0
    plate = _tensors(_plate(Stance(tilt_rad=(a, 0.0))))
    end = trace(plate, _rays([0.0, 1.0], [0.0, -0.5]), path=True)
    inside = math.sqrt(INDEX**2 - math.sin(a) ** 2)
    shift = t * math.sin(a) * (1 - math.cos(a) / inside)
    # turning y towards z moves the back of the plate towards -y, and rays with the normal
    assert (end.y - torch.tensor([0.0, -0.5])).tolist() == pytest.approx([-shift] * 2, rel=1e-12)
    assert end.x.tolist() == pytest.approx([0.0, 1.0], abs=1e-13)
    assert end.m.tolist() == pytest.approx([0.0, 0.0], abs=1e-14)
    assert end.path_mm is not None
    assert end.path_mm.tolist() == pytest.approx([18.0 + t * (inside - math.cos(a))] * 2, rel=1e-13)


def test_decentred_singlet_is_the_centred_one_seen_from_beside() -> None:
    shift = (0.4, -0.7)
    tensors = _tensors(_singlet(Stance(decentre_mm=shift)))
    moved = trace(tensors, _rays([1.0, 0.4], [0.2, -0.7], 0.05))
    plain = trace(_tensors(_singlet(None)), _rays([0.6, 0.0], [0.9, 0.0], 0.05))
    assert (moved.x - shift[0]).tolist() == pytest.approx(plain.x.tolist(), abs=1e-10)
    assert (moved.y - shift[1]).tolist() == pytest.approx(plain.y.tolist(), abs=1e-10)


def test_sphere_tilted_about_its_centre_of_curvature_stays() -> None:
    """A tilt about the vertex and the shift that brings the centre back change no ray."""
    radius, a = 1 / 0.03, 0.05
    half = _lens(
        Surface(
            curvature_per_mm=0.03,
            thickness_mm=40.0,
            glass="N-BK7",
            # the centre (0, 0, r) turns to (0, -r sin a, r cos a)
            stance=Stance(tilt_rad=(a, 0.0), decentre_mm=(0.0, radius * math.sin(a))),
        )
    )
    centred = replace(half.surfaces[1], stance=None)
    tilted = _tensors(half)
    plain = _tensors(replace(half, surfaces=(half.surfaces[0], centred)))
    # the vertex of the turned sphere lies r (1 - cos a) further along the axis than it did
    place = [0.0, radius * math.sin(a), radius * (1 - math.cos(a))]
    offset = torch.tensor(place, dtype=torch.float64)
    pose = tilted.poses[1]
    assert pose is not None
    tilted = replace(tilted, poses=(None, pose._replace(offset_mm=offset)))
    rays = _rays([0.5, -1.0], [1.0, 2.0], 0.02, 0.1)
    one, other = trace(tilted, rays), trace(plain, rays)
    for name in ("x", "y", "l", "m"):
        assert getattr(one, name).tolist() == pytest.approx(
            getattr(other, name).tolist(), abs=1e-12
        )


def test_light_goes_back_the_way_it_came() -> None:
    stance = Stance(decentre_mm=(0.3, 0.1), tilt_rad=(0.05, -0.08))
    lens = replace(_singlet(stance), object_distance_mm=300.0)
    tensors, rays = _tensors(lens), _rays([0.5, -1.0], [1.0, 2.0], 0.02, 0.1)
    end = trace(tensors, rays)
    back = trace_to_scene(
        tensors, launch_with_slopes(end.x, end.y, -end.l / end.n, -end.m / end.n), 300.0
    )
    assert back.x.tolist() == pytest.approx((rays.x - rays.l / rays.n * 300).tolist(), rel=1e-9)
    assert back.y.tolist() == pytest.approx((rays.y - rays.m / rays.n * 300).tolist(), rel=1e-9)


def test_gradient_passes_a_tilted_element() -> None:
    tensors = _tensors(_singlet(Stance(decentre_mm=(0.3, 0.1), tilt_rad=(0.05, -0.08))))
    rays, step = _rays([0.5, -1.0], [1.0, 2.0], 0.02, 0.1), 1e-6
    curvature = tensors.curvature_per_mm.clone().requires_grad_()
    total = trace(replace(tensors, curvature_per_mm=curvature), rays).y.square().sum()
    (slopes,) = torch.autograd.grad(total, curvature)
    for i in (1, 2):
        values = []
        for sign in (1, -1):
            moved = tensors.curvature_per_mm.clone()
            moved[i] += sign * step
            end = trace(replace(tensors, curvature_per_mm=moved), rays)
            values.append(float(end.y.square().sum()))
        assert float(slopes[i]) == pytest.approx((values[0] - values[1]) / (2 * step), rel=1e-6)


def test_rays_on_a_tilted_surface_lie_on_it() -> None:
    a = 0.2
    on = refract(_tensors(_plate(Stance(tilt_rad=(a, 0.0)))), _rays([0.0], [1.0]), 1)
    # y' turns towards z: the plate is z = y tan a
    assert float(on.z) == pytest.approx(math.tan(a) * 1.0)


def test_stance_comes_back_from_toml_and_grows_with_the_lens() -> None:
    lens = _plate(Stance(decentre_mm=(0.1, -0.2), tilt_rad=(math.radians(1.5), 0.0)))
    text = format_prescription(lens)
    assert "element_decentre_mm = [0.1, -0.2]\nelement_tilt_deg = [1.5, 0.0]" in text
    assert parse_prescription(text) == lens
    large = scale_lens(lens, 2.0).surfaces[1].stance
    assert large == Stance(decentre_mm=(0.2, -0.4), tilt_rad=(math.radians(1.5), 0.0))


def test_zmx_does_not_take_a_tilted_element() -> None:
    with pytest.raises(UnsupportedError, match="surface 1 begins an element that is tilted"):
        format_zmx(_plate(Stance(tilt_rad=(0.1, 0.0))))


def test_stances_that_have_no_meaning_are_refused() -> None:
    tilt = Stance(tilt_rad=(0.1, 0.0))
    with pytest.raises(ContractError, match="surface 1 begins no piece of glass"):
        _lens(Surface(curvature_per_mm=0.0, thickness_mm=1.0, stance=tilt))
    with pytest.raises(ContractError, match="the stop, surface 2, lies on glass"):
        replace(_plate(tilt), stop=2)
    with pytest.raises(ContractError, match=r"at most 28\.6 degrees"):
        Stance(tilt_rad=(0.6, 0.0))
    with pytest.raises(ContractError, match="finite"):
        Stance(decentre_mm=(math.nan, 0.0))
    text = format_prescription(_plate(tilt)).replace("[0.0, 0.0]", "[0.0]")
    with pytest.raises(ContractError, match="lists of two numbers"):
        parse_prescription(text)
