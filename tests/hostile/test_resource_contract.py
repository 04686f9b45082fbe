"""What odd bundles may take, with the limits that everybody has: memory of the cap, bounded time.

Each is opened, checked at every level and used in a process of its own.
"""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import helper

from camkit.bundle.writer import write_bundle
from camkit.runtime.network.graph import inspect_graph
from tests.bundle_factory import (
    make_model,
    tiny_facts,
    tiny_manifest,
    tiny_members,
    tiny_stages,
)
from tests.hostile.runner import MOST_MB, ROOT

pytestmark = pytest.mark.slow
MOST_SECONDS = 90.0
PROOF_MB = 2000.0


def _wide(channels: int) -> onnx.ModelProto:
    weights = {
        "a": np.full((channels, 6, 1, 1), 1e-3, np.float32),
        "b": np.full((3, channels, 1, 1), 1e-6, np.float32),
    }
    nodes = [
        helper.make_node("Conv", ["input", "a"], ["x"], "a"),
        helper.make_node("Conv", ["x", "b"], ["output"], "b"),
    ]
    return make_model(nodes, weights)


def _transposed() -> onnx.ModelProto:
    weights = {
        "a": np.full((48, 6, 1, 1), 1e-3, np.float32),
        "b": np.full((48, 3, 31, 31), 1e-6, np.float32),
    }
    nodes = [
        helper.make_node("Conv", ["input", "a"], ["x"], "a"),
        helper.make_node("ConvTranspose", ["x", "b"], ["output"], "b", pads=[15] * 4),
    ]
    return make_model(nodes, weights)


def _write(folder: Path, model: onnx.ModelProto | None = None, **facts: Any) -> Path:
    """Write the tiny camera with another network, its facts true unless given."""
    members, known = tiny_members(), tiny_facts()
    if model is not None:
        members["network_m.onnx"] = model.SerializeToString()
        found = inspect_graph(members["network_m.onnx"])
        names = ("mac_per_pixel", "bytes_per_pixel", "parameters", "stride_px")
        true: dict[str, Any] = {name: getattr(found, name) for name in names}
        true |= {"receptive_field_radius_px": found.receptive_field_radius_px}
        known = known.model_copy(
            update=true | {"receptive_field_probe_px": 0, "max_activation": 1e9}
        )
        known = known.model_copy(update={"fp16_safe": False})
    known = known.model_copy(update=facts)
    path = folder / "odd.camkit"
    write_bundle(path, tiny_manifest(networks={"restore": {"M": known}}), members)
    return path


def _with_bank(folder: Path, **change: Any) -> Path:
    stages = tuple(
        stage.model_copy(update=change) if stage.type == "wiener" else stage
        for stage in tiny_stages()
    )
    path = folder / "odd.camkit"
    write_bundle(path, tiny_manifest(stages=stages), tiny_members())
    return path


ODD: dict[str, tuple[Callable[[Path], Path], str, float]] = {
    # how it is made, how it ends, MB it may take
    "wide, and says so": (lambda folder: _write(folder, _wide(20_000)), "processed", PROOF_MB),
    "wide beyond a proof": (lambda f: _write(f, _wide(60_000)), "not proved", PROOF_MB),
    "wide, and understates": (
        lambda folder: _write(folder, _wide(60_000), bytes_per_pixel=48.0),
        "not processed",
        MOST_MB / 2,
    ),
    "transposed": (lambda folder: _write(folder, _transposed()), "processed", PROOF_MB),
    "a reach of 4096 px": (
        lambda folder: _write(folder, receptive_field_radius_px=4096),
        "not proved",
        MOST_MB,
    ),
    "blocks of 8192 px": (
        lambda folder: _with_bank(folder, block_px=8192),
        "not processed",
        MOST_MB / 2,
    ),
    "blocks of 1536 px": (lambda folder: _with_bank(folder, block_px=1536), "processed", MOST_MB),
    "a hundred rounds": (
        lambda folder: _with_bank(folder, clip_iterations=100, overlap_px=16),
        "not processed",
        MOST_MB / 2,
    ),
}


@pytest.mark.parametrize(("make", "end", "most_mb"), ODD.values(), ids=ODD.keys())
def test_an_odd_bundle_stays_within_its_memory_and_time(
    tmp_path: Path, make: Callable[[Path], Path], end: str, most_mb: float
) -> None:
    told = subprocess.run(
        [sys.executable, "-m", "tests.hostile.child", str(make(tmp_path))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        timeout=MOST_SECONDS + 60,
    )
    found = json.loads(told.stdout)
    assert found["end"] == end, found
    assert found["peak_mb"] < most_mb, found
    assert found["seconds"] < MOST_SECONDS, found


@pytest.mark.parametrize(
    "model",
    [_wide(20_000), _wide(60_000), _transposed()],
    ids=["wide", "wider than the cap", "transposed"],
)
def test_a_picture_of_an_odd_network_stays_within_the_cap(
    tmp_path: Path, model: onnx.ModelProto
) -> None:
    told = subprocess.run(
        [sys.executable, "-m", "tests.hostile.picture", str(_write(tmp_path, model))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        timeout=MOST_SECONDS,
    )
    assert float(told.stdout) < MOST_MB
