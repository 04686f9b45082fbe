"""Plans are weighed by what their windows compute, against the whole picture in strips."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.runtime.content import CELL_PX
from camkit.runtime.plan.counted import STRIP_RATIO, counted_window_mp, counted_work
from camkit.runtime.plan.decision import FULL, PLAIN, WIENER, Subject, Work
from tests.job_factory import made_mosaic, start
from tests.plan_factory import HEIGHT_PX, WIDTH_PX, write_planned_bundle


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    bundle = write_planned_bundle(Path(tmp_path_factory.mktemp("planned")))
    samples = np.full((HEIGHT_PX, WIDTH_PX), 300, np.uint16)
    plan = start(bundle, made_mosaic(samples=samples)).plan
    assert plan is not None
    return plan.subject


def _labels(subject: Subject, tier: int) -> np.ndarray:
    shape = -(-subject.height_px // CELL_PX), -(-subject.width_px // CELL_PX)
    return np.full(shape, tier, np.int8)


def test_a_small_picture_is_one_window_and_a_large_one_is_strips(subject: Subject) -> None:
    assert counted_window_mp(subject, Work()) == {"M": subject.megapixels}
    large = replace(subject, height_px=2000, width_px=3000)
    assert counted_window_mp(large, Work()) == {"M": pytest.approx(STRIP_RATIO * 6)}


def test_a_lone_cell_costs_its_halo_too(subject: Subject) -> None:
    labels = _labels(subject, WIENER)
    labels[1, 1] = FULL
    reach = subject.reach_px("M")
    stride = subject.facts("M").stride_px
    side = CELL_PX + 2 * (-(-reach // stride) * stride)
    assert counted_window_mp(subject, Work(labels=labels)) == {"M": side * side / 1e6}


def test_less_is_less_work(subject: Subject) -> None:
    everything = counted_work(subject, Work())
    bank = counted_work(subject, Work(labels=_labels(subject, WIENER)))
    nothing = counted_work(subject, Work(labels=_labels(subject, PLAIN)))
    assert everything > bank > nothing > 0
    assert counted_work(subject, Work(networks=False)) < bank
