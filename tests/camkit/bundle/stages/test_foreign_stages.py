"""Packed planes and coded networks join, or say why not; both need format 2.11."""

from typing import Any

import pytest
from pydantic import ValidationError

from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.manifest import format_of
from camkit.bundle.plane import Grid, Plane
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages import JoinError, Network, Pack, Parts, Unpack
from camkit.bundle.stages.foreign.coding import Coding
from camkit.bundle.stages.foreign.pack import CELL_GRID
from tests.bundle_factory import tiny_facts, tiny_sensor

LINEAR = Plane(channels=RGB, domain="linear")
MOSAICKED = Plane(channels=MOSAIC, domain="linear")


def _parts(inputs: tuple[int, ...] = (3,), outputs: int = 3, scale: int = 1) -> Parts:
    facts = NetworkFacts.model_validate(
        {
            **tiny_facts().model_dump(),
            "inputs": [Port(name=f"p{i}", channels=n) for i, n in enumerate(inputs)],
            "outputs": [Port(name="clean", channels=outputs, scale=scale)],
        }
    )
    return Parts(sensor=tiny_sensor(), optics=None, networks={"restore": {"M": facts}})


def _coded(space: str = "srgb", **numbers: Any) -> Network:
    coding = Coding(**({"output": space} | numbers))
    return Network(takes=("rgb",), transform=space, coding=coding)  # type: ignore[arg-type]


def test_cells_have_twice_the_pitch_and_a_picture_of_them_has_that_of_the_sensor() -> None:
    (packed,) = Pack(order=("R", "G1", "B", "G2")).join([MOSAICKED], _parts())
    assert (packed.channels, packed.grid) == (("R", "G1", "B", "G2"), CELL_GRID)
    (clean,) = _coded("camera").join([packed], _parts(inputs=(4,), scale=2))
    assert (clean.channels, clean.grid) == (RGB, Grid())
    assert Unpack().join([clean], _parts()) == (clean,)
    assert Unpack().join([packed], _parts()) == (MOSAICKED,)


@pytest.mark.parametrize(
    ("stage", "plane", "parts", "message"),
    [
        (Pack(), LINEAR, _parts(), "takes a mosaic"),
        (Unpack(), LINEAR.model_copy(update={"grid": CELL_GRID}), _parts(), "R, G1, G2 and B"),
        (_coded(), MOSAICKED.model_copy(update={"channels": ("a", "b", "c")}), _parts(), "a, b, c"),
        (_coded(gain=(1.0, 2.0)), LINEAR, _parts(), "do not go with 3 channels"),
        (_coded(noise=True), LINEAR, _parts(), "inputs of 3 channels"),
        (_coded(), LINEAR, _parts(outputs=4), "red, green and blue; it gives 4"),
        (_coded(), LINEAR.model_copy(update={"domain": "dn"}), _parts(), "linear, not dn"),
    ],
)
def test_what_does_not_join_is_refused(
    stage: Any, plane: Plane, parts: Parts, message: str
) -> None:
    with pytest.raises(JoinError, match=message):
        stage.join([plane], parts)


@pytest.mark.parametrize(
    "fields",
    [
        {"transform": "srgb"},
        {"transform": "none", "coding": Coding(output="srgb")},
        {"transform": "srgb", "coding": {"output": "srgb", "gain": (0.0,)}},
        {"transform": "srgb", "coding": {"output": "gamma"}},
    ],
)
def test_a_coding_and_its_transform_go_together(fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Network.model_validate(fields)
    with pytest.raises(ValidationError, match="R, G1, G2 and B once"):
        Pack(order=("R", "R", "G1", "B"))


def test_bundles_state_the_format_that_such_stages_need() -> None:
    assert format_of(None, [Network()]) == "2.4"
    for stage in (_coded(), Pack(), Unpack()):
        assert format_of(None, [stage]) == "2.11"
