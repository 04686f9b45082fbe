from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.grooves import Grooves
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.tolerance.deviation import (
    draw_deviations,
    no_deviations,
    single_deviations,
)
from camkit.models_def.optics.tolerance.elements import glass_elements
from camkit.models_def.optics.tolerance.errors import ErrorWidth, Tolerances
from tests.thin_factory import perfect_lens

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
DUET = read_lens(PRESCRIPTIONS / "duet.toml")


def test_cemented_surfaces_are_one_piece_and_a_stop_is_none() -> None:
    assert glass_elements(DUET) == (range(1, 3), range(3, 5))
    gauss = read_lens(PRESCRIPTIONS / "double-gauss.toml")
    assert [len(piece) for piece in glass_elements(gauss)] == [2, 3, 3, 2]


def test_a_copy_follows_from_seed_and_number_alone() -> None:
    many = draw_deviations(DUET, Tolerances(), range(5), 3)
    one = draw_deviations(DUET, Tolerances(), range(3, 4), 3)
    for field in fields(many):
        np.testing.assert_array_equal(getattr(many, field.name)[3:4], getattr(one, field.name))


def test_another_width_leaves_the_other_classes_as_they_are() -> None:
    wider = replace(Tolerances(), thickness=ErrorWidth(half_width=0.3))
    old = draw_deviations(DUET, Tolerances(), range(2), 1)
    new = draw_deviations(DUET, wider, range(2), 1)
    np.testing.assert_allclose(new.thickness_mm, 10 * old.thickness_mm)
    np.testing.assert_array_equal(new.element_decentre_mm, old.element_decentre_mm)
    np.testing.assert_array_equal(new.index, old.index)


def test_errors_touch_only_what_they_belong_to() -> None:
    wide = replace(Tolerances(), abbe=ErrorWidth(half_width=0.01), conic=ErrorWidth(half_width=0.1))
    drawn = draw_deviations(DUET, wide, range(20), 1)
    assert not drawn.index[:, [0, 2, 4]].any()
    assert not drawn.abbe[:, [0, 2, 4]].any()
    assert not drawn.thickness_mm[:, -1].any()
    assert not drawn.surface_tilt_rad[:, 0].any()
    assert not drawn.conic[:, 0].any()
    assert drawn.index[:, [1, 3]].all()
    assert np.hypot(*drawn.element_decentre_mm.T).max() <= 0.02


def test_depths_of_grooves_are_off_where_there_are_grooves_and_move_nothing_else() -> None:
    lens = perfect_lens(40.0, 6.0, grooves=Grooves(depth_um=110.0))
    wide = replace(Tolerances(), groove_depth=ErrorWidth(half_width=0.02))
    old, new = (draw_deviations(lens, given, range(20), 1) for given in (Tolerances(), wide))
    assert not new.groove_depth[:, :2].any()
    assert new.groove_depth[:, 2].all()
    assert np.abs(new.groove_depth).max() <= 0.02
    for field in fields(new):
        if field.name != "groove_depth":
            np.testing.assert_array_equal(getattr(new, field.name), getattr(old, field.name))
    singles, arrays = single_deviations(lens, wide.only("groove_depth"))
    assert [(one.part, one.value) for one in singles] == [(2, 0.02), (2, -0.02)]
    assert arrays.of_copy(1).groove_depth.tolist() == [[0.0, 0.0, -0.02]]


def test_figure_and_wedge_touch_polished_glass_alone_and_move_no_other_draw() -> None:
    lens = perfect_lens(40.0, 6.0, grooves=Grooves(depth_um=110.0))
    wide = replace(
        Tolerances(),
        power=ErrorWidth(half_width=3.0),
        irregularity=ErrorWidth(half_width=1.0),
        wedge=ErrorWidth(half_width=1e-3),
    )
    old, new = (draw_deviations(lens, given, range(20), 1) for given in (Tolerances(), wide))
    # a stop, the front of a plate, and its grooved rear
    assert new.power_fringes[:, 1].all()
    assert not new.power_fringes[:, [0, 2]].any()
    assert not new.irregularity_fringes[:, [0, 2]].any()
    assert not new.wedge_rad[:, [0, 2]].any()
    assert np.abs(new.power_fringes).max() <= 3
    assert np.hypot(*new.irregularity_fringes.T).max() <= 1
    assert np.hypot(*new.wedge_rad.T).max() <= 1e-3
    np.testing.assert_array_equal(
        new.surface_turn_rad[:, 2], old.surface_tilt_rad[:, 2] + new.wedge_rad[:, 1]
    )
    for field in fields(new):
        if field.name not in {"power_fringes", "irregularity_fringes", "wedge_rad"}:
            np.testing.assert_array_equal(getattr(new, field.name), getattr(old, field.name))
    singles, arrays = single_deviations(lens, wide.only("irregularity"))
    assert [(one.part, one.value) for one in singles] == [(1, 1.0), (1, -1.0)]
    assert arrays.of_copy(1).irregularity_fringes[0].tolist() == [[0, 0], [-1, 0], [0, 0]]


def test_glass_that_holds_the_sensor_has_no_wedge() -> None:
    surfaces = (*DUET.surfaces[:-1], replace(DUET.surfaces[-1], glass="PMMA-Sultanova2009"))
    wide = Tolerances(wedge=ErrorWidth(half_width=1e-3))
    drawn = draw_deviations(replace(DUET, surfaces=surfaces), wide, range(3), 1)
    assert not drawn.wedge_rad[:, -1].any()
    assert drawn.wedge_rad[:, 3].any()


def test_at_limits_every_error_has_its_full_size() -> None:
    drawn = draw_deviations(DUET, Tolerances(), range(8), 1, at_limits=True)
    np.testing.assert_allclose(np.abs(drawn.radius[:, 1:]), 0.002)
    assert not drawn.radius[:, 0].any()
    np.testing.assert_allclose(np.hypot(*drawn.element_decentre_mm.T), 0.02)
    assert {*np.sign(drawn.focus_mm)} == {-1.0, 1.0}


def test_no_deviations_are_zero() -> None:
    assert not any(getattr(no_deviations(DUET), f.name).any() for f in fields(no_deviations(DUET)))


def test_single_errors_are_alone_in_their_copy() -> None:
    singles, drawn = single_deviations(DUET, Tolerances())
    per_copy = sum(
        (getattr(drawn, f.name) != 0).reshape(drawn.copies, -1).sum(1) for f in fields(drawn)
    )
    assert len(singles) == drawn.copies
    assert (per_copy == 1).all()
    place = next(
        i for i, s in enumerate(singles) if s.error_class == "element_tilt" and s.part == 1
    )
    assert drawn.element_tilt_rad[place, 1, 0] == singles[place].value
    assert {s.part for s in singles if s.error_class == "index"} == {1, 3}
    assert {s.part for s in singles if s.error_class == "focus"} == {None}


def test_negative_seed_is_refused() -> None:
    with pytest.raises(ContractError, match="seed"):
        draw_deviations(DUET, Tolerances(), range(1), -1)
