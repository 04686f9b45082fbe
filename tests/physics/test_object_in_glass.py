"""An object in glass: the aplanatic points of a sphere, where every ray meets one point."""

import math

import pytest
import torch

from camkit.models_def.optics.paraxial import paraxial_image
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import hexapolar
from camkit.models_def.optics.spot import rms_radius, trace_spots
from camkit.models_def.optics.trace import Rays, surface_tensors, trace

INDEX = 1.5
RADIUS_MM = 10.0


def _weierstrass_sphere() -> Lens:
    """Return a ball whose object lies R / n behind its middle: R + R / n before the vertex.

    References: Born, Wolf, Principles of Optics, section 4.2.3: the virtual image lies n R behind
    the middle and is n^2 times as large.
    """
    surface = Surface(
        curvature_per_mm=-1 / RADIUS_MM, thickness_mm=-(RADIUS_MM + INDEX * RADIUS_MM)
    )
    return Lens(
        name="ball",
        surfaces=(surface,),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=7.0,
        object_distance_mm=RADIUS_MM + RADIUS_MM / INDEX,
        object_glass=f"model:{INDEX},0",
    )


def test_the_image_of_the_aplanatic_point_is_where_theory_has_it() -> None:
    image = paraxial_image(_weierstrass_sphere())
    assert image.distance_mm == pytest.approx(-(RADIUS_MM + INDEX * RADIUS_MM), rel=1e-12)
    assert image.magnification == pytest.approx(INDEX**2, rel=1e-12)


def test_every_ray_from_the_aplanatic_point_seems_to_come_from_one_point() -> None:
    lens = _weierstrass_sphere()
    wave = torch.tensor([0.55], dtype=torch.float64)
    axis = torch.zeros(1, dtype=torch.float64)
    spots = trace_spots(lens, axis, wave, hexapolar(6), definition="paraxial")
    assert float(rms_radius(spots).flatten()[0]) < 1e-12
    # in air the same surface has a spot
    in_air = Lens(
        name="plain",
        surfaces=(Surface(curvature_per_mm=0.05, thickness_mm=200.0, glass="N-BK7"),),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=7.0,
        object_distance_mm=100.0,
    )
    blurred = trace_spots(in_air, axis, wave, hexapolar(6), definition="paraxial")
    assert float(rms_radius(blurred).flatten()[0]) > 1e-3


def test_light_in_front_of_the_first_surface_is_bent_by_its_medium() -> None:
    """Snell's law at a plane between water and glass."""
    plane = Surface(curvature_per_mm=0.0, thickness_mm=1.0, glass="model:1.6,0")
    lens = Lens(
        name="window",
        surfaces=(plane,),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=1.0,
        object_glass="model:1.333,0",
    )
    sine = 0.4
    zero = torch.zeros(1, dtype=torch.float64)
    rays = Rays(
        x=zero,
        y=zero,
        z=zero,
        l=zero,
        m=zero + sine,
        n=zero + math.sqrt(1 - sine**2),
        fate=zero.to(torch.int8),
    )
    behind = trace(surface_tensors(lens, torch.tensor(0.55, dtype=torch.float64)), rays)
    assert float(behind.m) == pytest.approx(1.333 * sine / 1.6, rel=1e-12)
