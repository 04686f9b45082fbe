"""Chief rays from the axis outwards, against closed forms and optiland 0.6.3."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import (
    field_slopes,
    paraxial_pupil_misses,
    rms_about_centroid,
    spot_diagram,
)
from camkit.models_def.optics.lens_file.lens_file import find_lens, read_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.scaling import scale_lens
from camkit.models_def.optics.spot import chief_heights, slopes_for_heights
from camkit.models_def.optics.trace import surface_tensors
from tests.data_folder import data_path

PLATE_MM, AIR_MM = 40.0, 10.0
REFERENCES = [
    ("lens_zmx/o-ReverseTelephoto.zmx", 30, 1.131569, 0.8122),
    ("lens_zmx/o-WideAngle100FOV.zmx", 35, 0.384025, 0.1260),
    ("lens_zmx/o-WideAngle100FOV.zmx", 50, 0.525419, 0.1376),
    ("lens_zmx/o-ProjectionLens120FOV.zmx", 60, 1.047898, 0.1342),
]


def window(distance_mm: float = math.inf) -> Lens:
    """Return a thick glass plate, a stop behind it and a singlet."""
    return Lens(
        name="window",
        surfaces=(
            Surface(curvature_per_mm=0.0, thickness_mm=PLATE_MM, glass="PMMA-Sultanova2009"),
            Surface(curvature_per_mm=0.0, thickness_mm=AIR_MM),
            Surface(curvature_per_mm=0.0, thickness_mm=1.0),
            Surface(curvature_per_mm=0.0, thickness_mm=3.0, glass="PMMA-Sultanova2009"),
            Surface(curvature_per_mm=-1 / 12.0, thickness_mm=24.0),
        ),
        stop=2,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=1.0,
        object_distance_mm=distance_mm,
        field_angles_rad=(0.0, math.radians(50.0)),
    )


def _index(lens: Lens) -> float:
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    return float(surface_tensors(lens, wave).index[1])


def test_the_pupil_behind_a_plate_moves_as_refraction_says() -> None:
    """lead tan(angle) = plate tan(angle in it) + air tan(angle)."""
    lens = window()
    path = chief_path(lens)
    inside = np.arcsin(np.sin(path.angles_rad[1:]) / _index(lens))
    expected = PLATE_MM * np.tan(inside) / np.tan(path.angles_rad[1:]) + AIR_MM
    assert path.angles_rad[-1] > math.radians(45.0)
    np.testing.assert_allclose(path.lead_mm[1:], expected, atol=1e-6)
    assert path.lead_mm[0] == pytest.approx(PLATE_MM / _index(lens) + AIR_MM, abs=1e-9)


def test_a_wrong_paraxial_pupil_is_measured_at_the_stop() -> None:
    """A ray to the paraxial pupil misses by the depths' difference times the slope, radius 1."""
    lens, angle = window(), math.radians(50.0)
    inside = math.asin(math.sin(angle) / _index(lens))
    real_mm = PLATE_MM * math.tan(inside) + AIR_MM * math.tan(angle)
    paraxial_mm = (PLATE_MM / _index(lens) + AIR_MM) * math.tan(angle)
    misses = paraxial_pupil_misses(lens, field_slopes(lens))
    assert misses.tolist() == pytest.approx([0.0, abs(paraxial_mm - real_mm)], abs=1e-6)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", ["double-gauss", "duet", "cooke-triplet-f5"])
def test_a_lens_of_any_size_is_aimed_alike(name: str, factor: float) -> None:
    lens = find_lens(name)
    heights_mm = torch.tensor([0.0, 4.0, 9.0, 18.0], dtype=torch.float64)
    slopes = slopes_for_heights(lens, heights_mm)
    scaled = slopes_for_heights(scale_lens(lens, factor), heights_mm * factor)
    torch.testing.assert_close(scaled, slopes, rtol=1e-6, atol=1e-9)


def test_a_near_object_at_the_edge_of_a_telecentric_lens_is_aimed() -> None:
    """The stop stands in the focus of the front lens: chief rays enter parallel to the axis."""
    front = find_lens("cooke-triplet-f5")
    back_mm = paraxial_data(front).bfl_mm
    surfaces = [*front.surfaces[:-1], replace(front.surfaces[-1], thickness_mm=back_mm)]
    stop = Surface(curvature_per_mm=0.0, thickness_mm=50.0)
    lens = Lens(
        name="telecentric",
        surfaces=(*surfaces, stop),
        stop=len(surfaces),
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=1.0,
        object_distance_mm=100.0,
    )
    path = chief_path(lens)
    assert path.lead_mm[0] == pytest.approx(100.0, rel=1e-3)
    assert path.angles_rad[-1] > math.radians(3.0)


def test_what_lies_beyond_the_reach_is_refused_with_both_lengths() -> None:
    lens = window()
    path = chief_path(lens)
    beyond_mm = 2 * float(path.heights_mm.max())
    with pytest.raises(ContractError, match=rf"aimed to {path.reach}.* {beyond_mm:.2f} mm"):
        slopes_for_heights(lens, torch.tensor([beyond_mm], dtype=torch.float64))


@pytest.mark.parametrize(("name", "angle_deg", "height_mm", "rms_um"), REFERENCES)
def test_wide_lenses_land_where_robust_ray_aiming_has_them(
    name: str, angle_deg: float, height_mm: float, rms_um: float
) -> None:
    lens = read_lens(data_path(name))
    slope = torch.tan(torch.deg2rad(torch.tensor([angle_deg], dtype=torch.float64)))
    assert float(chief_heights(lens, slope)[0]) == pytest.approx(height_mm, abs=1e-6)
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    spots = spot_diagram(lens, slope, wave, Pupil(definition="stop"))
    assert float(rms_about_centroid(spots)[0, 0]) * 1e3 == pytest.approx(rms_um, abs=1e-3)


def test_the_corner_of_a_fast_wide_lens_is_reached() -> None:
    lens = read_lens(data_path("reports/zmx_24mm_wide.zmx"))
    slope = torch.tan(torch.deg2rad(torch.tensor([42.34], dtype=torch.float64)))
    assert float(chief_heights(lens, slope)[0]) == pytest.approx(21.63, abs=5e-3)
    back = slopes_for_heights(lens, torch.tensor([21.63], dtype=torch.float64))
    assert math.degrees(math.atan(float(back[0]))) == pytest.approx(42.34, abs=1e-2)


def test_a_lens_in_metres_is_aimed_as_that_in_millimetres() -> None:
    paths = [
        chief_path(read_lens(data_path(f"reports/zmx_in_{unit}.zmx")))
        for unit in ("metres", "millimetres")
    ]
    assert paths[0].angles_rad[-1] == pytest.approx(paths[1].angles_rad[-1], abs=1e-3)
