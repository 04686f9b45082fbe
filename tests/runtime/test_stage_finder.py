"""The work of a stage is found by its name; every stage defines what the walker asks."""

import inspect
from pathlib import Path

import pytest

from camkit.bundle import stages as entries
from camkit.bundle.stages import Linearise, Network, Wiener
from camkit.bundle.stages.register import BUILT_IN, type_of
from camkit.errors import UnsupportedError
from camkit.runtime import stages
from camkit.runtime.options import Options
from camkit.runtime.stage_finder import methods_of, stage_keys, stage_module
from tests.bundle_factory import tiny_stages

TYPES = sorted(type_of(entry) for entry in BUILT_IN)
OF_PHOTONS = {"correct", "super_resolve", "sharpen", "lifetime"}
"""Stages of which no plan estimates the seconds."""


@pytest.mark.parametrize("name", TYPES)
def test_every_stage_that_a_bundle_may_list_has_a_module_that_says_all(name: str) -> None:
    module = stage_module(name)
    wanted = {"prepare": "entry job", "seconds": "entry subject work speed"}
    if name in OF_PHOTONS:
        del wanted["seconds"]
    for function, named in wanted.items():
        takes = inspect.signature(getattr(module, function)).parameters
        assert [name.lstrip("_") for name in takes] == named.split()
    assert isinstance(module.METHODS, tuple)
    assert set(module.OPTIONS) <= set(Options.__dataclass_fields__)
    if test := getattr(module, "is_left_out", None):
        assert test(Options()) is False


def test_there_are_no_modules_that_no_bundle_can_list() -> None:
    runtime = Path(stages.__path__[0]).parent
    rooms = [runtime / "stages", *runtime.glob("kinds/*/stages")]
    there = {path.stem for room in rooms for path in room.glob("*.py")} - {"__init__"}
    assert there == set(TYPES)
    assert set(entries.__all__) >= {entry.__name__ for entry in BUILT_IN}


def test_no_two_stages_have_a_method_of_one_name_and_few_options_are_shared() -> None:
    options = {"demosaic", "depth_m", "iso", "noise", "size"}
    for what, shared in (("METHODS", set()), ("OPTIONS", options)):
        types = [name for name in TYPES if what == "OPTIONS" or name not in OF_PHOTONS]
        named = [name for type_ in types for name in getattr(stage_module(type_), what)]
        assert {name for name in named if named.count(name) > 1} == shared, what


def test_a_stage_without_a_module_is_refused_with_those_there_are() -> None:
    with pytest.raises(
        UnsupportedError, match=r"brings the stage 'dream'; there are: color, correct, deglare"
    ):
        stage_module("dream")


def test_stages_are_named_by_type_and_twins_by_role_or_number() -> None:
    bank = Wiener(prior_scale=1e-3, prior_exponent=2.0)
    split, fuse = Network(role="split"), Network(role="fuse")
    assert stage_keys(tiny_stages()) == tuple(stage.type for stage in tiny_stages())
    assert stage_keys([bank, Linearise(), bank]) == ("wiener 1", "linearise", "wiener 2")
    assert stage_keys([split, fuse]) == ("network split", "network fuse")
    again = stage_keys([split, fuse, split])
    assert again == ("network 1", "network fuse", "network 3")
    assert len(set(again)) == 3


def test_methods_of_the_last_stage_come_first_and_each_once() -> None:
    assert methods_of(tiny_stages()) == ("net", "wiener", "rl", "admm-tv")
    assert methods_of(tiny_stages()[::-1]) == ("wiener", "rl", "admm-tv", "net")
    assert methods_of((*tiny_stages(), *tiny_stages())) == methods_of(tiny_stages())
    assert methods_of(tiny_stages("wiener", "network")) == ()
