"""Networks of bundles on a GPU: rebuilt in torch from their ONNX, checked, timed.

python -m tools.gpu_networks prepare FOLDER [--bundles duet,thin-plate]
python tools/gpu_networks.py measure FOLDER -o gpu.json [--device cuda] [--minutes 9]

`prepare` runs where camkit is installed and writes weights, nodes and outputs of onnxruntime, 13 MB
in all. `measure` needs no more than that folder, this file, torch and numpy.
"""

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

GRAPHS, WEIGHTS, CASES = "networks.json", "weights.npz", "cases.npz"
PARITY = 1e-4
"""Largest difference from onnxruntime in float32; outputs are of the order of 1."""
CASE_PX = (96, 128)
BASE_SECONDS = 1.0
"""Time of one latency: runs are repeated for so long."""
LAYOUTS = {"nchw": torch.contiguous_format, "nhwc": torch.channels_last}
DTYPES = {"fp32": torch.float32, "fp16": torch.float16}
Values = dict[str, Tensor]


def main(words: list[str] | None = None) -> int:
    """Run one of the two halves."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    prepared = commands.add_parser("prepare")
    prepared.add_argument("folder", type=Path)
    prepared.add_argument("--bundles", default="", help="default: all built-in ones")
    measured = commands.add_parser("measure")
    measured.add_argument("folder", type=Path)
    measured.add_argument("-o", "--out", type=Path, required=True)
    measured.add_argument("--device", default="cuda")
    measured.add_argument("--minutes", type=float, default=9.0)
    measured.add_argument("--width", type=int, default=6000)
    measured.add_argument("--height", type=int, default=4000)
    measured.add_argument("--tile", type=int, default=1024)
    measured.add_argument("--seconds", type=float, default=BASE_SECONDS, help="per latency")
    arguments = parser.parse_args(words)
    if arguments.command == "prepare":
        prepare(arguments.folder, [name for name in arguments.bundles.split(",") if name])
        return 0
    report = measure(arguments)
    return 0 if all(row["passed"] for row in report["networks"]) else 1


def prepare(folder: Path, names: list[str]) -> None:
    """Write graphs as JSON, weights, and one case of onnxruntime for each network."""
    import onnx

    from camkit.bundle.reader import built_in_bundles, open_bundle
    from camkit.runtime.network.engine import NetworkEngine

    graphs = []
    weights: dict[str, Any] = {}
    cases: dict[str, Any] = {}
    rng = np.random.default_rng(0)
    for name in names or sorted(built_in_bundles()):
        bundle = open_bundle(built_in_bundles()[name])
        for role, sizes in bundle.manifest.networks.items():
            for size, facts in sizes.items():
                data, key = bundle.network_bytes(role, size), f"{name}/{role}/{size}"
                graph = onnx.load_from_string(data).graph
                arrays = {t.name: onnx.numpy_helper.to_array(t) for t in graph.initializer}
                weights |= {f"{key}/{tensor}": array for tensor, array in arrays.items()}
                shape = (1, facts.input_channels, *CASE_PX)
                window = rng.uniform(0, 1.5, shape).astype(np.float32)
                engine = NetworkEngine(data, threads=1, scale=facts.output_scale)
                cases |= {f"{key}/input": window, f"{key}/output": engine.run(window)}
                extent = bundle.manifest.sensor.extent
                graphs.append(
                    {
                        "name": key,
                        "nodes": [_node(node, onnx.helper) for node in graph.node],
                        "stride_px": facts.stride_px,
                        "reach_px": facts.reach_px,
                        "scale": facts.output_scale,
                        "mac_per_pixel": facts.mac_per_pixel,
                        "fp16_safe": facts.fp16_safe,
                        "sensor_px": None
                        if extent is None
                        else [extent.width_px, extent.height_px],
                    }
                )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / GRAPHS).write_text(json.dumps(graphs), encoding="utf-8")
    np.savez(folder / WEIGHTS, **weights)
    np.savez(folder / CASES, **cases)


def _node(node: Any, helper: Any) -> dict[str, Any]:
    attributes = {a.name: helper.get_attribute_value(a) for a in node.attribute}
    if node.op_type == "Constant":
        raise ValueError(f"{node.name}: a constant is a weight in the graphs of camkit")
    return {
        "op": node.op_type,
        "inputs": list(node.input),
        "output": node.output[0],
        "attributes": {
            k: v.decode() if isinstance(v, bytes) else list(v) if hasattr(v, "__iter__") else v
            for k, v in attributes.items()
        },
    }


class TorchNetwork:
    """A graph of ONNX nodes, computed by torch."""

    def __init__(self, graph: dict[str, Any], weights: Values, device: str, dtype: Any) -> None:
        self.name, self.nodes = graph["name"], graph["nodes"]
        self.stride, self.reach, self.scale = (
            graph[key] for key in ("stride_px", "reach_px", "scale")
        )
        self._weights = {
            name: value.to(device, dtype) if value.is_floating_point() else value
            for name, value in weights.items()
        }

    @torch.inference_mode()
    def __call__(self, window: Tensor) -> Tensor:
        """Return the output for (1, channels, h, w)."""
        values = {"input": window}
        last_use = {name: i for i, node in enumerate(self.nodes) for name in node["inputs"]}
        for i, node in enumerate(self.nodes):
            sources = [
                values[name] if name in values else self._weights[name] if name else None
                for name in node["inputs"]
            ]
            values[node["output"]] = OPERATORS[node["op"]](sources, node["attributes"])
            del sources  # a whole picture in one window: what nobody needs is given back
            for name in {name for name in node["inputs"] if last_use[name] == i}:
                values.pop(name, None)
        return values["output"]


def _conv(sources: list[Any], settings: dict[str, Any]) -> Tensor:
    source, weight, *bias = sources
    top, left, bottom, right = settings.get("pads", [0, 0, 0, 0])
    if (top, left) != (bottom, right):
        source, top, left = functional.pad(source, (left, right, top, bottom)), 0, 0
    return functional.conv2d(
        source,
        weight,
        bias[0] if bias else None,
        stride=settings.get("strides", [1, 1]),
        padding=(top, left),
        dilation=settings.get("dilations", [1, 1]),
        groups=settings.get("group", 1),
    )


def _shuffle(sources: list[Any], settings: dict[str, Any]) -> Tensor:
    if settings.get("mode", "DCR") != "CRD":
        raise ValueError("DepthToSpace of mode DCR is not written")
    return functional.pixel_shuffle(sources[0], settings["blocksize"])


def _slice(sources: list[Any], _: dict[str, Any]) -> Tensor:
    source, starts, ends = sources[:3]
    axes = sources[3].tolist() if len(sources) > 3 else range(len(starts))
    steps = sources[4].tolist() if len(sources) > 4 else [1] * len(starts)
    picked = [slice(None)] * source.ndim
    for axis, start, end, step in zip(axes, starts.tolist(), ends.tolist(), steps, strict=True):
        picked[axis] = slice(start, min(end, source.shape[axis]), step)
    result: Tensor = source[tuple(picked)]
    return result


def _pool(sources: list[Any], settings: dict[str, Any]) -> Tensor:
    top, left, bottom, right = settings.get("pads", [0, 0, 0, 0])
    if (top, left) != (bottom, right) or settings.get("ceil_mode", 0):
        raise ValueError("MaxPool is written for even borders")
    return functional.max_pool2d(
        sources[0],
        settings["kernel_shape"],
        settings.get("strides", [1, 1]),
        (top, left),
        settings["dilations"],
    )


def _largest(sources: list[Any], settings: dict[str, Any]) -> Tensor:
    return torch.amax(
        sources[0], dim=sources[1].tolist(), keepdim=bool(settings.get("keepdims", 1))
    )


def _clip(sources: list[Any], _: dict[str, Any]) -> Tensor:
    least, most = [*sources[1:], None, None][:2]
    return torch.clamp(sources[0], least, most)


OPERATORS: dict[str, Callable[[list[Any], dict[str, Any]], Tensor]] = {
    "Conv": _conv,
    "LeakyRelu": lambda x, settings: functional.leaky_relu(x[0], settings.get("alpha", 0.01)),
    "Relu": lambda x, _: functional.relu(x[0]),
    "Add": lambda x, _: x[0] + x[1],
    "Sub": lambda x, _: x[0] - x[1],
    "Mul": lambda x, _: x[0] * x[1],
    "Div": lambda x, _: x[0] / x[1],
    "Min": lambda x, _: torch.minimum(*x),
    "Max": lambda x, _: torch.maximum(*x),
    "Concat": lambda x, settings: torch.cat(x, dim=settings["axis"]),
    "DepthToSpace": _shuffle,
    "Slice": _slice,
    "MaxPool": _pool,
    "ReduceMax": _largest,
    "Clip": _clip,
}
"""Those of the built-in bundles."""


def measure(arguments: argparse.Namespace) -> dict[str, Any]:
    """Check and time every network that there is time for; write the report after each."""
    began, device = time.perf_counter(), arguments.device
    # TF32 would round float32 to 10 bits and still be called fp32
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = False
    torch.backends.cudnn.benchmark = True
    report: dict[str, Any] = {
        "device": torch.cuda.get_device_name() if device == "cuda" else device,
        "torch": str(torch.__version__),
        "picture_px": [arguments.width, arguments.height],
        "networks": [],
        "left_out": [],
    }
    for graph, weights, case in _networks(arguments.folder):
        if time.perf_counter() - began > 60 * arguments.minutes:
            report["left_out"].append(graph["name"])
            continue
        row = _row(graph, weights, case, arguments)
        report["networks"].append(row)
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        arguments.out.write_text(json.dumps(report, indent=1), encoding="utf-8")
        print(json.dumps(row), flush=True)
    report["seconds"] = round(time.perf_counter() - began, 1)
    arguments.out.write_text(json.dumps(report, indent=1), encoding="utf-8")
    return report


def _networks(folder: Path) -> Iterator[tuple[dict[str, Any], Values, Values]]:
    graphs = json.loads((folder / GRAPHS).read_text(encoding="utf-8"))
    with np.load(folder / WEIGHTS) as weights, np.load(folder / CASES) as cases:
        for graph in graphs:
            yield (
                graph,
                *(
                    {
                        name.removeprefix(f"{graph['name']}/"): torch.from_numpy(file[name])
                        for name in file.files
                        if name.startswith(f"{graph['name']}/")
                    }
                    for file in (weights, cases)
                ),
            )


def _row(
    graph: dict[str, Any], weights: Values, case: Values, arguments: argparse.Namespace
) -> dict[str, Any]:
    """Return parity, tiles and latencies of one network."""
    device, rows = arguments.device, {}
    window = case["input"].to(device)
    exact = TorchNetwork(graph, weights, device, torch.float32)
    parity = _distance(exact(window), case["output"].to(device))
    # a picture of the sensor where that is smaller: single photons have 64x32 pixels
    limit_px = graph["sensor_px"] or [sys.maxsize, sys.maxsize]
    size = min(arguments.height, limit_px[1]), min(arguments.width, limit_px[0])
    picture = _picture(window.shape[1], size, exact.stride)
    # other windows take other kernels: as near as float32 is, and no equal bits
    whole = exact(picture.to(device))
    tiles = _distance(_tiled(exact, picture, arguments), whole.cpu())
    for dtype, kind in DTYPES.items():
        network = TorchNetwork(graph, weights, device, kind)
        for layout, order in LAYOUTS.items():
            rows[f"{dtype} {layout}"] = _latencies(network, picture, order, kind, arguments)
        if dtype == "fp16":
            half = network(picture.to(device, kind)).float()
    return {
        "name": graph["name"],
        "mac_per_pixel": graph["mac_per_pixel"],
        "picture_px": [picture.shape[3], picture.shape[2]],
        "parity_max_abs": parity,
        "tiles_max_abs": tiles,
        "fp16_max_abs": _distance(half, whole),
        "fp16_rms": float((half - whole).square().mean().sqrt()),
        "passed": parity <= PARITY and tiles <= PARITY,
        "latency": rows,
    }


def _picture(channels: int, size: tuple[int, int], stride: int) -> Tensor:
    """Return noise of whole strides, in the memory that a GPU copies from fastest."""
    height, width = (-(-side // stride) * stride for side in size)
    generator = torch.Generator().manual_seed(0)
    picture = 1.5 * torch.rand((1, channels, height, width), generator=generator)
    return picture.pin_memory() if torch.cuda.is_available() else picture


def _distance(a: Tensor, b: Tensor) -> float:
    return float((a - b).abs().max())


def _tiled(network: TorchNetwork, picture: Tensor, arguments: argparse.Namespace) -> Tensor:
    """Return the output on the CPU, tile by tile with the reach of the network around each."""
    halo = -(-network.reach // network.stride) * network.stride
    tile = max(arguments.tile // network.stride, 1) * network.stride
    outputs = []
    for top in range(0, picture.shape[2], tile):
        row = []
        for left in range(0, picture.shape[3], tile):
            y, x = max(top - halo, 0), max(left - halo, 0)
            window = picture[:, :, y : top + tile + halo, x : left + tile + halo]
            output = network(window.to(arguments.device)).cpu()
            rows, columns = (
                slice(s * start, s * (start + tile))
                for s, start in ((network.scale, top - y), (network.scale, left - x))
            )
            row.append(output[:, :, rows, columns])
        outputs.append(torch.cat(row, dim=3))
    return torch.cat(outputs, dim=2)


def _latencies(
    network: TorchNetwork,
    picture: Tensor,
    order: Any,
    dtype: Any,
    arguments: argparse.Namespace,
) -> dict[str, float]:
    """Return seconds of the network alone, and with the picture brought there and back."""
    device = arguments.device

    def bring() -> Tensor:
        return picture.to(device, non_blocking=True).to(dtype, memory_format=order)

    there = bring()
    return {
        "network_s": _median(lambda: network(there), arguments),
        "picture_s": _median(lambda: network(bring()).float().cpu(), arguments),
    }


def _median(call: Callable[[], object], arguments: argparse.Namespace) -> float:
    """Return the median seconds of a call behind a first one, which chooses kernels."""
    seconds: list[float] = []
    call()
    while not seconds or sum(seconds) < arguments.seconds:
        _wait(arguments.device)
        began = time.perf_counter()
        call()
        _wait(arguments.device)
        seconds.append(time.perf_counter() - began)
    return statistics.median(seconds)


def _wait(device: str) -> None:
    if device == "cuda":
        torch.cuda.synchronize()


if __name__ == "__main__":
    sys.exit(main())
