"""Profile `camkit process`: where the time, the threads and the memory of one photograph go.

python -m tools.stage_profile stages CAPTURE.dng [--size M] [--method physics] [--runs 3]
python -m tools.stage_profile layers [--bundle duet] [--size M] [--threads 2]
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from camkit.bundle.facts import NetworkFacts
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.report.bench.gemm import gemm_peak_gmac_per_s
from camkit.runtime.clock import StageClock
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.machine.memory import keep_memory_for_good, peak_rss_mb
from camkit.runtime.network.engine import available_threads
from camkit.runtime.output.band_queue import BandQueue
from camkit.runtime.output.part_file import atomic_output
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.writer import open_writer
from camkit.runtime.pipeline import load
from camkit.runtime.raw import file_sha256

TRANSFORMS = ("wiener", "network")
WATCH_S = 0.02
SIDE_PX = 1024
ACTIVATIONS = ("LeakyRelu", "Relu")


def main() -> None:
    """Run one of the profiles."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    stages = commands.add_parser("stages")
    stages.add_argument("capture", type=Path)
    stages.add_argument("--format", default="exr", choices=("exr", "tiff", "png"))
    stages.add_argument("--runs", type=int, default=3)
    stages.add_argument("--method", help="way of a stage, as of camkit process")
    layers = commands.add_parser("layers")
    for command in (stages, layers):
        command.add_argument("--bundle", default="duet")
        command.add_argument("--size", default=None if command is stages else "M")
        command.add_argument("--threads", type=int, default=None)
    arguments = parser.parse_args()
    if arguments.command == "stages":
        profile_stages(arguments)
    else:
        profile_layers(arguments)


@dataclass
class ThreadWatch:
    """Memory and CPU seconds as a thread beside the work sees them, every 20 ms."""

    clock: StageClock
    rss_mb: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    cpu_s: dict[int, float] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)

    def take(self) -> None:
        """Record memory of the running stage and CPU seconds of every thread."""
        stage = self.clock.running or "else"
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        rss = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
        self.rss_mb[stage] = max(self.rss_mb[stage], rss)
        self.names |= {t.native_id or 0: t.name for t in threading.enumerate()}
        for task in Path("/proc/self/task").iterdir():
            try:
                nanoseconds = int((task / "schedstat").read_text(encoding="ascii").split()[0])
            except (OSError, IndexError):
                continue  # the thread has ended meanwhile
            self.cpu_s[int(task.name)] = nanoseconds / 1e9

    def by_thread(self) -> dict[str, float]:
        """Sum the CPU seconds of main thread, Python threads by name, and native threads."""
        seconds_of: dict[str, float] = defaultdict(float)
        for thread, seconds in self.cpu_s.items():
            name = self.names.get(thread, "onnxruntime and OpenCV")
            if thread == os.getpid():
                name = "main"
            elif name.startswith("ThreadPoolExecutor"):
                name = "slices and blocks"
            elif name.startswith("camkit-writer"):
                name = "writer"
            seconds_of[name] += seconds
        return seconds_of


def run_again(arguments: argparse.Namespace) -> str:
    """Develop the capture once in a process of its own; give what it prints."""
    script = [sys.executable, "-m", "tools.stage_profile", "stages", str(arguments.capture)]
    script += ["--runs", "0", "--bundle", arguments.bundle, "--format", arguments.format]
    script += [] if arguments.size is None else ["--size", arguments.size]
    script += [] if arguments.method is None else ["--method", arguments.method]
    script += [] if arguments.threads is None else ["--threads", str(arguments.threads)]
    environment = {**os.environ, "NUMPY_MADVISE_HUGEPAGE": "0"}  # as the command has it
    return subprocess.run(
        script, capture_output=True, text=True, check=True, env=environment
    ).stdout


