"""Stages that do not join are refused naming both ends; what joins says what its planes are."""

from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from camkit.bundle.chain import CAPTURE, join_stages, rewired
from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.manifest import planes_of
from camkit.bundle.plane import Grid
from camkit.bundle.sensor import LightSensor, PlanesSensor, SpadSensor
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Illumination,
    Linearise,
    Network,
    Parts,
    RaiseClipped,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
    Wiener,
)
from camkit.errors import BundleError
from tests.bundle_factory import tiny_facts, tiny_manifest, tiny_optics, tiny_sensor, tiny_stages

PARTS = tiny_manifest().parts
FIRST = (Linearise(), Repair(), WhiteBalance(), Demosaic())
BANK = Wiener(prior_scale=1e-3, prior_exponent=2.0)


def facts(inputs: Sequence[int], outputs: Sequence[int] = (3,), scale: int = 1) -> NetworkFacts:
    ports = {
        "inputs": tuple(Port(name=f"in{i}", channels=c) for i, c in enumerate(inputs)),
        "outputs": tuple(
            Port(name=f"out{i}", channels=c, scale=scale) for i, c in enumerate(outputs)
        ),
    }
    return tiny_facts().model_copy(update=ports)


def parts(**networks: NetworkFacts) -> Parts:
    roles = {role: {"M": found} for role, found in networks.items()}
    return Parts(sensor=PARTS.sensor, optics=PARTS.optics, networks=roles)


def mono() -> PlanesSensor:
    fields = {name: getattr(tiny_sensor(), name) for name in LightSensor.model_fields}
    return PlanesSensor(**(fields | {"channels": ("Y",), "channel_response": None}))


