"""Work on a capture that is averaged over squares first."""

import pytest

from camkit.bundle.reader import Bundle
from camkit.runtime.options import Options
from camkit.runtime.plan.binned_work import NETWORK_SHARE, draft_side_px, no_binning
from camkit.runtime.plan.planner import asked_work
from tests.job_factory import made_mosaic, start


def test_half_scale_keeps_a_share_of_the_network_and_a_quarter_keeps_none(bundle: Bundle) -> None:
    assert asked_work(bundle, Options()).strength == 1
    half = asked_work(bundle, Options(scale="1/2"))
    assert (half.networks, half.strength) == (True, NETWORK_SHARE)
    assert not asked_work(bundle, Options(scale="1/4")).networks
    assert asked_work(bundle, Options(scale="1/4", size="M")).networks


def test_a_draft_is_of_half_scale_unless_a_method_is_asked_for(bundle: Bundle) -> None:
    stages = bundle.manifest.stages
    assert draft_side_px(Options(quality="draft"), stages) == 2
    assert draft_side_px(Options(quality="draft", method="wiener"), stages) == 1
    assert draft_side_px(Options(), stages) == 1


def test_cameras_whose_pixels_cannot_be_averaged_say_why(bundle: Bundle) -> None:
    stages = bundle.manifest.stages
    assert no_binning(stages) == ""
    alone = [stage for stage in stages if stage.type != "wiener"]
    assert "its network stands alone" in no_binning(alone)
    assert no_binning([stage for stage in alone if stage.type != "network"]) == ""


@pytest.mark.parametrize(("scale", "network"), [("1/2", "75%"), ("1/4", "no network")])
def test_the_plan_says_the_scale_and_what_becomes_of_the_network(
    bundle: Bundle, scale: str, network: str
) -> None:
    plan = start(bundle, made_mosaic(), scale=scale).plan
    assert plan is not None
    decision = plan.decisions()[0]
    assert (decision.what, decision.choice) == ("scale", scale)
    assert network in decision.reason


def test_a_draft_says_that_it_is_enlarged_and_what_it_costs(bundle: Bundle) -> None:
    work = start(bundle, made_mosaic(), quality="draft")
    assert work.plan is not None
    decision = work.plan.decisions()[0]
    assert (decision.choice, decision.cost_db > 0) == ("1/2, enlarged", True)
    assert work.shape == (3, 64, 96)
