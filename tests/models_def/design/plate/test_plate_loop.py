"""The steps of a design: they come nearer, end in the same bits when resumed, see the etching."""

from typing import Any

import pytest
import torch

from camkit.models_def.design.plate.maps import begin_map
from camkit.models_def.design.plate.plate_loop import PlateLoop
from camkit.models_def.design.plate.plate_recipe import to_plate_recipe
from tests.models_def.design.plate.test_plate_recipe import table

ETCHING = {"range_um": 0.3, "levels": 8}


def _loop(**changes: Any) -> PlateLoop:
    recipe = to_plate_recipe(table(**changes))
    return PlateLoop(recipe, begin_map(recipe))


def test_a_design_comes_near_its_goal() -> None:
    pixels = {"pitch_um": 6.0, "side_px": 41, "wavelengths_um": [0.55], "samples": 2}
    loop = _loop(pixels=pixels, schedule={"steps": 40, "rate": 0.05, "log_steps": 10})
    begin = loop.judge()
    *_, last = loop.run()
    assert begin.shares.streak_share[0] < 0.02
    assert last.best_loss < 0.25 * begin.loss
    assert last.shares.streak_share[0] == pytest.approx(0.06, abs=0.015)
    assert last.shares.core_share[0] == pytest.approx(0.94, abs=0.02)
    loop.take_best()
    assert loop.judge().loss == last.best_loss


@pytest.mark.parametrize("etched", [{}, {"etched": True, "depth_error": 0.1}])
def test_a_resumed_loop_ends_in_the_same_bits(etched: dict[str, Any]) -> None:
    schedule = {"steps": 6, "rate": 0.05, "log_steps": 2, **etched}
    whole, first = (_loop(schedule=schedule, etching=ETCHING) for _ in range(2))
    moments = list(whole.run())
    assert [moment.step for moment in moments] == [2, 4, 6]
    list(first.run(last_step=3))
    second = _loop(schedule=schedule, etching=ETCHING)
    second.load(first.state())
    assert [moment.loss for moment in second.run()][-1] == moments[-1].loss
    assert torch.equal(second.height_map(), whole.height_map())


def test_a_loop_through_levels_sees_what_is_etched() -> None:
    plain = _loop(etching={"range_um": 1.2, "levels": 2})
    etched = _loop(etching={"range_um": 1.2, "levels": 2}, schedule={"etched": True})
    assert etched.judge().loss != plain.judge().loss
    before = [value.clone() for value in etched.height_map.parameters()]
    etched._one_step()
    assert all(
        not torch.equal(old, new)
        for old, new in zip(before, etched.height_map.parameters(), strict=True)
    )


def test_a_loop_whose_time_is_over_stops_after_its_step() -> None:
    loop = _loop()
    assert [moment.step for moment in loop.run(seconds=0.0)] == [1]
