import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from tools.design.stability_chart import (
    Rules,
    Trial,
    best_trials,
    cells,
    to_text,
    wilson_interval,
    write_stability,
)

GOOD = Trial(
    arm="after",
    number=0,
    level=0.1,
    run="box",
    scaled=(0.5,),
    front_db=25.0,
    valid_rays=1.0,
    efl_mm=50.2,
    limits_cost=0.0,
    cpu_s=1.0,
)
RULES = Rules(efl_mm=50.0)
TRIALS = [
    GOOD,
    replace(GOOD, number=1, front_db=24.6),
    replace(GOOD, number=2, front_db=24.4),  # too soft
    replace(GOOD, number=3, efl_mm=50.6),  # too long
    replace(GOOD, number=4, front_db=27.0, valid_rays=0.999),  # loses rays: no best lens either
    replace(GOOD, number=5, front_db=math.nan),  # no image
    replace(GOOD, number=6, limits_cost=1.0),  # a success that cannot be built
    replace(GOOD, number=0, arm="before", front_db=20.0),
    replace(GOOD, number=0, run="end", front_db=26.0),  # does not count
]


def test_a_success_is_sharp_has_all_its_rays_and_its_focal_length() -> None:
    after, before = cells(TRIALS, RULES)
    assert (after.arm, after.starts, after.succeeded, after.buildable) == ("after", 7, 3, 2)
    assert (before.arm, before.starts, before.succeeded) == ("before", 1, 0)
    assert len(after.front_db) == 6
    assert (after.sharp, before.sharp) == (4, 0)


def test_the_best_trials_are_sound_ones_first() -> None:
    assert [t.number for t in best_trials(TRIALS, RULES, "after", 3)] == [0, 6, 1]
    assert [t.number for t in best_trials(TRIALS, RULES, "after", 99)][-2:] == [4, 3]


@pytest.mark.parametrize(
    ("hits", "trials", "low", "high"),
    [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (10, 10, 0.7225, 1.0), (8, 8, 0.6756, 1.0)],
)
def test_intervals_are_those_of_wilsons_table(
    hits: int, trials: int, low: float, high: float
) -> None:
    assert wilson_interval(hits, trials) == pytest.approx((low, high), abs=5e-5)


def test_chart_table_and_json_tell_the_same(tmp_path: Path) -> None:
    png, svg, text = write_stability(TRIALS, RULES, {"recipe": "small"}, tmp_path)
    assert png.read_bytes().startswith(b"\x89PNG")
    assert "± 10 %" in svg.read_text(encoding="utf-8")
    report = json.loads(text.read_text(encoding="utf-8"))
    assert [c["succeeded"] for c in report["cells"]] == [3, 0]
    assert report["ends"][0]["front_db"] == 26.0
    table = to_text(TRIALS, RULES)
    assert "| after | ± 10 % | 4/7 | 3/7 (16-75 %) | 2/7 |" in table
    assert "to the end: after, start 0: 26.00 dB" in table
