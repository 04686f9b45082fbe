"""Networks that look at the whole picture: found, never tiled in mode exact, said in the plan."""

import re
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import helper

from camkit.bundle.facts import HaloError, Port
from camkit.bundle.reader import open_bundle
from camkit.errors import BundleError, ContractError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.windows import SizedNetwork, WindowLimits, lay_network
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.rows import ArrayRows
from tests.bundle_factory import make_model, make_weight
from tests.network_bundle import write_network_bundle
from tests.network_graphs import nafnet
from tests.planes_bundle import facts_of

NODE = helper.make_node
SIZE_PX = (64, 96)
ONES = np.ones(3, np.float32)
FINE = np.array([1, 1, 2, 2], np.float32)


def _gate(op: str, axes: list[int] | None = None, **facts: object) -> onnx.ModelProto:
    """Build a picture times what a reduction of it leaves."""
    extra = [] if axes is None else ["axes"]
    nodes = [
        NODE(op, ["input", *extra], ["seen"], "seen", **facts),
        NODE("Mul", ["input", "seen"], ["output"], "gate"),
    ]
    weights = {} if axes is None else {"axes": np.array(axes, np.int64)}
    return make_model(nodes, weights, channels=(3, 3))


def _excited() -> onnx.ModelProto:
    """Build squeeze and excite: pooled, two 1x1 convolutions, a sigmoid, times the picture."""
    nodes = [
        NODE("GlobalAveragePool", ["input"], ["seen"], "seen"),
        NODE("Conv", ["seen", "a"], ["low"]),
        NODE("Relu", ["low"], ["on"]),
        NODE("Conv", ["on", "b"], ["high"]),
        NODE("Sigmoid", ["high"], ["share"]),
        NODE("Mul", ["input", "share"], ["output"]),
    ]
    weights = {"a": make_weight(2, 3, 1, 1), "b": make_weight(3, 2, 1, 1)}
    return make_model(nodes, weights, channels=(3, 3))


def _layer_norm() -> onnx.ModelProto:
    """Build a norm over channels, rows and columns from its parts."""
    nodes = [
        NODE("ReduceMean", ["input", "axes"], ["seen"], "seen"),
        NODE("Sub", ["input", "seen"], ["rest"]),
        NODE("Mul", ["rest", "rest"], ["square"]),
        NODE("ReduceMean", ["square", "axes"], ["variance"], "variance"),
        NODE("Sqrt", ["variance"], ["spread"]),
        NODE("Div", ["rest", "spread"], ["output"]),
    ]
    return make_model(nodes, {"axes": np.array([1, 2, 3])}, channels=(3, 3))


def _single(op: str, *constants: np.ndarray, **facts: object) -> onnx.ModelProto:
    names = [f"c{index}" for index in range(len(constants))]
    node = NODE(op, ["input", *names], ["output"], "seen", **facts)
    return make_model([node], dict(zip(names, constants, strict=True)), channels=(3, 3))


def _corner_aligned() -> onnx.ModelProto:
    nodes = [
        NODE("MaxPool", ["input"], ["half"], kernel_shape=[2, 2], strides=[2, 2]),
        NODE(
            "Resize",
            ["half", "", "fine"],
            ["output"],
            "seen",
            mode="nearest",
            coordinate_transformation_mode="align_corners",
        ),
    ]
    return make_model(nodes, {"fine": FINE}, channels=(3, 3))


GLOBALS = {
    "global average": _gate("GlobalAveragePool"),
    "global maximum": _gate("GlobalMaxPool"),
    "mean over space": _gate("ReduceMean", [2, 3]),
    "mean over negative axes": _gate("ReduceMean", [-2, -1]),
    "mean over rows alone": _gate("ReduceMean", [-2]),
    "sum over columns alone": _gate("ReduceSum", [3]),
    "maximum over all but the batch": _gate("ReduceMax", [1, 2, 3]),
    "mean over axes that are not named": _gate("ReduceMean"),
    "mean over an empty list of axes": _gate("ReduceMean", []),
    "squeeze and excite": _excited(),
    "layer norm over space": _layer_norm(),
    "instance norm": _single("InstanceNormalization", ONES, ONES),
    "softmax over positions of a row": _single("Softmax"),
    "softmax over rows": _single("Softmax", axis=2),
    "nearest samples by corners": _corner_aligned(),
}


@pytest.mark.parametrize("name", GLOBALS)
def test_what_looks_at_the_whole_picture_is_found(name: str) -> None:
    model = GLOBALS[name]
    assert "seen (" in inspect_graph(model.SerializeToString()).global_operators[0]


