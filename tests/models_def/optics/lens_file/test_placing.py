"""A lens stopped and focused: against the thin lens, and the same plane by three origins."""

import math
from dataclasses import replace

import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.lens_file.placing import Placement, placed_lens, track_mm
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image

LENS = find_lens("double-gauss")


@pytest.mark.parametrize("origin", ["vertex", "sensor", "pupil"])
def test_the_same_plane_is_focused_from_any_origin(origin: str) -> None:
    near = placed_lens(LENS, Placement(focus_mm=1500.0, merit="paraxial")).lens
    away = {
        "vertex": 0.0,
        "sensor": track_mm(near),
        "pupil": paraxial_data(near).entrance_pupil_mm,
    }
    again = placed_lens(
        LENS,
        Placement(focus_mm=1500.0 + away[origin], origin=origin, merit="paraxial"),  # type: ignore[arg-type]
    ).lens
    assert again.object_distance_mm == pytest.approx(1500.0, abs=1e-6)
    assert track_mm(again) == pytest.approx(track_mm(near), abs=1e-6)


def test_a_focused_lens_has_its_paraxial_image_on_the_sensor_and_moves_as_newton_says() -> None:
    far = placed_lens(LENS, Placement(focus_mm=math.inf, merit="paraxial")).lens
    near = placed_lens(LENS, Placement(focus_mm=2000.0, merit="paraxial")).lens
    data = paraxial_data(LENS)
    # x x' = f^2 with x from the front focus
    moved_mm = data.efl_mm**2 / (2000.0 + data.ffl_mm)
    assert track_mm(near) - track_mm(far) == pytest.approx(moved_mm, rel=1e-9)
    assert paraxial_image(near).distance_mm == pytest.approx(near.surfaces[-1].thickness_mm)


def test_objects_are_told_from_the_first_vertex_in_order() -> None:
    placed = placed_lens(
        LENS, Placement(focus_mm=1000.0, objects_mm=(1500.0, 600.0, 1500.0), origin="sensor")
    )
    track = track_mm(placed.lens)
    assert placed.objects_mm == pytest.approx((600.0 - track, 1500.0 - track))
    alone = placed_lens(LENS, Placement(focus_mm=1000.0))
    assert alone.objects_mm == (1000.0,)
    assert placed_lens(LENS, Placement()).lens == LENS


def test_a_stop_is_set_by_number_or_radius() -> None:
    assert paraxial_data(placed_lens(LENS, Placement(f_number=8.0)).lens).f_number == pytest.approx(
        8
    )
    lens = placed_lens(LENS, Placement(stop_radius_mm=1.25)).lens
    assert (lens.aperture_kind, lens.aperture_value) == ("stop_semi_diameter_mm", 1.25)
    assert paraxial_data(lens).stop_semi_diameter_mm == 1.25
    narrow = replace(
        LENS,
        surfaces=tuple(
            replace(s, semi_diameter_mm=1.0) if i == LENS.stop else s
            for i, s in enumerate(LENS.surfaces)
        ),
    )
    opened = placed_lens(narrow, Placement(stop_radius_mm=1.25)).lens
    assert opened.surfaces[LENS.stop].semi_diameter_mm == 1.25


@pytest.mark.parametrize(
    ("placement", "message"),
    [
        ({"f_number": 4.0, "stop_radius_mm": 3.0}, "not both"),
        ({"origin": "mount"}, "one of vertex, sensor, pupil; got 'mount'"),
        ({"focus_mm": -1.0, "objects_mm": (5.0, 0.0)}, "focus_mm -1.0, object_mm 2 0.0"),
    ],
)
def test_a_wrong_placement_is_refused(placement: dict[str, object], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        Placement(**placement)  # type: ignore[arg-type]


def test_what_lies_within_the_lens_is_refused() -> None:
    with pytest.raises(ContractError, match=r"20 mm from the sensor .* lies within the lens"):
        placed_lens(LENS, Placement(objects_mm=(20.0,), origin="sensor"))
    # nearer than four focal lengths no plane and its image are
    with pytest.raises(ContractError, match=r"cannot be focused|lies within"):
        placed_lens(LENS, Placement(focus_mm=150.0, origin="sensor", merit="paraxial"))


def test_a_defocus_moves_the_sensor_behind_its_place_in_focus() -> None:
    sharp = placed_lens(LENS, Placement(focus_mm=1500.0, objects_mm=(900.0,), origin="sensor"))
    blurred = placed_lens(
        LENS, Placement(focus_mm=1500.0, objects_mm=(900.0,), origin="sensor", defocus_mm=0.25)
    )
    assert track_mm(blurred.lens) == pytest.approx(track_mm(sharp.lens) + 0.25, abs=1e-9)
    # the plane is placed from the sensor where it is
    assert blurred.objects_mm[0] == pytest.approx(sharp.objects_mm[0] - 0.25, abs=1e-9)
    with pytest.raises(ContractError, match="defocus_mm must be finite"):
        Placement(defocus_mm=math.nan)