REFUSED: dict[str, tuple[tuple[Stage, ...], Parts, str]] = {
    "a plane that nobody gives": (
        (Linearise(), Color(takes=("straight",))),
        PARTS,
        r"stage 2 \(color\) takes 'straight', which nothing before it gives; there are "
        r"'capture' of the sensor \(bayer\), 'light' of stage 1 \(linearise\), 'clipped' of",
    ),
    "a plane that comes later": (
        (Repair(), Linearise()),
        PARTS,
        r"stage 1 \(repair\) takes 'light', which nothing before it gives; there are 'capture'",
    ),
    "a plane given twice": (
        (Linearise(), Linearise()),
        PARTS,
        r"stage 2 \(linearise\) gives 'light', as does stage 1 \(linearise\)",
    ),
    "the capture given": (
        (Linearise(gives=("capture",)),),
        PARTS,
        r"gives 'capture', as does the sensor \(bayer\)",
    ),
    "a plane too few": (
        (*FIRST, BANK, RaiseClipped(takes=("restored",), gives=("one", "two"))),
        PARTS,
        r"makes 1 plane\(s\), it names 2",
    ),
    "digital numbers into a linear stage": (
        (Repair(takes=("capture",), gives=("sound",)),),
        PARTS,
        r"stage 1 \(repair\) does not join: it takes planes that are linear, not dn. 'capture' of "
        r"the sensor \(bayer\) is \(cfa\) dn uint16 over y x, pitch 1",
    ),
    "a missing demosaic: the bank": (
        (Linearise(), Repair(), WhiteBalance(), Wiener(**{**dict(BANK), "takes": ("balanced",)})),
        PARTS,
        r"stage 4 \(wiener\) does not join: it takes one plane for each of R, G, B, not cfa. "
        r"'balanced' of stage 3 \(white_balance\) is \(cfa\)",
    ),
    "a missing demosaic: the colour": (
        (Linearise(), Color(takes=("light",))),
        PARTS,
        "it must be demosaicked",
    ),
    "a missing demosaic: the geometry": (
        (Linearise(), Undistort(takes=("light",))),
        PARTS,
        "a mosaic cannot be moved",
    ),
    "a missing demosaic: the highlights": (
        (Linearise(), RaiseClipped(takes=("light",))),
        PARTS,
        "red, green and blue",
    ),
    "a demosaic twice": (
        (*FIRST, Demosaic(takes=("rgb",), gives=("again",))),
        PARTS,
        "it takes a mosaic",
    ),
    "a network that is not there": (
        (*FIRST, BANK, Network(role="sharpen")),
        PARTS,
        "no network of the role 'sharpen'",
    ),
    "a network without its planes": (
        (*FIRST, Network(takes=("rgb",))),
        PARTS,
        r"size M has inputs of 3 \+ 3 channels \(capture, wiener\); its planes have 3",
    ),
    "a network without any plane": ((Network(takes=()),), PARTS, "at least one plane"),
    "a network of other channels": (
        (*FIRST, Network(takes=("rgb",))),
        parts(restore=facts([4])),
        "has inputs of 4 channels",
    ),
    "sizes of different outputs": (
        (*FIRST, Network(takes=("rgb",))),
        Parts(
            sensor=PARTS.sensor,
            optics=PARTS.optics,
            networks={"restore": {"S": facts([3]), "M": facts([3], scale=2)}},
        ),
        "its sizes differ in their outputs",
    ),
    "a mosaic stabilised": (
        (Linearise(), Network(takes=("light",))),
        parts(restore=facts([1], [1])),
        "by the noise of R, G, B",
    ),
    "features stabilised": (
        (*FIRST, Network(takes=("rgb",))),
        parts(restore=facts([3], [8])),
        "by the noise of R, G, B, one of each; a plane has 8",
    ),
    "planes of two grids": (
        (
            *FIRST,
            Network(takes=("rgb",), gives=("fine",)),
            Network(role="both", takes=("rgb", "fine")),
        ),
        parts(restore=facts([3], scale=2), both=facts([3, 3])),
        "must lie on one grid",
    ),
    "a bank on finer planes": (
        (
            *FIRST,
            Network(takes=("rgb",), gives=("fine",)),
            Wiener(**{**dict(BANK), "takes": ("fine",)}),
        ),
        parts(restore=facts([3], scale=2)),
        "its kernels are sampled at 6 um, its planes at 3 um",
    ),
    "a mask of another grid": (
        (
            *FIRST,
            Network(takes=("rgb",), gives=("fine",)),
            Wiener(**{**dict(BANK), "takes": ("fine", "unknown")}),
        ),
        parts(restore=facts([3], scale=2)),
        "its mask must lie on the samples",
    ),
    "a bank after undistortion": (
        (*FIRST, Undistort(takes=("rgb",)), Wiener(**{**dict(BANK), "takes": ("straight",)})),
        PARTS,
        "before any undistortion",
    ),
    "undistortion twice": (
        (*FIRST, Undistort(takes=("rgb",)), Undistort(takes=("straight",), gives=("more",))),
        PARTS,
        "this plane is undistorted",
    ),
    "illumination after undistortion": (
        (*FIRST, Undistort(takes=("rgb",)), Illumination(takes=("straight",))),
        PARTS,
        "before any undistortion",
    ),
    "undistortion of other channels": (
        (*FIRST, Network(takes=("rgb",), transform="none"), Undistort(takes=("clean",))),
        parts(restore=facts([3], [4])),
        "the distortion is known for R, G, B, not for out00, out01",
    ),
    "a mask that is none": (
        (Linearise(), Repair(takes=("light", "light"))),
        PARTS,
        "it takes planes that are mask, not linear",
    ),
    "a mask for nothing": (
        (Linearise(), Repair(takes=("light",))),
        PARTS,
        "gives a mask only where it takes one",
    ),
    "a bank without optics": (
        (*FIRST, BANK),
        Parts(sensor=PARTS.sensor, optics=None, networks={}),
        "the bundle states no optics",
    ),
    "levels of counts": (
        (Linearise(),),
        Parts(sensor=SpadSensor(), optics=None, networks={}),
        "it takes planes that are dn, not counts",
    ),
    "white balance of grey": (
        (Linearise(), WhiteBalance(takes=("light",))),
        Parts(sensor=mono(), optics=None, networks={}),
        "it balances red, green and blue",
    ),
    "colour of two channels": (
        (*FIRST, Network(takes=("rgb",), transform="none"), Color(takes=("clean",))),
        parts(restore=facts([3], [2])),
        "one channel or three, not 2",
    ),
    "too many planes": ((Linearise(takes=("capture", "capture")),), PARTS, "1 plane.s., not 2"),
}


