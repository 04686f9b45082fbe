"""Which way every stage takes, and what stands in where one is left out."""

import pytest

from camkit.bundle.chain import CAPTURE
from camkit.bundle.manifest import Manifest
from camkit.bundle.plane import Grid, Plane
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Linearise,
    Network,
    RaiseClipped,
    Stage,
    Wiener,
)
from camkit.errors import ContractError
from camkit.runtime.plan.decision import DEVELOP, Work
from camkit.runtime.plan.ways import (
    LEFT_OUT,
    WHOLE,
    known_stand_in,
    offered_methods,
    planned,
    stand_in,
    stand_ins,
    ways_of,
    without_networks,
)
from tests.bundle_factory import tiny_manifest, tiny_stages

STAGES = tiny_stages()
WIENER, NETWORK = 4, 5
BANK = Wiener(prior_scale=1e-3, prior_exponent=2.0, takes=("x",), gives=("y",))
NET = Network(takes=("x",), gives=("y",))


def _usual(**changes: str) -> tuple[str, ...]:
    ways = [WHOLE] * len(STAGES)
    ways[WIENER], ways[NETWORK] = changes.get("wiener", "wiener"), changes.get("network", "net")
    return tuple(ways)


@pytest.mark.parametrize(
    ("method", "wiener", "network"),
    [
        (None, "wiener", "net"),
        ("net", "wiener", "net"),
        ("wiener", "wiener", LEFT_OUT),
        ("rl", "rl", LEFT_OUT),
        ("admm-tv", "admm-tv", LEFT_OUT),
        (DEVELOP, LEFT_OUT, LEFT_OUT),
    ],
)
def test_a_method_is_the_way_of_its_stage_and_leaves_out_what_restores_behind_it(
    method: str | None, wiener: str, network: str
) -> None:
    assert ways_of(STAGES, Work(method=method)) == _usual(wiener=wiener, network=network)


def test_a_method_that_no_stage_has_is_refused_with_those_there_are() -> None:
    with pytest.raises(ContractError, match="net, wiener, rl, admm-tv, develop; got 'magic'"):
        ways_of(STAGES, Work(method="magic"))
    with pytest.raises(ContractError, match="wiener, rl, admm-tv, develop; got 'net'"):
        ways_of(tiny_stages("network"), Work(method="net"))


@pytest.mark.parametrize(
    ("stages", "method", "ways"),
    [
        ([NET, BANK], None, ["net", "wiener"]),
        ([NET, BANK], "wiener", ["net", "wiener"]),
        ([NET, BANK], "rl", ["net", "rl"]),
        ([NET, BANK], "net", ["net", LEFT_OUT]),
        ([NET, BANK], DEVELOP, [LEFT_OUT, LEFT_OUT]),
        ([NET, NET], "net", ["net", "net"]),
        ([BANK, NET, NET], "wiener", ["wiener", LEFT_OUT, LEFT_OUT]),
        ([BANK, NET, BANK], "rl", ["wiener", "net", "rl"]),
    ],
)
def test_in_any_order_what_lies_before_the_method_takes_its_usual_way(
    stages: list[Stage], method: str | None, ways: list[str]
) -> None:
    assert list(ways_of(stages, Work(method=method))) == ways


def test_types_that_nobody_wants_are_left_out_wherever_they_stand() -> None:
    work = Work(left_out=frozenset({"undistort", "illumination"}))
    ways = dict(zip((stage.type for stage in STAGES), ways_of(STAGES, work), strict=True))
    assert [type_ for type_, way in ways.items() if way == LEFT_OUT] == [
        "illumination",
        "undistort",
    ]


@pytest.mark.parametrize(
    ("stages", "method", "runs"),
    [
        (STAGES, None, True),
        (STAGES, "wiener", False),
        (STAGES, DEVELOP, False),
        (tiny_stages("network"), None, False),
        ([NET, BANK], "wiener", True),
    ],
)
def test_a_plan_knows_whether_any_network_runs(
    stages: list[Stage], method: str | None, runs: bool
) -> None:
    work = planned(stages, Work(method=method))
    assert work.networks is runs
    assert work.sizes() == (("M",) if runs else ())


def test_below_the_networks_is_the_best_method_that_runs_none() -> None:
    below = without_networks(tiny_manifest(), Work(size="L"))
    assert below is not None
    assert (below.method, below.networks, below.size) == ("wiener", False, "L")
    bare = tiny_manifest(
        stages=tuple(
            stage.model_copy(update={"takes": ("rgb", "rgb")})
            if isinstance(stage, Network)
            else stage
            for stage in tiny_stages("wiener")
        )
    )
    below = without_networks(bare, Work())
    assert below is not None
    assert below.method == DEVELOP


