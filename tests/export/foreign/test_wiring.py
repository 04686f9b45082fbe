"""A network of every contract finds its place among the stages of a camera."""

from pathlib import Path
from typing import Any

import onnx
import pytest
from torch import nn

from camkit.bundle.reader import open_bundle
from camkit.bundle.stages import Network
from camkit.errors import ContractError
from camkit.export.foreign.adding import bundle_with_network
from camkit.export.foreign.contract import to_contract
from camkit.export.foreign.onnx_file import foreign_model
from camkit.export.foreign.wiring import stages_of
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work
from tests.bundle_factory import tiny_manifest, write_tiny_bundle
from tests.foreign_networks import exported, seeded

FRONT = ["linearise", "repair", "white_balance"]
TAIL = ["raise_clipped", "illumination", "undistort", "color"]
LINEAR = "camera-linear"


class _Plain(nn.Sequential):
    def __init__(self, inputs: int = 3, outputs: int = 3) -> None:
        super().__init__(
            nn.Conv2d(inputs, 8, 3, padding=1), nn.ReLU(), nn.Conv2d(8, outputs, 3, padding=1)
        )


@pytest.mark.parametrize(
    ("planes", "outputs", "between"),
    [
        ("rgb", 3, ["demosaic", "network"]),
        ("rgb+restored", 3, ["demosaic", "wiener", "network"]),
        ("mosaic", 3, ["network"]),
        ("mosaic", 1, ["network", "demosaic", "wiener"]),
        ("packed", 3, ["pack", "network", "unpack"]),
        ("packed", 4, ["pack", "network", "unpack", "demosaic", "wiener"]),
    ],
)
def test_stages_follow_from_the_contract(planes: str, outputs: int, between: list[str]) -> None:
    contract = to_contract({"input": {"planes": planes, "space": LINEAR}})
    stages = stages_of(contract, tiny_manifest(), outputs)
    assert [stage.type for stage in stages] == [*FRONT, *between, *TAIL]


@pytest.mark.parametrize(
    ("given", "channels", "outputs"),
    [
        ({"planes": "rgb+restored", "space": "rec709-linear", "gain": 4}, 6, 3),
        ({"planes": "rgb+restored", "space": "stabilised"}, 6, 3),
        ({"planes": "mosaic", "space": LINEAR, "range": [0, 255]}, 1, 3),
        ({"planes": "mosaic", "space": LINEAR, "noise": "map"}, 2, 1),
        ({"planes": "packed", "space": LINEAR, "noise": "map"}, 5, 4),
    ],
)
def test_networks_of_other_planes_are_proved(
    tmp_path: Path, given: dict[str, Any], channels: int, outputs: int
) -> None:
    camera = open_bundle(write_tiny_bundle(tmp_path))
    data = exported(
        seeded(_Plain, inputs=channels, outputs=outputs), "legacy", channels=channels, opset=17
    )
    contract = to_contract({"input": given})
    out = tmp_path / "mine.camkit"
    bundle_with_network(foreign_model(onnx.load_from_string(data)), contract, camera, out)
    bundle = open_bundle(out)
    assert check_bundle(out, run=case_work, left_out=("laws",)).passed
    (stage,) = bundle.manifest.stages_of(Network)
    coded = given["space"] != "stabilised"
    assert (stage.coding is not None) == coded
    assert bundle.manifest.format_version == ("2.11" if coded else "2.8")


def test_a_camera_that_lacks_what_is_asked_for_is_refused() -> None:
    from tests.bundle_factory import tiny_stages

    bare = tiny_manifest(stages=tiny_stages("wiener", "network"), networks={})
    with pytest.raises(ContractError, match="needs a camera with a filter; tiny has none"):
        stages_of(to_contract({"input": {"planes": "rgb+restored", "space": LINEAR}}), bare, 3)
    stages = stages_of(to_contract({"input": {"planes": "rgb", "space": LINEAR}}), bare, 3)
    assert [stage.type for stage in stages] == [*FRONT, "demosaic", "network", *TAIL]