@pytest.mark.parametrize(("stages", "given", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_stages_that_do_not_join_are_refused_naming_both_ends(
    stages: tuple[Stage, ...], given: Parts, message: str
) -> None:
    with pytest.raises(BundleError, match=message):
        planes_of(stages, given)


def test_planes_say_what_runs_between_the_stages() -> None:
    planes = join_stages(tiny_stages(), PARTS)
    assert (planes["light"].channels, planes["light"].domain) == (("cfa",), "linear")
    assert (planes["clipped"].domain, planes["clipped"].type) == ("mask", "bool")
    assert planes["rgb"].channels == planes["clean"].channels == ("R", "G", "B")
    assert planes["even"].grid.warped
    assert not planes["straight"].grid.warped
    assert planes["picture"].domain == "output"
    assert CAPTURE not in planes


def test_two_networks_in_a_row_lead_to_a_grey_picture_of_twice_the_size() -> None:
    stages: tuple[Stage, ...] = (
        Linearise(),
        Repair(),
        Network(role="denoise", takes=("sound",), gives=("quiet",)),
        Network(role="upscale", takes=("quiet",), gives=("fine",)),
        Color(takes=("fine",)),
    )
    networks = {"denoise": {"M": facts([1], [1])}, "upscale": {"M": facts([1], [1], scale=2)}}
    planes = join_stages(stages, Parts(sensor=mono(), optics=None, networks=networks))
    assert planes["quiet"] == planes["sound"]
    assert planes["fine"].channels == ("Y",)
    assert planes["fine"].grid == Grid(pitch_ratio=0.5, origin_px=(-0.25, -0.25))
    assert planes["picture"].channels == ("R", "G", "B")
    assert planes["picture"].grid == planes["fine"].grid


@given(scale=st.integers(1, 16))
def test_a_finer_grid_has_the_same_middle(scale: int) -> None:
    grid = Grid(pitch_ratio=2.0, origin_px=(3.0, -1.0))
    fine = grid.finer(scale)
    assert fine.pitch_ratio * scale == pytest.approx(2.0)
    middle = fine.origin_px[0] + (scale - 1) / 2 * fine.pitch_ratio
    assert middle == pytest.approx(3.0)


def test_outputs_of_a_network_are_float_whatever_it_takes() -> None:
    stages = (Network(takes=("capture",), transform="none"),)
    planes = join_stages(stages, parts(restore=facts([1], [5])))
    assert planes["clean"].type == "float32"
    assert planes["clean"].channels == ("out00", "out01", "out02", "out03", "out04")


@settings(max_examples=200, deadline=None)
@given(
    left_out=st.sets(
        st.sampled_from(["repair", "white_balance", "wiener", "network", "raise_clipped"])
        | st.sampled_from(["illumination", "undistort"])
    )
)
def test_usual_stages_join_whichever_are_left_out(left_out: set[str]) -> None:
    if "wiener" in left_out:
        left_out.add("network")
    networks = {} if "network" in left_out else {"restore": {"M": tiny_facts()}}
    manifest = tiny_manifest(stages=tiny_stages(*left_out), networks=networks)
    kept = [stage.type for stage in tiny_stages() if stage.type not in left_out]
    assert [stage.type for stage in manifest.stages] == kept


def test_what_stands_in_for_a_missing_network_is_what_the_bank_gives() -> None:
    stages = tiny_stages("network", "raise_clipped")
    assert next(s for s in stages if s.type == "illumination").takes == ("restored",)
    without = tiny_stages("wiener", "network")
    assert next(s for s in without if s.type == "raise_clipped").takes == ("rgb",)
    assert rewired(tiny_stages(), tiny_stages()) == tiny_stages()


# ---------------------------------------------------------------------------- the manifest


def _refuse(message: str, **changes: Any) -> None:
    with pytest.raises((ValidationError, BundleError), match=message):
        tiny_manifest(**changes)


def test_planes_stated_wrongly_are_refused() -> None:
    planes = dict(tiny_manifest().planes)
    wrong = planes["rgb"].model_copy(update={"channels": ("B", "G", "R")})
    _refuse(
        "'rgb' is stated as .B, G, R. .*; its stage gives .R, G, B.", planes=planes | {"rgb": wrong}
    )
    fine = planes["picture"].model_copy(update={"grid": Grid(pitch_ratio=0.5, warped=False)})
    _refuse("pitch 0.5.*pitch 1", planes=planes | {"picture": fine})
    _refuse("no stage gives the plane 'more'", planes=planes | {"more": wrong})
    del planes["rgb"]
    _refuse("the plane 'rgb' is not stated", planes=planes)


def test_products_that_no_stage_gives_are_refused() -> None:
    _refuse("'depth' is the plane 'far', which no stage gives", products={"depth": "far"})
    _refuse("which no stage gives", products={"image": CAPTURE})
    _refuse("at least one product", products={})


def test_idle_stages_and_roles_are_refused() -> None:
    _refuse(r"stage 10 \(color\) gives picture, which no stage takes", products={"image": "even"})
    idle = (*tiny_stages(), Demosaic(gives=("more",)))
    _refuse(r"stage 11 \(demosaic\) gives more", stages=idle, products={"image": "picture"})
    _refuse(
        "no stage uses the networks of the role again",
        networks={"restore": {"M": tiny_facts()}, "again": {"M": tiny_facts()}},
    )
    _refuse("role restore", stages=tiny_stages("network"))


def test_camera_without_optics_and_size_is_admitted() -> None:
    stages: tuple[Stage, ...] = (Linearise(), Color(takes=("light",)))
    sensor = mono().model_copy(update={"extent": None})
    manifest = tiny_manifest(stages=stages, sensor=sensor, optics=None, networks={})
    assert manifest.products == {"image": "picture"}
    assert manifest.optics is None
    assert tiny_optics().symmetry == "radial"