def test_only_methods_by_which_the_stages_can_be_walked_are_offered() -> None:
    manifest = tiny_manifest()
    assert offered_methods(STAGES, manifest.all_planes) == (
        *("net", "wiener", "rl", "admm-tv", DEVELOP),
    )
    light = Plane(channels=("R", "G", "B"), domain="linear")
    fine = light.model_copy(update={"grid": Grid().finer(2)})
    bank = BANK.model_copy(update={"takes": ("a",), "gives": ("x",)})
    planes = {"a": light, "x": light, "y": fine}
    assert offered_methods([bank, NET], planes) == ("net",), "nothing stands for the finer plane"
    last = BANK.model_copy(update={"takes": ("y",), "gives": ("z",)})
    assert offered_methods([NET, last], planes | {"z": fine}) == ("wiener", "rl", "admm-tv", "net")


# ------------------------------------------------------------------------------- stand-ins


def _planes(manifest: Manifest | None = None) -> dict[str, Plane]:
    return (manifest or tiny_manifest()).all_planes


def test_the_plane_of_the_sensor_is_among_those_known() -> None:
    planes = _planes()
    assert planes[CAPTURE].domain == "dn"
    assert set(planes) == {CAPTURE, *tiny_manifest().planes}


@pytest.mark.parametrize(
    ("stage", "instead"),
    [
        ("white_balance", "sound"),
        ("wiener", "rgb"),
        ("network", "restored"),
        ("raise_clipped", "clean"),
        ("illumination", "neutral"),
        ("undistort", "even"),
    ],
)
def test_a_plane_of_the_same_samples_stands_in(stage: str, instead: str) -> None:
    entry = next(s for s in STAGES if s.type == stage)
    assert stand_in(entry, _planes()) == instead


@pytest.mark.parametrize("stage", ["linearise", "repair", "demosaic", "color"])
def test_nothing_stands_for_another_domain_other_channels_or_two_planes(stage: str) -> None:
    entry = next(s for s in STAGES if s.type == stage)
    assert known_stand_in(entry, _planes()) is None
    with pytest.raises(ContractError, match=f"the stage {stage} cannot be left out"):
        stand_in(entry, _planes())


@pytest.mark.parametrize(
    "change",
    [
        {"grid": Grid().finer(2)},
        {"grid": Grid(origin_px=(0.5, 0.0))},
        {"domain": "stabilised"},
        {"channels": ("R", "G")},
        {"type": "uint16"},
    ],
)
def test_a_plane_that_differs_in_more_than_its_samples_does_not_stand_in(change: dict) -> None:
    light = Plane(channels=("R", "G", "B"), domain="linear")
    planes = {"x": light, "y": light.model_copy(update=change)}
    assert known_stand_in(NET, planes) is None
    assert known_stand_in(NET, {"x": light, "y": light}) == "x"


def test_the_geometry_of_the_sensor_stands_for_that_of_an_ideal_camera() -> None:
    light = Plane(channels=("R", "G", "B"), domain="linear")
    straight = light.model_copy(update={"grid": Grid(warped=False)})
    assert known_stand_in(NET, {"x": light, "y": straight}) == "x"


def test_of_several_inputs_the_last_that_fits_stands_in() -> None:
    light, mask = (
        Plane(channels=("R", "G", "B"), domain="linear"),
        Plane(channels=("R", "G", "B"), domain="mask", type="bool"),
    )
    three = Network(takes=("a", "b", "m"), gives=("y",))
    planes = {"a": light, "b": light, "m": mask, "y": light}
    assert stand_in(three, planes) == "b"


def test_what_stands_in_for_a_row_of_stages_is_what_runs_before_them() -> None:
    ways = ways_of(STAGES, Work(method=DEVELOP, left_out=frozenset({"illumination", "undistort"})))
    assert stand_ins(STAGES, ways, _planes()) == {
        "restored": "rgb",
        "clean": "rgb",
        "even": "neutral",
        "straight": "neutral",
    }
    assert stand_ins(STAGES, ways_of(STAGES, Work()), _planes()) == {}


def test_a_stage_that_nothing_stands_for_cannot_be_left_out() -> None:
    stages = (Linearise(), Demosaic(takes=("light",)), RaiseClipped(takes=("rgb",)), Color())
    ways = (WHOLE, LEFT_OUT, WHOLE, WHOLE)
    with pytest.raises(ContractError, match="none of light stands for rgb"):
        stand_ins(stages, ways, _planes())
