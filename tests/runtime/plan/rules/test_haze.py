"""A plan says what happens to the haze, and of the bank only where it runs."""

from typing import Any

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import Decision
from tests.haze_bundle import write_hazy_bundle

HEIGHT, WIDTH = 64, 96


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_hazy_bundle(tmp_path_factory.mktemp("plan_haze"))


def _decisions(bundle: Bundle, **choices: Any) -> dict[str, Decision]:
    pipeline = Pipeline(bundle, Options(**choices))
    mosaic = np.full((HEIGHT, WIDTH), 900, np.uint16)
    capture = pipeline.capture_of(mosaic, iso=100, white_balance=None, origin_px=None)
    plan = pipeline.start(capture).plan
    assert plan is not None
    return {decision.what: decision for decision in plan.decisions()}


def test_the_haze_is_undone_everywhere(bundle: Bundle) -> None:
    found = _decisions(bundle)
    assert found["haze"].choice == "removed everywhere"
    assert "96 cells of 8 px" in found["haze"].reason
    assert {"blocks", "wavelengths"} <= set(found)


def test_what_is_left_over_is_counted_as_the_solver_counts_it(bundle: Bundle) -> None:
    pipeline = Pipeline(bundle, Options(assume="centre"))
    mosaic = np.full((20, 30), 900, np.uint16)
    capture = pipeline.capture_of(mosaic, iso=100, white_balance=None, origin_px=None)
    plan = pipeline.start(capture).plan
    assert plan is not None
    (said,) = (d for d in plan.decisions() if d.what == "haze")
    assert "12 cells of 8 px" in said.reason


def test_without_the_bank_nothing_is_said_of_it(bundle: Bundle) -> None:
    found = _decisions(bundle, method="haze")
    assert found["haze"].choice == "removed everywhere"
    assert not {"blocks", "wavelengths"} & set(found)


def test_developing_leaves_the_haze(bundle: Bundle) -> None:
    found = _decisions(bundle, method="develop")
    assert found["haze"] == Decision(what="haze", choice="left in", reason='method="develop"')
    assert not {"blocks", "wavelengths"} & set(found)
