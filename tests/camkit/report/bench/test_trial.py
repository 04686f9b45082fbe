"""Trials: what they are called, what they ask of the pipeline, and how axes are spread out."""

from typing import Any

import pytest

from camkit.errors import ContractError
from camkit.report.bench.trial import Axes, Vary, spread_out
from camkit.runtime.options import Options
from tests.bench_factory import make_trial


@pytest.mark.parametrize(
    ("changes", "label"),
    [
        ({}, "M"),
        ({"mode": "fast"}, "M fast"),
        ({"dtype": "fp16", "provider": "cuda"}, "M fp16 cuda"),
        ({"threads": 1}, "M 1 thread"),
        ({"threads": 4, "tile_px": 512}, "M tile 512 4 threads"),
        ({"bundle": "trimmed"}, "trimmed M"),
        ({"size": None, "mode": None, "dtype": None, "provider": None, "method": "rl"}, "rl"),
        ({"extra": (("bins", 64),)}, "M bins 64"),
    ],
)
def test_labels_name_what_is_not_plain(changes: dict[str, Any], label: str) -> None:
    trial = make_trial(**changes)
    assert trial.label == label
    assert trial.is_variant is (len(label.removeprefix("trimmed ").split()) > 1)


def test_options_of_a_trial_are_options_of_the_pipeline() -> None:
    given = make_trial(mode="whole", max_mem_bytes=10**9, tile_px=64).options()
    chosen = Options(**given)
    assert (chosen.size, chosen.mode, chosen.method, chosen.tile_px) == ("M", "whole", "net", 64)
    assert chosen.max_mem_bytes == 10**9
    develop = make_trial(path=None, size=None, mode=None, dtype=None, provider=None)
    assert develop.options() == {"threads": 2}


def test_threads_and_tiles_do_not_decide_accuracy_and_the_rest_does() -> None:
    key = make_trial().accuracy_key
    assert make_trial(threads=1, tile_px=64).accuracy_key == key
    for change in ({"mode": "fast"}, {"dtype": "fp16"}, {"size": "S"}, {"bundle": "other"}):
        assert make_trial(**change).accuracy_key != key


def test_axes_asked_for_are_multiplied_and_others_varied_one_at_a_time() -> None:
    axes = [
        Vary("mode", ("exact", "fast"), is_requested=True),
        Vary("threads", (2, 1), is_requested=True),
        Vary("dtype", ("fp32", "fp16"), is_requested=False),
    ]
    labels = [trial.label for trial in spread_out(make_trial(), axes, vary=True)]
    assert labels == ["M", "M 1 thread", "M fast", "M fast 1 thread", "M fp16"]
    assert len(list(spread_out(make_trial(), axes, vary=False))) == 4


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("modes", ("slow",)),
        ("dtypes", ("int8",)),
        ("providers", ("abacus",)),
        ("threads", (0,)),
        ("tiles_px", (-1,)),
    ],
)
def test_unknown_values_of_an_axis_are_refused(field: str, value: tuple[object, ...]) -> None:
    with pytest.raises(ContractError, match=field):
        Axes(**{field: value})  # type: ignore[arg-type]
