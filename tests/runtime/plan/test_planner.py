"""Quality and budgets become work; the capture alone decides, and --size always wins."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Linearise, Network
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import FULL, PLAIN, WIENER
from camkit.runtime.plan.estimate import estimate_seconds
from camkit.runtime.plan.loss import plan_entries
from camkit.runtime.plan.planner import Plan, default_size, make_plan, needs_content
from camkit.runtime.plan.speed import Speed
from tests.job_factory import made_planes, start
from tests.plan_factory import MODEL, half_textured_mosaic, write_planned_bundle
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle

SPEED = Speed(
    network_s_per_mp={(DEFAULT_ROLE, "M"): 2.0, (DEFAULT_ROLE, "S"): 1.0},
    block_s=0.005,
    clipped_block_s=5 * 0.005,
    rest_s_per_mp=0.1,
    threads=1,
)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Give a calibrated bundle with sizes S and M."""
    return write_planned_bundle(tmp_path_factory.mktemp("planned"))


@pytest.fixture(scope="module")
def plan_with(bundle: Bundle) -> Callable[..., Plan]:
    """Give a function from options to the plan of the half textured capture."""
    made = _start(bundle, quality="adaptive").plan
    assert made is not None
    subject = made.subject

    def plan(**choices: object) -> Plan:
        options = Options(**choices)  # type: ignore[arg-type]
        return make_plan(replace(subject, options=options, loss_db=0.0), lambda: SPEED)

    return plan


def _start(bundle: Bundle, **choices: object) -> Reconstruction:
    pipeline = Pipeline(bundle, Options(**choices))  # type: ignore[arg-type]
    capture = pipeline.capture_of(
        half_textured_mosaic(), iso=100, white_balance=(1.5, 1.0, 1.3), origin_px=None
    )
    return pipeline.start(capture)


def _picture(bundle: Bundle, **choices: object) -> FloatArray:
    return _start(bundle, **choices).fill(None)


@pytest.mark.parametrize("quality", ["exact", "best"])
def test_exact_and_best_skip_nothing(plan_with: Callable[..., Plan], quality: str) -> None:
    plan = plan_with(quality=quality)
    assert plan.work.labels is None
    assert plan.work.size == "M"
    assert plan.cost_db == 0


def test_adaptive_gives_the_network_to_the_textured_half(plan_with: Callable[..., Plan]) -> None:
    plan = plan_with(quality="adaptive")
    labels = plan.work.labels
    assert labels is not None
    assert (labels[:, 2:] == FULL).all()
    assert (labels[:, 0] <= WIENER).all()
    assert plan.cost_db <= MODEL.adaptive_db


def test_draft_takes_the_smallest_size(plan_with: Callable[..., Plan]) -> None:
    plan = plan_with(quality="draft")
    assert plan.work.size == "S"
    assert plan.cost_db > plan_with(quality="adaptive").cost_db


@pytest.mark.parametrize("quality", ["best", "draft", "adaptive"])
def test_size_always_wins(bundle: Bundle, plan_with: Callable[..., Plan], quality: str) -> None:
    other = "S" if quality == "best" else "M"
    assert plan_with(quality=quality, size=other).work.size == other
    assert default_size(bundle, Options(quality=quality, size=other)) == other  # type: ignore[arg-type]


def test_size_wins_over_budgets(plan_with: Callable[..., Plan]) -> None:
    assert plan_with(size="M", max_error_db=5.0).work.size == "M"
    assert plan_with(size="M", max_seconds=0.9).work.size == "M"


def test_a_generous_error_means_less_work(plan_with: Callable[..., Plan]) -> None:
    seconds = [
        estimate_seconds(plan.subject, plan.work, SPEED)
        for plan in (plan_with(max_error_db=limit) for limit in (0.01, 0.3, 5.0))
    ]
    assert seconds[0] >= seconds[1] > seconds[2]


def test_less_time_never_means_less_loss(plan_with: Callable[..., Plan]) -> None:
    costs, works = [], []
    for seconds in (100.0, 1.6, 1.2, 0.8, 0.3):
        plan = plan_with(max_seconds=seconds)
        costs.append(plan.cost_db)
        works.append(plan.work)
    assert works[0].labels is None
    assert works[-1].method == "wiener"
    assert costs[:-1] == sorted(costs[:-1])


def test_a_time_that_nothing_fits_is_said(plan_with: Callable[..., Plan]) -> None:
    assert "more than" in plan_with(max_seconds=0.001).note


def test_savings_are_positive_where_cells_are_skipped(plan_with: Callable[..., Plan]) -> None:
    decisions = {d.what: d for d in plan_with(quality="adaptive").decisions(SPEED)}
    assert decisions["cells"].saving_s is not None
    assert decisions["cells"].saving_s > 0
    assert decisions["wavelengths"].saving_s == 0
    exact = plan_with(quality="exact").decisions(SPEED)
    assert all(d.saving_s == 0 and d.cost_db == 0 for d in exact)