def profile_stages(arguments: argparse.Namespace) -> None:
    """Develop one capture in this process and say where wall, CPU and memory went."""
    runs = [json.loads(run_again(arguments)) for _ in range(arguments.runs)]
    if not runs:
        print(json.dumps(_profile_once(arguments)))
        return
    stages = list(runs[0]["wall"])
    print("| stage | wall s | CPU s | CPU / wall | RSS MB |\n|---|---|---|---|---|")
    for stage in stages:
        wall, cpu, rss = (
            statistics.median(run[key].get(stage, 0.0) for run in runs)
            for key in ("wall", "cpu", "rss_mb")
        )
        ratio = f"{cpu / wall:.2f}" if wall > 0.005 else ""
        memory = f"{rss:.0f}" if rss else ""  # shorter than the sampling: not seen
        print(f"| {stage} | {wall:.2f} | {cpu:.2f} | {ratio} | {memory} |")
    for key in ("all", "neither network nor FFT", "start", "peak MB", "process CPU"):
        print(f"| {key} | {statistics.median(run['total'][key] for run in runs):.2f} | | | |")
    print("\n| thread | CPU s |\n|---|---|")
    for name in sorted({k for run in runs for k in run["threads"]}):
        print(f"| {name} | {statistics.median(r['threads'].get(name, 0.0) for r in runs):.2f} |")


def _profile_once(arguments: argparse.Namespace) -> dict[str, Any]:
    keep_memory_for_good()  # as the command does
    began = time.perf_counter()
    choices = {"size": arguments.size, "method": arguments.method}
    pipeline = load(arguments.bundle, **choices, threads=arguments.threads)
    start_s = time.perf_counter() - began
    wall, cpu = {}, {}
    began, began_cpu = time.perf_counter(), _cpu_s()
    capture = pipeline.read(arguments.capture)
    wall["decode"] = time.perf_counter() - began
    cpu["decode"] = _cpu_s() - began_cpu
    work = pipeline.start(capture)
    with _watched(work.clock) as threads:
        wall |= _written(work, arguments.format)
        all_s = time.perf_counter() - began
    cpu |= work.clock.cpu_seconds
    rest = all_s - sum(seconds for name, seconds in wall.items() if name.split()[0] in TRANSFORMS)
    total = {"all": all_s, "neither network nor FFT": rest, "start": start_s}
    total["peak MB"] = max(peak_rss_mb(), capture.decoder_peak_mb)
    total["process CPU"] = _cpu_s()
    return {
        "wall": wall,
        "cpu": cpu,
        "rss_mb": threads.rss_mb,
        "threads": threads.by_thread(),
        "total": total,
        "size_px": work.shape[:0:-1],
    }


@contextmanager
def _watched(clock: StageClock) -> Iterator[ThreadWatch]:
    """Measure the work of the block from a thread beside it."""
    thread_watch, ended = ThreadWatch(clock), threading.Event()

    def watch() -> None:
        while not ended.wait(WATCH_S):
            thread_watch.take()

    watcher = threading.Thread(target=watch, name="profile")
    watcher.start()
    try:
        yield thread_watch
    finally:
        ended.set()
        watcher.join()


def _written(work: Reconstruction, format_: str) -> dict[str, float]:
    """Write the picture of a capture and throw it away; give the wall seconds of every stage."""
    _, height, width = work.shape
    picture = PictureFormat(
        width=width, height=height, color=work.color, orientation=work.capture.orientation
    )
    with tempfile.TemporaryDirectory() as folder:
        with atomic_output(Path(folder) / f"picture.{format_}") as part:
            waited = 0.0
            with open_writer(part, format_, picture) as writer:
                with BandQueue(writer) as queue:
                    for band in work.bands():
                        start_s = time.perf_counter()
                        queue.write(band)
                        waited += time.perf_counter() - start_s
                    start_s = time.perf_counter()
                waited += time.perf_counter() - start_s
            wall = {**work.seconds, "write": waited}
            start_s = time.perf_counter()
            file_sha256(part)
            wall["hash"] = time.perf_counter() - start_s
            start_s = time.perf_counter()
        wall["sync"] = time.perf_counter() - start_s
    return wall


