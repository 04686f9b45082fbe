"""Contracts name every fault at once."""

from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.export.foreign.contract import Affine, read_contract, to_contract

PLAIN = {"input": {"planes": "rgb", "space": "srgb"}}


def test_the_least_contract_states_planes_and_space() -> None:
    contract = to_contract(PLAIN)
    assert (contract.planes, contract.space, contract.output_space) == ("rgb", "srgb", "srgb")
    assert contract.numbers == contract.output_numbers == Affine()
    assert (contract.residual, contract.mode, contract.channels) == ("none", "refuse", 3)


def test_all_faults_are_named_at_once() -> None:
    tables = {
        "input": {"planes": "bayer", "space": "gamma", "range": [0], "gain": -1, "colour": 3},
        "output": {"residual": "maybe", "scale": 2.5},
        "global": {"mode": "local:9"},
        "extra": {},
    }
    with pytest.raises(ContractError) as caught:
        to_contract(tables)
    text = str(caught.value)
    assert text.startswith("9 fault(s) in the contract: ")
    for part in (
        *("input.planes is 'bayer'", "input.space is 'gamma'", "input.range is [0]"),
        *("input.gain is -1", "input.colour is not known", "output.residual is 'maybe'"),
        *("output.scale is 2.5", "global.mode is 'local:9'", "extra is no table"),
    ):
        assert part in text


def test_what_is_missing_is_named() -> None:
    with pytest.raises(ContractError, match=r"2 fault.*input.planes is missing.*input.space is"):
        to_contract({})


def test_mean_and_deviation_are_those_of_torchvision() -> None:
    numbers = {"mean": [0.5, 0.4, 0.3], "std": [0.25, 0.5, 0.1]}
    contract = to_contract({"input": {"planes": "rgb", "space": "srgb", **numbers}})
    gain, offset = contract.numbers.gain, contract.numbers.offset
    for light in (0.0, 1.0):
        made = [g * light + o for g, o in zip(gain, offset, strict=True)]
        expected = [(light - m) / s for m, s in zip(*numbers.values(), strict=True)]
        assert made == pytest.approx(expected)
    assert contract.output_numbers == contract.numbers


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"planes": "packed", "space": "srgb"}, 'a mosaic is "camera-linear"'),
        ({"planes": "packed", "space": "stabilised"}, "rgb and rgb\\+restored alone"),
        ({"planes": "rgb", "space": "srgb", "order": ["R", "G1", "G2", "B"]}, "packed"),
        ({"planes": "rgb", "space": "stabilised", "range": [0, 255]}, "no input.range"),
        ({"planes": "rgb", "space": "srgb", "range": [1, 1]}, "empty"),
        ({"planes": "rgb", "space": "srgb", "range": [0, 1], "std": 2}, "exclude each other"),
        (
            {"planes": "packed", "space": "camera-linear", "order": ["R", "G", "G", "B"]},
            "R, G1, G2, B in any order",
        ),
    ],
)
def test_values_that_do_not_go_together_are_refused(given: dict[str, object], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        to_contract({"input": given})


def test_pairs_lie_beside_the_contract(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text('[input]\nplanes="rgb"\nspace="srgb"\n[proof]\npairs="io.npz"\nspace="srgb"\n')
    contract = read_contract(path)
    assert (contract.pairs, contract.pairs_space) == (tmp_path / "io.npz", "srgb")
    path.write_text("[input\n")
    with pytest.raises(ContractError, match="no TOML"):
        read_contract(path)