def test_a_size_that_was_asked_for_costs_what_this_capture_says(bundle: Bundle) -> None:
    """The capture is looked at for the estimate alone, after the plan was made."""
    work = _start(bundle, size="S")
    assert work.explain() is not None
    (told,) = (d for d in work.record["decisions"] if d["what"] == "size")
    assert told["cost_db"] > 0
    assert told["saving_s"] is not None


def test_draft_counts_what_the_smaller_size_saves(plan_with: Callable[..., Plan]) -> None:
    decisions = {d.what: d for d in plan_with(quality="draft").decisions(SPEED)}
    assert decisions["size"].saving_s is not None
    assert decisions["size"].saving_s > 0
    assert decisions["size"].cost_db > 0
    assert decisions["wavelengths"].saving_s == 0  # what the size saves is said once


def test_without_calibration_nothing_is_skipped(tmp_path: Path) -> None:
    bare = write_planned_bundle(tmp_path, model=None)
    work = _start(bare, quality="adaptive")
    assert work.size == "M"
    assert "calibrated" in work.record["decisions"][1]["reason"]


def test_only_choices_that_depend_on_the_capture_measure_it() -> None:
    assert not needs_content(Options())
    assert not needs_content(Options(quality="best"))
    assert needs_content(Options(quality="draft"))
    assert needs_content(Options(max_seconds=1.0))
    assert needs_content(Options(max_error_db=1.0))


def test_result_is_the_same_for_every_tile_memory_and_thread_count(bundle: Bundle) -> None:
    wanted = _picture(bundle, quality="adaptive", threads=1)
    for tile_px, threads in ((256, 2), (512, 1), (1024, 2)):
        other = _picture(bundle, quality="adaptive", threads=threads, tile_px=tile_px)
        np.testing.assert_array_equal(other, wanted)
    tight = _picture(bundle, quality="adaptive", max_mem_bytes=400_000_000)
    np.testing.assert_array_equal(tight, wanted)


def test_textured_half_has_the_bits_of_exact_and_the_flat_half_does_not(bundle: Bundle) -> None:
    adaptive = _picture(bundle, quality="adaptive", undistort=False)
    exact = _picture(bundle, undistort=False)
    np.testing.assert_array_equal(adaptive[:, :, 544:], exact[:, :, 544:])
    assert (adaptive[:, :, :256] != exact[:, :, :256]).any()


def test_a_picture_that_needs_no_network_anywhere_is_as_developed(tmp_path: Path) -> None:
    generous = write_planned_bundle(tmp_path, model=replace(MODEL, adaptive_db=90.0))
    work = _start(generous, quality="adaptive", undistort=False)
    assert work.labels is not None
    assert (work.labels == PLAIN).all()
    assert work.explain() is not None
    made, developed = work.fill(None), _picture(generous, method="develop", undistort=False)
    # the way to equal noise and back rounds; on texture it ends what lies below black too
    np.testing.assert_allclose(made[:, :, :480], developed[:, :, :480], atol=1e-5)
    assert np.median(np.abs(made - developed)) < 1e-6


def test_estimate_comes_with_the_decisions(bundle: Bundle) -> None:
    work = _start(bundle, quality="adaptive")
    estimate = work.explain()
    assert estimate is not None
    assert estimate.seconds > 0
    assert 260 < estimate.peak_mb < 1200
    assert work.record["estimate"] == estimate.to_json()
    assert all(d["saving_s"] is not None for d in work.record["decisions"])
    compared = estimate.compare(2 * estimate.seconds, estimate.peak_mb)
    assert compared["seconds_ratio"] == pytest.approx(2.0, abs=0.01)
    assert compared["peak_ratio"] == pytest.approx(1.0, abs=0.01)


def test_where_nothing_stands_in_for_a_network_it_gets_every_cell(tmp_path: Path) -> None:
    """A network that makes the picture finer is not left out of flat cells, however draft."""
    data = finer_network(1, 1, scale=2)
    port = Port(name="a", channels=1)
    fine = port.model_copy(update={"scale": 2})
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("large",), transform="none"),
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(size_px=(512, 512)),
        networks={DEFAULT_ROLE: (facts_of(data, [port], [fine]), data)},
        plan=plan_entries(MODEL, adaptive_cost_db=0.05, draft_cost_db=0.3),
    )
    flat = made_planes(samples=np.full((1, 512, 512), 0.3, np.float32))
    work = start(camera, flat, quality="adaptive")
    assert work.labels is None
    reasons = {d["what"]: d["reason"] for d in work.record["decisions"]}
    assert reasons["cells"] == "the bundle has no substitute for the network's result"
    assert work.fill().shape == (1, 1024, 1024)
