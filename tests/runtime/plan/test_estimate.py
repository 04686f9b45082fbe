"""What work will take is the sum of what its stages say, each on the grid that it works on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.facts import Port
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Color, Linearise, Network, Wiener
from camkit.runtime.bank.blocks import lay_spans
from camkit.runtime.content import LIGHT_PX
from camkit.runtime.plan.counted import STRIP_RATIO
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.estimate import (
    FILE_SHARE,
    NETWORK_REST,
    Estimate,
    estimate_seconds,
    network_seconds,
    role_window_mp,
    stage_seconds,
)
from camkit.runtime.plan.speed import Speed
from camkit.runtime.stage_finder import stage_module
from camkit.runtime.stages.wiener import KERNEL_BLOCKS
from tests.job_factory import made_mosaic, made_planes, start
from tests.plan_factory import made_content
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle

SPEED = Speed(
    network_s_per_mp={("restore", "M"): 3.0, ("clean", "M"): 5.0, ("enlarge", "M"): 7.0},
    block_s=0.01,
    clipped_block_s=5 * 0.01,
    rest_s_per_mp=2.0,
    threads=2,
)


@pytest.fixture(scope="module")
def subject(bundle: Bundle) -> Subject:
    made = start(bundle, made_mosaic()).plan
    assert made is not None
    return made.subject


def test_seconds_are_those_of_the_stages_and_of_the_files(subject: Subject) -> None:
    taken = stage_seconds(subject, Work(), SPEED)
    stages = subject.bundle.manifest.stages
    alone = [stage_module(s.type).seconds(s, subject, Work(), SPEED) for s in stages]
    assert taken == tuple(alone)
    assert min(taken) > 0
    files = FILE_SHARE * SPEED.rest_s_per_mp * subject.megapixels
    assert estimate_seconds(subject, Work(), SPEED) == pytest.approx(sum(taken) + files)
    around = NETWORK_REST * SPEED.rest_s_per_mp
    assert taken[5] == pytest.approx((3.0 + around) * subject.megapixels)


def test_what_is_left_out_takes_no_time(subject: Subject) -> None:
    work = Work(method="wiener", networks=False, left_out=frozenset({"undistort"}))
    usual, less = stage_seconds(subject, Work(), SPEED), stage_seconds(subject, work, SPEED)
    assert [n for n, seconds in enumerate(less) if seconds == 0] == [5, 8]
    assert all(a == b for n, (a, b) in enumerate(zip(usual, less, strict=True)) if n not in (5, 8))


def test_only_blocks_with_clipped_samples_take_longer(subject: Subject) -> None:
    number = next(n for n, s in enumerate(subject.bundle.manifest.stages) if s.type == "wiener")
    bank = subject.bundle.manifest.stages[number]
    assert isinstance(bank, Wiener)
    bank = bank.model_copy(update={"clip_iterations": 6, "block_px": 128, "overlap_px": 32})
    content = made_content(np.full((3, 4), 1e-3))
    content.lights[5, 7] = True
    lit = replace(subject, height_px=768, width_px=1024, content=content)
    dark = replace(lit, content=made_content(np.full((3, 4), 1e-3)))
    rows, columns = (lay_spans(side, 128, 32) for side in (768, 1024))
    touching = sum(
        bool(np.isin(row.index // LIGHT_PX, 5).any() and np.isin(column.index // LIGHT_PX, 7).any())
        for row in rows
        for column in columns
    )
    assert 1 <= touching <= 4
    taken = [stage_module("wiener").seconds(bank, one, Work(), SPEED) for one in (dark, lit)]
    least, most = (0.005 * n * len(rows) * len(columns) for n in (1, 1 + KERNEL_BLOCKS))
    assert least <= taken[0] <= most
    assert taken[1] - taken[0] == pytest.approx(0.02 * touching)


def test_windows_that_are_planned_count_as_they_are(subject: Subject) -> None:
    planned = {"restore": {"M": 0.5}}
    usual, exact = (
        stage_seconds(subject, Work(), SPEED),
        stage_seconds(subject, Work(), SPEED, planned),
    )
    around = NETWORK_REST * SPEED.rest_s_per_mp * subject.megapixels
    whole = network_seconds("restore", {"M": 0.5}, SPEED, subject.megapixels)
    assert exact[5] == whole == pytest.approx(1.5 + around)
    assert exact[:5] + exact[6:] == usual[:5] + usual[6:]


def test_networks_of_several_roles_count_on_the_grid_of_what_they_take(tmp_path: Path) -> None:
    one = Port(name="a", channels=1)
    fine = one.model_copy(update={"scale": 2})
    graphs = {"enlarge": finer_network(1, 1, scale=2), "clean": finer_network(1, 1, scale=1)}
    stages = (
        Linearise(gives=("light",)),
        Network(role="enlarge", takes=("light",), gives=("large",)),
        Network(role="clean", takes=("large",), gives=("clean",)),
        Color(takes=("clean",)),
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(),
        networks={
            "enlarge": (facts_of(graphs["enlarge"], [one], [fine], "e.onnx"), graphs["enlarge"]),
            "clean": (facts_of(graphs["clean"], [one], [one], "c.onnx"), graphs["clean"]),
        },
    )
    made = start(camera, made_planes(samples=np.full((1, 64, 96), 0.3, np.float32)))
    assert made.plan is not None
    subject, work = made.plan.subject, made.plan.work
    assert subject.role is None
    coarse = role_window_mp("enlarge", subject, work)["M"]
    assert coarse == pytest.approx(64 * 96 / 1e6 * STRIP_RATIO)
    assert role_window_mp("clean", subject, work)["M"] == pytest.approx(4 * coarse)
    taken = stage_seconds(subject, work, SPEED)
    around = NETWORK_REST * SPEED.rest_s_per_mp * subject.megapixels
    assert taken[1:3] == pytest.approx((7.0 * coarse + around, 5.0 * 4 * coarse + around))
    estimate = made.explain()
    assert estimate is not None
    assert set(made.record["stages"]) == {"linearise", "network enlarge", "network clean", "color"}
    assert all(stage["expected_s"] >= 0 for stage in made.record["stages"].values())
    assert made.windows["clean"].window_mp()["M"] >= 4 * 64 * 96 / 1e6
    assert made.fill().shape == (3, 128, 192)


def test_an_estimate_is_compared_with_what_was() -> None:
    estimate = Estimate(seconds=2.0, peak_mb=100.0)
    assert estimate.to_json() == {"seconds": 2.0, "peak_mb": 100.0}
    compared = estimate.compare(3.0, 120.0)
    assert (compared["seconds_ratio"], compared["peak_ratio"]) == (1.5, 1.2)
    assert replace(estimate, seconds=0.0).compare(1.0, 1.0)["seconds_ratio"] > 0
