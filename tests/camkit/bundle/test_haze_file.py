"""A haze survives its file; a damaged file is refused with its reason."""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from safetensors.numpy import load, save

from camkit.bundle.haze_file import haze_from_bytes, haze_to_bytes, read_haze, write_haze
from camkit.errors import BundleError
from tests.haze_factory import tiny_haze

Tensors = dict[str, NDArray[Any]]


@settings(max_examples=20, deadline=None)
@given(cells=st.sampled_from([1, 3, 9]), share=st.floats(0.05, 1.0))
def test_a_haze_comes_back_bit_for_bit(cells: int, share: float) -> None:
    haze = tiny_haze(cells=cells, share=share)
    data = haze_to_bytes(haze)
    back = haze_from_bytes(data)
    np.testing.assert_array_equal(back.kernels, haze.kernels)
    np.testing.assert_array_equal(back.core_share, haze.core_share)
    assert (back.cell_px, back.pixel_pitch_um) == (haze.cell_px, haze.pixel_pitch_um)
    assert haze_to_bytes(back) == data


def test_a_haze_comes_back_from_disk_and_cannot_be_changed(tmp_path: Path) -> None:
    path = tmp_path / "haze.safetensors"
    write_haze(path, tiny_haze())
    haze = read_haze(path)
    with pytest.raises(ValueError, match="read-only"):
        haze.kernels[0] = 0
    with pytest.raises(BundleError, match=r"cannot read the haze .*none"):
        read_haze(tmp_path / "none")


def _with(name: str, value: Any) -> Callable[[Tensors], None]:
    return lambda tensors: tensors.__setitem__(name, value)


DAMAGED: dict[str, tuple[Callable[[Tensors], Any], str]] = {
    "a tensor less": (lambda t: t.pop("core_share"), "missing: core_share; unknown: none"),
    "a tensor more": (_with("arms", np.zeros(1)), "unknown: arms"),
    "another type": (lambda t: t.update(kernels=t["kernels"].astype("f8")), "must be float32"),
    "another rank": (lambda t: t.update(kernels=t["kernels"][0]), "with 5 axes"),
    "nothing": (lambda t: t.update(depths_mm=np.zeros(0)), "not empty"),
    "two pitches": (_with("pixel_pitch_um", np.ones(2)), "must be one number"),
    "half a pixel": (_with("cell_px", np.array([8.5])), "whole number"),
    "no number of pixels": (_with("cell_px", np.array([np.inf])), "whole number"),
    "odd cells": (_with("cell_px", np.array([9.0])), "is refused: cells of haze"),
    "negative light": (lambda t: t.update(kernels=-t["kernels"]), "is refused: haze must be"),
}


@pytest.mark.parametrize(("change", "said"), DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_haze_is_refused(change: Callable[[Tensors], Any], said: str) -> None:
    tensors = load(haze_to_bytes(tiny_haze()))
    change(tensors)
    data = save({name: np.ascontiguousarray(array) for name, array in tensors.items()})
    with pytest.raises(BundleError, match=said):
        haze_from_bytes(data)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_any_changed_byte_is_read_or_refused(data: st.DataObject) -> None:
    stored = bytearray(haze_to_bytes(tiny_haze(cells=1)))
    place = data.draw(st.integers(0, len(stored) - 1))
    stored[place] ^= data.draw(st.integers(1, 255))
    with contextlib.suppress(BundleError):
        haze_from_bytes(bytes(stored))