def _cpu_s() -> float:
    """Return the processor time of this process and of the children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def profile_layers(arguments: argparse.Namespace) -> None:
    """Measure the networks of every role."""
    bundle = open_bundle(find_bundle(arguments.bundle))
    for role in bundle.manifest.networks:
        _profile_network(arguments, bundle, role)


def _profile_network(arguments: argparse.Namespace, bundle: Bundle, role: str) -> None:
    """Measure every node of a network on one window and compare it with the matrix product."""
    threads = available_threads(arguments.threads)
    facts = bundle.network_facts(role, arguments.size)
    data = bundle.network_bytes(role, arguments.size)
    times, operators = _node_seconds(data, facts, threads)
    all_macs, macs = _count_macs(data, SIDE_PX)
    peak = gemm_peak_gmac_per_s(threads)
    total = sum(times.values())
    print(
        f"{arguments.bundle} {role} {arguments.size}, {SIDE_PX}x{SIDE_PX}, {threads} thread(s); "
        f"matrix product {peak:.0f} GMAC/s, nodes {total * 1e3:.0f} ms"
    )
    print(
        "| node | kind | ms | share | GMAC/s | of the matrix product |\n|---|---|---|---|---|---|"
    )
    for name, seconds in sorted(times.items(), key=lambda item: -item[1]):
        mac = next((macs[key] for key in _keys(name) if key in macs), 0.0)
        speed = f"{mac / seconds / 1e9:.0f} | {mac / seconds / 1e9 / peak:.0%}" if mac else " | "
        milliseconds = f"{seconds * 1e3:.1f} | {seconds / total:.1%}"
        print(f"| {name} | {operators[name]} | {milliseconds} | {speed} |")
    done = all_macs / total / 1e9
    print(f"| all | | {total * 1e3:.1f} | | {done:.0f} | {done / peak:.0%} |")


def _node_seconds(
    data: bytes, facts: NetworkFacts, threads: int
) -> tuple[dict[str, float], dict[str, str]]:
    """Return the seconds of every node on a square window, the median, and its operator."""
    import onnxruntime as ort

    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.enable_mem_pattern = False
    options.enable_profiling = True
    options.log_severity_level = 4
    shape = (1, facts.input_channels, SIDE_PX, SIDE_PX)
    window = np.random.default_rng(0).random(shape, dtype=np.float32)
    with tempfile.TemporaryDirectory() as folder:
        options.profile_file_prefix = str(Path(folder) / "ort")
        session = ort.InferenceSession(data, options, providers=["CPUExecutionProvider"])
        for _ in range(8):
            session.run(None, {facts.input_name: window})
        events = json.loads(Path(session.end_profiling()).read_text(encoding="utf-8"))
    times: dict[str, list[float]] = defaultdict(list)
    operators: dict[str, str] = {}
    for event in events:
        if event.get("cat") == "Node" and event["name"].endswith("_kernel_time"):
            name = event["name"].removesuffix("_kernel_time")
            times[name].append(event["dur"] / 1e6)
            operators[name] = event["args"].get("op_name", "")
    return {name: statistics.median(t[2:] or t) for name, t in times.items()}, operators


def _keys(name: str) -> tuple[str, ...]:
    """Return names under which an optimised node may stand in the graph as exported."""
    plain = name.removesuffix("_nchwc").removesuffix("_token")
    return name, plain


def _count_macs(data: bytes, side: int) -> tuple[float, dict[str, float]]:
    """Count the multiplications of all convolutions on a square window, and of each by name.

    A convolution that is fused with the activation behind it runs under the name of that one.
    """
    import onnx

    model = onnx.load_from_string(data)
    for axis in (2, 3):
        model.graph.input[0].type.tensor_type.shape.dim[axis].dim_value = side
    for dim in model.graph.output[0].type.tensor_type.shape.dim[2:]:
        dim.Clear()
    inferred = onnx.shape_inference.infer_shapes(model)
    shapes = {
        value.name: [d.dim_value for d in value.type.tensor_type.shape.dim]
        for value in (*inferred.graph.value_info, *inferred.graph.output)
    }
    weights = {tensor.name: list(tensor.dims) for tensor in model.graph.initializer}
    by_output: dict[str, float] = {}
    by_name: dict[str, float] = {}
    for node in model.graph.node:
        if node.op_type == "Conv" and node.input[1] in weights:
            _, depth, *kernel = weights[node.input[1]]
            size = float(np.prod(shapes[node.output[0]]) * depth * np.prod(kernel))
            by_output[node.output[0]] = by_name[node.name or node.output[0]] = size
        elif node.op_type in ACTIVATIONS and node.input[0] in by_output:
            by_name[node.name or node.output[0]] = by_output[node.input[0]]
    return sum(by_output.values()), by_name


if __name__ == "__main__":
    main()
