"""What means nothing to a camera is refused by name, not ignored."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Color, Linearise, Repair
from camkit.bundle.writer import write_bundle
from camkit.caller import option_text, speaking
from camkit.errors import ContractError
from camkit.runtime.job.choices import check_choices, check_idle
from camkit.runtime.options import Options
from camkit.runtime.signal.tone_curve import Tone
from camkit.runtime.unit import Unit
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_stages, write_tiny_bundle
from tests.deep_bundle import write_deep_bundle
from tests.planes_bundle import planes_sensor, write_planes_bundle
from tests.states_bundle import two_states, write_states_bundle

CHANGED: dict[str, Any] = {
    "size": "M",
    "quality": "draft",
    "scale": "1/2",
    "max_seconds": 1.0,
    "max_error_db": 0.1,
    "depth_m": float("inf"),
    "method": "develop",
    "mode": "whole",
    "demosaic": "fast",
    "color": "camera",
    "white_balance": (2.0, 1.0, 2.0),
    "exposure_ev": 1.0,
    "vignetting": False,
    "undistort": False,
    "assume": "centre",
    "force_bundle": True,
    "origin_px": (2, 4),
    "on_unsafe": "fallback",
    "laws": "enforce",
    "strength": 0.5,
    "max_mem_bytes": 500_000_000,
    "threads": 1,
    "tile_px": 32,
    "dtype": "fp16",
    "provider": "cuda",
    "noise": (1e-5, 1e-9),
    "iso": 400.0,
    "tone": Tone(name="srgb"),
    "halves": ("_l", "_r"),
    "unit": None,
    "configuration": "wide",
}
"""Every option away from its default; a unit is tested by itself."""
FREE = {"max_mem_bytes", "threads", "method"}
OF_FILES = {"tone", "halves"}
"""Options that may be said of any photograph's file."""
OF_STAGE = {
    "network": {
        *("size", "quality", "max_seconds", "max_error_db", "mode", "on_unsafe", "tile_px"),
        *("dtype", "provider", "laws", "strength", "noise", "iso"),
    },
    "wiener": {"depth_m", "noise", "iso"},
    "demosaic": {"demosaic", "scale"},
    "white_balance": {"white_balance"},
    "color": {"color", "exposure_ev"},
    "illumination": {"vignetting"},
    "undistort": {"undistort"},
}


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return open_bundle(write_tiny_bundle(tmp_path_factory.mktemp("bundle")))


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Give a camera that takes pictures of any size and does nothing but repair them."""
    stages = (Linearise(gives=("light",)), Repair(takes=("light",), gives=("sound",)))
    folder = tmp_path_factory.mktemp("bare")
    return write_planes_bundle(folder, stages, sensor=planes_sensor(size_px=None))


def _refused(bundle: Bundle | None, **choices: Any) -> str:
    with pytest.raises(ContractError) as caught:
        check_choices(bundle, Options(**choices))
    return str(caught.value)


def test_every_option_is_in_the_list_of_this_test() -> None:
    # those that kinds bring are tested with a kind that brings some (test_maker.py)
    assert set(CHANGED) == {field.name for field in dataclasses.fields(Options)} - {"of_kind"}
    claimed = set.union(*OF_STAGE.values())
    others = {"assume", "force_bundle", "origin_px", "unit", "configuration"}
    assert set(CHANGED) == claimed | FREE | OF_FILES | others


@pytest.mark.parametrize("name", CHANGED)
def test_a_camera_of_every_stage_knows_every_option(
    tiny: Bundle, tmp_path: Path, name: str
) -> None:
    bundle = write_states_bundle(tmp_path) if name == "configuration" else tiny
    check_choices(bundle, Options(**{name: CHANGED[name]}))


@pytest.mark.parametrize("name", sorted(set(CHANGED) - {"unit"}))
def test_each_option_that_means_nothing_is_refused_by_name(bare: Bundle, name: str) -> None:
    if name in FREE | OF_FILES | {"force_bundle"}:
        check_choices(bare, Options(**{name: CHANGED[name]}))
        return
    said = _refused(bare, **{name: CHANGED[name]})
    assert said.startswith(f"{option_text(name)} does not apply to bundle planes")


@pytest.mark.parametrize("name", sorted(set(CHANGED) - {"unit"}))
def test_each_option_that_means_nothing_without_a_bundle_is_refused_by_name(name: str) -> None:
    if name in FREE | OF_FILES | {"color", "exposure_ev", "white_balance", "demosaic", "scale"}:
        check_choices(None, Options(**{name: CHANGED[name]}))
        return
    said = _refused(None, **{name: CHANGED[name]})
    assert said.startswith(f"{option_text(name)} does not apply without a bundle")


@pytest.mark.parametrize(
    "left_out",
    [
        *(["network"], ["wiener", "network"], ["white_balance"], ["color"], ["illumination"]),
        ["undistort"],
    ],
    ids="+".join,
)
def test_a_camera_without_a_stage_refuses_its_options_and_no_other(
    left_out: list[str], tmp_path: Path
) -> None:
    members = tiny_members() | two_states().members
    changes: dict[str, Any] = {"optics": two_states().entry(np.inf), "format_version": "2.12"}
    if "network" in left_out:
        del members["network_m.onnx"]
        changes["networks"] = {}
    path = tmp_path / "less.camkit"
    write_bundle(path, tiny_manifest(stages=tiny_stages(*left_out), **changes), members)
    bundle = open_bundle(path)
    foreign = set.union(*(OF_STAGE[stage] for stage in left_out))
    foreign -= set.union(*(OF_STAGE[stage] for stage in OF_STAGE.keys() - left_out))
    for name, value in CHANGED.items():
        if name in foreign:
            assert option_text(name) in _refused(bundle, **{name: value})
        else:
            check_choices(bundle, Options(**{name: value}))


def test_all_foreign_options_are_named_at_once(bare: Bundle) -> None:
    said = _refused(bare, size="M", demosaic="fast", depth_m=1.0)
    assert said.startswith("size, depth_m, demosaic does not apply")


def test_a_method_that_no_stage_has_is_refused_with_those_there_are(
    tiny: Bundle, bare: Bundle
) -> None:
    for method in ("net", "wiener", "rl", "admm-tv", "develop"):
        check_choices(tiny, Options(method=method))
    assert "net, wiener, rl, admm-tv, develop to bundle tiny; got 'magic'" in _refused(
        tiny, method="magic"
    )
    assert "method must be one of develop to bundle planes; got 'wiener'" in _refused(
        bare, method="wiener"
    )
    check_choices(None, Options(method="develop"))
    assert "one of develop without a bundle; got 'net'" in _refused(None, method="net")


def test_methods_of_stages_that_the_bundle_leaves_out_are_refused(tmp_path: Path) -> None:
    members = tiny_members()
    del members["network_m.onnx"]
    path = tmp_path / "bank.camkit"
    write_bundle(path, tiny_manifest(stages=tiny_stages("network"), networks={}), members)
    assert "one of wiener, rl, admm-tv, develop" in _refused(open_bundle(path), method="net")


def test_a_place_may_be_assumed_only_on_a_sensor_of_known_size(tiny: Bundle, bare: Bundle) -> None:
    check_choices(tiny, Options(assume="scale"))
    assert "assume does not apply" in _refused(bare, assume="scale")


def test_a_unit_of_another_bundle_or_of_none_is_refused(tiny: Bundle) -> None:
    own = Unit(name="body 1", bundle_sha256=tiny.sha256)
    check_choices(tiny, Options(unit=own))
    other = dataclasses.replace(own, bundle_sha256="0" * 64)
    assert "measured with the bundle" in _refused(tiny, unit=other)
    assert "there is none" in _refused(None, unit=own)


def test_a_depth_that_the_psf_does_not_reach_is_refused(tiny: Bundle, tmp_path: Path) -> None:
    deep = write_deep_bundle(tmp_path)
    check_choices(deep, Options(depth_m=0.7))
    check_choices(tiny, Options(depth_m=np.inf))
    assert "0.5 m to 2 m" in _refused(deep, depth_m=3.0)
    assert "the one depth infinity; got 3 m" in _refused(tiny, depth_m=3.0)


def test_flags_are_those_of_the_command() -> None:
    """A message must name what a person can type."""
    import inspect

    from camkit.cli.use.process import process

    parameters = inspect.signature(process).parameters
    typed = {"--" + name.rstrip("_").replace("_", "-") for name in parameters}
    typed |= {flag.replace("--", "--no-", 1) for flag in typed}
    for_programs = {"tile_px"}
    with speaking("command"):
        assert {name for name in CHANGED if option_text(name) not in typed} <= for_programs


def test_no_color_means_no_option_of_color(tmp_path: Path) -> None:
    stages = (Linearise(gives=("light",)), Color(takes=("light",)))
    camera = write_planes_bundle(tmp_path, stages, sensor=planes_sensor())
    check_choices(camera, Options(exposure_ev=1.0, color="acescg"))
    assert "white_balance does not apply" in _refused(camera, white_balance=(2.0, 1.0, 2.0))


def test_a_size_that_is_not_there_is_refused_even_where_no_network_runs(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match=r"holds size.*asked for Q"):
        check_choices(bundle, Options(method="wiener", size="Q"))


@pytest.mark.parametrize(
    ("method", "option", "value"),
    [("wiener", "size", "M"), ("develop", "mode", "fast"), ("wiener", "on_unsafe", "fail")],
)
def test_an_option_of_a_stage_that_the_method_leaves_out_is_refused(
    bundle: Bundle, method: str, option: str, value: str
) -> None:
    options = Options(method=method, **{option: value})  # type: ignore[arg-type]
    check_choices(bundle, options)
    with pytest.raises(ContractError, match=f"{option} does not apply with method="):
        check_idle(bundle, options)
    check_idle(bundle, Options(**{option: value}))  # type: ignore[arg-type]
    check_idle(None, Options(method="develop"))
