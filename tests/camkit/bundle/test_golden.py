"""Golden cases survive the file; cases that contradict themselves are refused."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import load, save

from camkit.bundle.golden import GoldenArrays, golden_from_bytes, golden_to_bytes
from camkit.errors import BundleError, ContractError
from tests.bundle_factory import tiny_golden

EXAMPLE = Path(__file__).resolve().parents[2] / "data" / "example-1.0.camkit"
PLANES = np.zeros((3, 4, 6), np.float32)
MOSAIC = np.zeros((4, 6), np.uint16)


def test_cases_come_back_in_half_precision_and_once_so_bit_for_bit() -> None:
    rng = np.random.default_rng(0)
    half = rng.random((3, 5, 7)).astype(np.float16).astype(np.float32)
    linear = GoldenArrays(
        capture=rng.random((3, 5, 7), dtype=np.float32),
        reference=half,
        outputs={"image": {"S": half / 2}, "depth": {"M": half[:1, :2]}},
    )
    cases = tiny_golden() | {"dark": linear}
    data = golden_to_bytes(cases)
    back = golden_from_bytes(data)
    assert back.keys() == cases.keys()
    np.testing.assert_array_equal(back["dark"].capture, linear.capture)
    np.testing.assert_array_equal(back["dark"].reference, half)
    np.testing.assert_array_equal(back["dark"].outputs["image"]["S"], half / 2)
    np.testing.assert_array_equal(back["dark"].outputs["depth"]["M"], half[:1, :2])
    assert back["dark"].output("depth", "S") is None
    assert back["dark"].output("image", "S") is not None
    assert golden_to_bytes(back) == data
    assert {t.dtype for n, t in load(data).items() if n.startswith("dark.o")} == {np.dtype("f2")}


@settings(max_examples=30, deadline=None)
@given(exponent=st.integers(-30, 20), seed=st.integers(0, 99))
def test_pictures_are_kept_to_half_precision_or_whole(exponent: int, seed: int) -> None:
    picture = (2.0**exponent * np.random.default_rng(seed).random((1, 4, 6))).astype(np.float32)
    case = GoldenArrays(capture=MOSAIC, reference=picture)
    back = golden_from_bytes(golden_to_bytes({"a": case}))["a"].reference
    np.testing.assert_allclose(back, picture, rtol=2**-11, atol=2**-25)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32])
def test_captures_of_counts_and_of_histograms_come_back(dtype: type[np.generic]) -> None:
    for shape in ((4, 6), (9, 4, 6)):
        capture = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
        data = golden_to_bytes({"a": GoldenArrays(capture=capture, reference=PLANES)})
        found = golden_from_bytes(data)["a"].capture
        assert found.dtype == dtype
        np.testing.assert_array_equal(found, capture)


def test_products_may_be_of_another_size_than_the_capture() -> None:
    large = np.zeros((3, 16, 24), np.float32)
    case = GoldenArrays(capture=MOSAIC, reference=large, outputs={"image": {"M": large}})
    assert golden_from_bytes(golden_to_bytes({"a": case}))["a"].reference.shape == (3, 16, 24)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"capture": MOSAIC.astype(np.int32)}, "capture must be"),
        ({"capture": np.zeros((1, 4, 4, 6), np.float32)}, "capture must be"),
        ({"capture": np.zeros((1025, 6), np.uint16)}, "1 to 1024 px"),
        ({"capture": np.zeros((0, 6), np.uint16)}, "1 to 1024 px"),
        ({"reference": np.full_like(PLANES, np.nan)}, "finite"),
        ({"reference": PLANES[0]}, "finite float32"),
        ({"outputs": {"image": {"M": PLANES[:2]}}}, "one shape"),
        ({"outputs": {"depth": {"M": PLANES, "S": PLANES[:2]}}}, "one shape"),
        ({"outputs": {"depth": {"M": PLANES.astype(np.float64)}}}, "float32"),
    ],
)
def test_arrays_that_do_not_go_together_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        GoldenArrays(**({"capture": MOSAIC, "reference": PLANES} | change))


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("typical.pickle", PLANES, "no known kind"),
        ("typical.output.image.M.more", PLANES, "no known kind"),
        ("typical.output", PLANES, "no known kind"),
        ("other.capture", MOSAIC, "lacks reference"),
        ("typical.output.M", PLANES, "one shape"),
        ("typical.output.image.M", PLANES, "one shape"),
        ("typical.reference", PLANES[0], "finite float32"),
    ],
)
def test_file_of_other_tensors_is_refused(name: str, array: Any, message: str) -> None:
    tensors = load(golden_to_bytes(tiny_golden())) | {name: array}
    with pytest.raises(BundleError, match=message):
        golden_from_bytes(save(tensors))


def test_cases_of_format_1_0_are_read() -> None:
    with zipfile.ZipFile(EXAMPLE) as archive:
        data = archive.read("golden.safetensors")
    tensors = load(data)
    assert any("network_input" in name for name in tensors)
    more = tensors | {"typical.output.M": tensors["typical.reference"]}
    case = golden_from_bytes(save(more))["typical"]
    np.testing.assert_array_equal(case.reference, tensors["typical.reference"])
    np.testing.assert_array_equal(case.outputs["image"]["M"], tensors["typical.reference"])
    assert golden_from_bytes(data)["typical"].outputs == {}


def test_damaged_file_is_refused() -> None:
    with pytest.raises(BundleError, match="not a sound safetensors file"):
        golden_from_bytes(golden_to_bytes(tiny_golden())[:-1])