REFUSED = {
    "attention over positions": (_single("MatMul", np.ones((4, 4), np.float32)), "MatMul"),
    "a group norm by another shape": (_single("Reshape", np.array([1, 1, 3, -1])), "Reshape"),
    "a group norm": (
        _single("GroupNormalization", ONES[:1], ONES[:1], num_groups=1),
        "GroupNormalization",
    ),
    "a norm over the last axes": (_single("LayerNormalization", ONES[:1]), "LayerNormalization"),
    "a transform of the picture": (_single("DFT"), "DFT"),
    "a running sum": (_single("CumSum", np.array(2)), "CumSum"),
    "a norm of the batch as it is": (
        _single("BatchNormalization", ONES, ONES, ONES, ONES, training_mode=1),
        "training mode|outputs",
    ),
    "a resize to fixed sizes": (
        _single("Resize", ONES[:0], ONES[:0], np.array([1, 3, 64, 64])),
        "constant scales",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_other_ways_to_look_at_all_are_refused_by_their_name(name: str) -> None:
    model, said = REFUSED[name]
    with pytest.raises(BundleError, match=said):
        inspect_graph(model.SerializeToString())


LOCALS = {
    "mean over channels": _gate("ReduceMean", [1]),
    "mean over the third axis from the end": _gate("ReduceMean", [-3]),
    "mean over nothing": _gate("ReduceMean", [], noop_with_empty_axes=1),
    "mean over the batch of one": _gate("ReduceMean", [0]),
    "attention over channels": _gate("Softmax", axis=1),
    "pixels shuffled": make_model(
        [
            NODE("SpaceToDepth", ["input"], ["low"], blocksize=4),
            NODE("DepthToSpace", ["low"], ["output"], blocksize=4),
        ],
        {},
        channels=(3, 3),
    ),
    "pooled in windows of 8 px": make_model(
        [
            NODE("AveragePool", ["input"], ["low"], kernel_shape=[8, 8], strides=[8, 8]),
            NODE("Resize", ["low", "", "fine"], ["wide"], mode="nearest"),
            NODE("Mul", ["input", "wide"], ["output"]),
        ],
        {"fine": np.array([1, 1, 8, 8], np.float32)},
        channels=(3, 3),
    ),
}


@pytest.mark.parametrize("name", LOCALS)
def test_what_looks_at_windows_alone_is_tiled_exactly(name: str) -> None:
    network = _sized(LOCALS[name])
    assert not network.is_global
    picture = np.random.default_rng(2).random((3, *SIZE_PX), dtype=np.float32)
    made = []
    for tile_px in (None, 16):
        windows = lay_network(SIZE_PX, [network], _limits(tile_px=tile_px))
        made.append(np.concatenate(list(windows.bands(ArrayRows(picture))), axis=1))
    np.testing.assert_array_equal(*made)


def _sized(model: onnx.ModelProto, **changes: object) -> SizedNetwork:
    data = model.SerializeToString()
    ports = [Port(name="a", channels=3)], [Port(name="b", channels=3)]
    found = inspect_graph(data).global_operators
    facts = facts_of(data, *ports).model_copy(update={"global_operators": found} | changes)
    return SizedNetwork(size="M", run=NetworkEngine(data, threads=1).run, facts=facts)


def _limits(**changes: object) -> WindowLimits:
    fields = {"cap_bytes": 10**9, "spent_bytes": 0, "mode": "exact", "cell_px": 32}
    return WindowLimits(**(fields | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", GLOBALS)
def test_a_network_that_looks_at_all_gets_one_window_or_none(name: str) -> None:
    network = _sized(GLOBALS[name])
    one = lay_network(SIZE_PX, [network], _limits())
    facts = one.to_json()
    assert (facts["windows"], facts["global_operators"]) == (
        1,
        list(network.facts.global_operators),
    )
    said = r"looks at the whole picture \(seen .* cannot be tiled exactly"
    with pytest.raises(ContractError, match=rf"{said}.*leave out the tile size"):
        lay_network(SIZE_PX, [network], _limits(tile_px=16))
    with pytest.raises(ContractError, match=rf"{said}.*raise max_mem_bytes=[\d_]+$"):
        lay_network(SIZE_PX, [network], _limits(cap_bytes=10**5))


def test_the_memory_that_the_message_names_does() -> None:
    network = _sized(GLOBALS["global average"])
    size_px = 2000, 3000
    with pytest.raises(ContractError) as refused:
        lay_network(size_px, [network], _limits(cap_bytes=10**8, spent_bytes=10**7))
    (named,) = re.findall(r"raise max_mem_bytes=([\d_]+)", str(refused.value))
    named_bytes = int(named)
    enough = _limits(cap_bytes=named_bytes, spent_bytes=10**7)
    assert lay_network(size_px, [network], enough).to_json()["windows"] == 1
    less = _limits(cap_bytes=named_bytes - 10**6, spent_bytes=10**7)
    with pytest.raises(ContractError, match="whole picture"):
        lay_network(size_px, [network], less)


def test_cells_are_not_skipped_by_a_network_that_looks_at_all() -> None:
    labels = np.array([[1, 0, 0], [0, 0, 0]])
    windows = lay_network(SIZE_PX, [_sized(GLOBALS["instance norm"])], _limits(), labels)
    assert windows.cells is None
    assert windows.to_json()["windows"] == 1


@pytest.mark.parametrize("size", ["M", "S"])
def test_the_plan_says_it_of_the_size_that_runs_alone(tmp_path: Path, size: str) -> None:
    models = {"M": nafnet(), "S": nafnet(pooled=False)}
    path = write_network_bundle(tmp_path, models, (320, 240))
    pipeline = Pipeline(open_bundle(path), Options(threads=1, size=size))
    capture = np.full((240, 320), 500, np.uint16)
    given = pipeline.capture_of(capture, iso=100, white_balance=None, origin_px=None)
    work = pipeline.start(given)
    (halo,) = [one for one in work.record["decisions"] if one["what"] == "halo"]
    assert (halo["choice"] == "one window") == (size == "M")
    assert ("looks at the whole picture" in halo["reason"]) == (size == "M")


def test_mode_fast_tiles_where_a_curve_was_measured_and_says_what_that_means() -> None:
    curve = (HaloError(halo_px=0, max_abs=1e-5, psnr_db=90.0),)
    network = _sized(GLOBALS["global average"], halo_error=curve)
    windows = lay_network(SIZE_PX, [network], _limits(mode="fast", tile_px=16))
    (note,) = windows.notes()
    assert "24 windows separately" in note
    with pytest.raises(ContractError, match=r"or use mode=.fast."):
        lay_network(SIZE_PX, [network], _limits(cap_bytes=10**5))
    assert lay_network(SIZE_PX, [network], _limits()).notes() == ()


def test_process_plan_and_check_of_a_camera_that_would_be_tiled_say_so(tmp_path: Path) -> None:
    size_px = 2400, 1600
    path = write_network_bundle(tmp_path, {"M": nafnet()}, size_px)
    capture = np.full(size_px[::-1], 500, np.uint16)
    pipeline = Pipeline(open_bundle(path), Options(threads=1))
    said = r"\(GlobalAveragePool_\d+ \(GlobalAveragePool\), .* and 2 more\) and cannot be tiled"
    given = pipeline.capture_of(capture, iso=100, white_balance=None, origin_px=None)
    with pytest.raises(ContractError, match=said):
        pipeline.start(given)
    report = check_bundle(path, "tiling")
    assert not report.passed
    (layer,) = [one for one in report.layers if one.name == "tiling"]
    assert "the 2400x1600 px of the sensor do not fit in one window: of the cap" in layer.message


def test_a_small_camera_is_processed_in_one_window_and_its_plan_says_why(tmp_path: Path) -> None:
    path = write_network_bundle(tmp_path, {"M": nafnet()}, (320, 240))
    pipeline = Pipeline(open_bundle(path), Options(threads=1))
    capture = np.full((240, 320), 500, np.uint16)
    given = pipeline.capture_of(capture, iso=100, white_balance=None, origin_px=None)
    work = pipeline.start(given)
    (halo,) = [one for one in work.record["decisions"] if one["what"] == "halo"]
    assert halo["choice"] == "one window"
    assert "looks at the whole picture (GlobalAveragePool" in halo["reason"]
    assert np.isfinite(work.fill()).all()
    report = check_bundle(path, "tiling")
    assert report.passed
    assert "one window holds the 320x240 px of the sensor" in report.layers[-1].message


@pytest.mark.parametrize("width", [1210, 1240, 1260, 1280, 1310])
def test_check_passes_exactly_where_a_whole_picture_is_taken(tmp_path: Path, width: int) -> None:
    path = write_network_bundle(tmp_path, {"M": nafnet()}, (width, 860))
    pipeline = Pipeline(open_bundle(path), Options(threads=1))
    capture = np.full((860, width), 500, np.uint16)
    given = pipeline.capture_of(capture, iso=100, white_balance=None, origin_px=None)
    try:
        pipeline.start(given)
        taken = True
    except ContractError:
        taken = False
    assert check_bundle(path, "tiling").passed == taken
