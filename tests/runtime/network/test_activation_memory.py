"""Memory of a run: counted along the graph, and held when onnxruntime runs it."""

import json
import subprocess
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from onnx import helper

from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from tests.bundle_factory import (
    make_model,
    make_weight,
)
from tests.data_folder import ROOT, data_path
from tests.network_graphs import GRAPHS, nafnet, unet
from tests.small_network import small_network

CAP_MB = 600
MORE_MB = 8
"""Memory of a run besides: threads, tables."""


def _child(*words: str) -> dict[str, float]:
    told = subprocess.run(
        [sys.executable, "-m", "tests.network_child", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    return dict(json.loads(told.stdout))


def _some(names: Iterable[str], often: set[str]) -> list[Any]:
    """Return parameters, all but a few of them slow."""
    return [n if n in often else pytest.param(n, marks=pytest.mark.slow) for n in names]


@pytest.mark.parametrize("name", _some(GRAPHS, {"unet", "nafnet"}))
def test_a_run_takes_no_more_than_is_counted_whatever_sizes_its_windows_have(name: str) -> None:
    seen = _child("run", name, "384", "480", "336")
    assert seen["rose_mb"] < seen["counted_mb"] + MORE_MB


@pytest.mark.parametrize(
    "name", _some(["unet", "nafnet without pooling", "densenet"], {"unet", "densenet"})
)
def test_a_picture_of_a_foreign_network_stays_within_the_cap(name: str) -> None:
    assert _child("picture", name, str(CAP_MB))["peak_mb"] < CAP_MB


@pytest.mark.parametrize("name", ["dncnn", "sid"])
def test_networks_as_people_have_them_are_counted_with_their_block(name: str) -> None:
    found = inspect_graph(data_path(f"networks/{name}.onnx").read_bytes())
    assert found.block_bytes_per_pixel > found.bytes_per_pixel > 4 * found.input_channels


def test_the_block_holds_tensors_of_one_time_and_its_gaps_are_used() -> None:
    # a and b are needed together; c fits in the place of a
    weights = {"w": make_weight(16, 16, 1, 1), "v": make_weight(16, 16, 1, 1)}
    nodes = [
        helper.make_node("Conv", ["input", "w"], ["a"]),
        helper.make_node("Conv", ["a", "v"], ["b"]),
        helper.make_node("Conv", ["b", "w"], ["c"]),
        helper.make_node("Conv", ["c", "v"], ["output"]),
    ]
    data = make_model(nodes, weights, channels=(16, 16)).SerializeToString()
    found = inspect_graph(data)
    assert found.bytes_per_pixel == 4 * 2 * 16
    # two tensors at a time, and the copy of the input; 1.3 of them
    assert found.block_bytes_per_pixel == pytest.approx(1.3 * 4 * 3 * 16)


@pytest.mark.parametrize("make", [unet, nafnet, small_network])
def test_the_block_changes_no_bit(make: object) -> None:
    data = make()  # type: ignore[operator]
    window = np.random.default_rng(0).random((1, 6, 64, 96), dtype=np.float32)
    arena = NetworkEngine(data, threads=1).run(window)
    block = NetworkEngine(data, threads=1, block_bytes=100.0)
    for _ in range(3):
        np.testing.assert_array_equal(block.run(window), arena)
