"""The graphs of an array of single photons behind a plate: its pictures on the fine grid.

    frames of photons -> photons of white                                        white
    photons, dark counts, white -> light and noise -> network -> photons         frame_S, frame_M

See `camkit.runtime.kinds.spad.finer`. What lies before, and depth, stay with the host: the manifest
names it.
"""

from typing import Any, Final

import numpy as np
import onnx

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import SpadSensor
from camkit.bundle.stages import SuperResolve
from camkit.bundle.stages.super_resolve import LEAST_WHITE, NOISE_SCALE, SURE, WHITE_PERCENTILE
from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.portable.refusal import refusal

HOST: Final = ("pile_up", "dark_counts", "hot_pixels")
"""What is done to counts before a graph gets them."""
IMAGE: Final = "image"


def fine_stage(bundle: Bundle) -> SuperResolve:
    """Return the stage of an array of photons whose pictures have graphs.

    Raises:
        UnsupportedError: If it has no such stage, several, or no network.
    """
    manifest = bundle.manifest
    stages = manifest.stages_of(SuperResolve)
    if len(stages) != 1 or manifest.stages[1:2] != stages:
        raise refusal(
            manifest, f"it has {len(stages)} stages super_resolve, not one behind the counts"
        )
    if manifest.products.get(IMAGE) != stages[0].gives[0]:
        raise refusal(manifest, f"its pictures are not what stage {stages[0].type} gives")
    if not manifest.networks.get(stages[0].role):
        raise refusal(manifest, f"it has no network of the role {stages[0].role}")
    return stages[0]


def frame_graphs(bundle: Bundle, sizes: tuple[str, ...]) -> list[GraphBuilder]:
    """Return the graphs of an array, see the head of the module."""
    return [_white_graph(), *(_frame_graph(bundle, size) for size in sizes)]


def frames_manifest(bundle: Bundle, sizes: tuple[str, ...]) -> dict[str, Any]:
    """Return the numbers of `portable.json` that only arrays of photons have."""
    sensor, manifest = bundle.manifest.sensor, bundle.manifest
    assert isinstance(sensor, SpadSensor)
    extent = sensor.known_extent
    return {
        "sensor": {
            "size_px": [extent.width_px, extent.height_px],
            "sub_pixels": sensor.sub_pixels,
        },
        "networks": {size: {"graph": f"frame_{size}"} for size in sizes},
        "host": list(HOST),
        "left_out": [name for name in manifest.products if name != IMAGE],
    }


def _white_graph() -> GraphBuilder:
    """Return the graph of the photons that are taken for white: a percentile of the brightest."""
    graph = GraphBuilder("white")
    frames = graph.input("frames", ("n", "h", "w"))
    flat = frames.shaped(0, -1)
    count = Value(graph, graph.node("Shape", flat, start=1).name, "int64")
    # the samples above the percentile are few: the place counted from the brightest
    place = (count - 1).cast("float64") * (1 - WHITE_PERCENTILE / 100)
    low = place.floor()
    share = (place - low).cast("float32")
    first = low.cast("int64")
    most = (first + 2).at_most(count)
    sorted_samples, _ = graph.nodes_out("TopK", (flat, most), 2, axis=1)
    upper = sorted_samples.gather(first, 1)
    lower = sorted_samples.gather((first + 1).at_most(count - 1), 1)
    each = upper + (lower - upper) * share
    brightest = graph.node("ReduceMax", each, keepdims=0).shaped(1)
    graph.output("white", brightest.at_least(LEAST_WHITE), (1,))
    return graph


def _frame_graph(bundle: Bundle, size: str) -> GraphBuilder:
    """Return the graph of a picture by the network of a size."""
    stage, sensor = fine_stage(bundle), bundle.manifest.sensor
    assert isinstance(sensor, SpadSensor)
    graph, scale = GraphBuilder(f"frame_{size}"), sensor.sub_pixels
    photons, dark = graph.input("photons", ("h", "w")), graph.input("dark", ("h", "w"))
    white = graph.input("white", (1,))
    counts = (photons + dark).relu()
    deviation = (counts + 1.0).sqrt()
    axes = np.array([0, 1], np.int64)
    planes = graph.joined(
        [graph.node("Unsqueeze", one, axes) for one in (photons, deviation * NOISE_SCALE)], axis=1
    )
    model = onnx.load_from_string(bundle.network_bytes(stage.role, size))
    fine = graph.copied(model, planes / white).relu() * white
    is_lit = Value(graph, (photons.sum(0, 1) > 0.0).name, "bool").cast("float32")
    picture = graph.node("Squeeze", fine, axes) * is_lit
    if stage.floor > 0:
        sure = (counts - deviation * SURE - dark).relu()
        whole = graph.node("Unsqueeze", sure * -1.0, axes)
        pads = [1, 1, 1, 1]
        darkest = graph.node("MaxPool", whole, kernel_shape=[3, 3], pads=pads) * -stage.floor
        scales = np.array([1, 1, scale, scale], np.float32)
        least = graph.node(
            "Resize",
            darkest,
            None,
            scales,
            mode="nearest",
            nearest_mode="floor",
            coordinate_transformation_mode="asymmetric",
        )
        picture = picture.at_least(graph.node("Squeeze", least, axes))
    graph.output("out", picture, ("rows", "columns"))
    return graph
