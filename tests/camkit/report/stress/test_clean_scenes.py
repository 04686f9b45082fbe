"""Stars and limbs under stress: numbers for every method, none for a picture that is the truth."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import open_bundle
from camkit.bundle.writer import write_bundle
from camkit.report.figure import to_png
from camkit.report.stress.curve import breaks_of, curve_of
from camkit.report.stress.report import scenario_json
from camkit.report.stress.scenario import LEAST_ROOM_PX, Scenario, choose, has_room
from camkit.report.stress.scenarios.scene_rows import limb_numbers, moonlit, star_numbers
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Comparison, Judge, Numbers
from camkit.report.stress.stress_chart import draw_curve
from camkit.report.stress.sweep import Sweep, run_sweep
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_sensor

CLEAN = choose("stars,limb")


@pytest.mark.parametrize("scenario", CLEAN, ids=lambda s: s.name)
def test_every_method_gets_its_numbers(scenario: Scenario, judge: Judge, scene: Scene) -> None:
    points = list(run_sweep(Sweep(scenarios=(scenario,), scenes=(scene,), quick=True), judge, None))
    curve = curve_of(scenario, points, judge.rivals)
    row = scenario_json(curve, breaks_of(curve), judge.rig.bundle, judge.primary)
    assert row["extra"]
    for name, grids in row["extra"].items():
        assert name.endswith(("_percent", "_px"))
        assert grids.keys() == set(judge.methods)
        assert all(np.isfinite(value) for values in grids.values() for value in values)
    assert to_png(draw_curve(curve, breaks_of(curve))).startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("scenario", "numbers"), [(CLEAN[0], star_numbers), (CLEAN[1], limb_numbers)]
)
def test_the_truth_itself_has_nothing_to_be_blamed_for(
    scenario: Scenario, numbers: Numbers, judge: Judge, scene: Scene
) -> None:
    assert scenario.shoot is not None
    truth = Comparison(scenario.shoot(judge, scene, scenario.nominal)).truth
    found = dict(numbers(truth, truth))
    assert found.pop("core_median_percent", 100) > 95
    assert max(found.values()) < 5
    assert min(found.values()) >= 0


def test_a_sensor_without_surroundings_is_left_out(judge: Judge, tmp_path: Path) -> None:
    assert has_room(judge.rig.bundle) is None
    path = tmp_path / "small.camkit"
    side_px = LEAST_ROOM_PX - 2
    write_bundle(path, tiny_manifest(sensor=tiny_sensor(320, side_px)), tiny_members())
    assert f"fewer than {LEAST_ROOM_PX} px" in str(has_room(open_bundle(path)))


@pytest.mark.parametrize("number", range(16))
def test_the_smallest_sensor_has_room_for_the_disc(number: int) -> None:
    """A disc with its surroundings must fit, whatever its size and place."""
    black = np.zeros((3, LEAST_ROOM_PX, LEAST_ROOM_PX), np.float32)
    scene = Scene(name="black", number=number, linear=black)
    shown = moonlit(scene, 0.6).linear
    assert limb_numbers(shown, shown)["wobble_px"] < 0.01
