"""Scenarios are rows of tables that are found by their place, and all of them run."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.report.stress.lamps import planck
from camkit.report.stress.scenario import Scenario, all_scenarios, choose, row
from camkit.report.stress.scenarios.lens_rows import GRID_UM, add_haze
from camkit.report.stress.scenarios.sensor_rows import POWER, with_discs
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.runtime.envelope import QUANTITIES
from tests.psf_factory import gaussian_kernel

ALL = all_scenarios()
HAZY = {"energy_split", "lost_dark_frame"}


def test_every_row_of_the_failure_table_has_its_scenario() -> None:
    names = [s.name for s in ALL]
    assert len(set(names)) == len(names)
    wanted = {"noise", "exposure", "saturated_area", "blob_size", "psf_scale", "psf_rotation"}
    wanted |= {"decentre", "defocus", "illuminant", "wrong_bundle", "dead_pixels", "bit_depth"}
    wanted |= {"invalid_pixels", "picture_size", "fp16_range", "tile_seams", "resolution"}
    wanted |= {"light_colour", "dynamic_range", "surroundings", "black_level", *HAZY}
    assert wanted <= set(names)


def test_bounded_quantities_are_those_the_runtime_sees() -> None:
    assert {q for s in ALL for q in s.bounds} == set(QUANTITIES)


@pytest.mark.parametrize("scenario", ALL, ids=lambda s: s.name)
def test_its_last_value_is_survived_by_every_method(
    scenario: Scenario, judge: Judge, scene: Scene
) -> None:
    if scenario.applies(judge.rig.bundle) is not None:
        assert scenario.name in {"defocus", "depth", "known_depth", *HAZY}
        return
    value = [v for v in scenario.quick if v != scenario.nominal][-1]
    verdict = scenario.take(judge, scene, value)
    assert "M" in verdict.outcomes
    for outcome in verdict.outcomes.values():
        assert outcome.psnr_db is None or 0 < outcome.psnr_db <= 120
        assert outcome.chi2 is None or outcome.chi2 > 0
    assert not any("NaN" in (o.fault or "") for o in verdict.outcomes.values())


def test_chosen_by_name_in_the_order_asked_for() -> None:
    assert [s.name for s in choose("noise, haze")] == ["noise", "haze"]
    assert len(choose(None)) == len(ALL)
    with pytest.raises(ContractError, match=r"unknown scenario.*gremlins.*noise"):
        choose("noise,gremlins")


def test_a_row_says_which_value_is_nominal_and_which_are_quick() -> None:
    found = row("x", "X", "turn", "deg", "-2 (-0.5) [0] 1 (1e3)", shoot=lambda *_: None)
    assert found.values == (-2, -0.5, 0, 1, 1000)
    assert found.nominal == 0
    assert found.quick == (-0.5, 0, 1000)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"values": (2.0, 1.0)}, "increase"),
        ({"nominal": 7.0}, "nominal"),
        ({"quick": (2.0,)}, "quick"),
        ({"labels": ("one",)}, "labels"),
        ({"measure": None}, "shoots or measures"),
    ],
)
def test_a_scenario_that_makes_no_sense_is_refused(change: dict[str, object], message: str) -> None:
    fields: dict[str, object] = {"name": "x", "title": "x", "knob": "x", "unit": ""}
    fields |= {"values": (1.0, 2.0), "nominal": 1.0, "quick": (1.0, 2.0)}
    fields |= {"measure": lambda *_: None}
    with pytest.raises(ContractError, match=message):
        Scenario(**(fields | change))  # type: ignore[arg-type]


def test_haze_moves_the_share_it_says_and_keeps_the_light() -> None:
    kernel = gaussian_kernel(1.0, radius_px=40)
    hazy = add_haze(kernel, 0.25)
    np.testing.assert_allclose(hazy.sum(axis=(1, 2)), 1, rtol=1e-5)
    assert hazy[0, 40, 40] == pytest.approx(0.75 * kernel[0, 40, 40], rel=0.01)


def test_discs_cover_the_area_they_should(scene: Scene) -> None:
    lit = with_discs(scene, 10.0, 1).linear
    assert (lit == POWER).sum() / 3 == pytest.approx(np.pi * 100, rel=0.15)


def test_a_black_body_follows_wien() -> None:
    wide = np.linspace(0.2, 3.0, 28001)
    for kelvin in (2856.0, 6504.0):
        assert wide[np.argmax(planck(kelvin)(wide))] == pytest.approx(2897.77 / kelvin, rel=1e-3)
    assert planck(5000.0)(np.array(0.56)) == pytest.approx(1)
    assert (planck(5000.0)(GRID_UM) > 0).all()
