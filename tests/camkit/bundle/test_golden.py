"""Golden cases survive the file; cases that contradict themselves are refused."""

from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load, save

from camkit.bundle.golden import GoldenArrays, golden_from_bytes, golden_to_bytes
from camkit.errors import BundleError, ContractError
from tests.bundle_factory import tiny_golden

PLANES = np.zeros((3, 4, 6), np.float32)
MOSAIC = np.zeros((4, 6), np.uint16)


def test_cases_come_back_bit_for_bit() -> None:
    rng = np.random.default_rng(0)
    linear = GoldenArrays(
        capture=rng.random((3, 5, 7), dtype=np.float32),
        reference=rng.random((3, 5, 7), dtype=np.float32),
        outputs={"S": rng.random((3, 5, 7), dtype=np.float32)},
    )
    cases = tiny_golden() | {"dark": linear}
    data = golden_to_bytes(cases)
    back = golden_from_bytes(data)
    assert back.keys() == cases.keys()
    np.testing.assert_array_equal(back["dark"].outputs["S"], linear.outputs["S"])
    np.testing.assert_array_equal(
        back["typical"].network_outputs["M"], cases["typical"].network_outputs["M"]
    )
    assert back["dark"].network_input is None
    assert golden_to_bytes(back) == data


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"capture": MOSAIC.astype(np.int32)}, "capture must be"),
        ({"capture": np.zeros((4, 4, 6), np.float32)}, "capture must be"),
        ({"capture": np.zeros((193, 6), np.uint16)}, "192 px"),
        ({"reference": PLANES[:, :2]}, "of the capture's"),
        ({"reference": np.full_like(PLANES, np.nan)}, "finite"),
        ({"outputs": {"M": PLANES[:2]}}, "of the capture's"),
        ({"network_outputs": {"M": PLANES}}, "need the network input"),
        ({"network_input": PLANES.astype(np.float64)}, "float32"),
    ],
)
def test_arrays_that_do_not_go_together_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        GoldenArrays(**({"capture": MOSAIC, "reference": PLANES} | change))


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("typical.pickle", PLANES, "no known kind"),
        ("typical.output.XL", PLANES, "no known kind"),
        ("other.capture", MOSAIC, "lacks reference"),
        ("typical.reference", PLANES, "of the capture's"),
    ],
)
def test_file_of_other_tensors_is_refused(name: str, array: Any, message: str) -> None:
    tensors = load(golden_to_bytes(tiny_golden())) | {name: array}
    with pytest.raises(BundleError, match=message):
        golden_from_bytes(save(tensors))


def test_damaged_file_is_refused() -> None:
    with pytest.raises(BundleError, match="not a sound safetensors file"):
        golden_from_bytes(golden_to_bytes(tiny_golden())[:-1])
