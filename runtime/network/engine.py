"""The only door to onnxruntime: one immutable session per model, safe to call from many threads."""

import logging
import math
import os
import sys
import threading
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import BundleError, ContractError, UnsupportedError
from camkit.runtime.cancel import Cancel, Cancelled, watched
from camkit.runtime.machine.memory import mapped_arrays
from camkit.runtime.machine.processor import processor_fact
from camkit.runtime.network.openvino_session import OpenvinoSession, has_openvino, openvino_facts
from camkit.runtime.network.segment import Segment

_IMPORTED_BEFORE = "onnxruntime" in sys.modules and "ORT_DISABLE_TELEMETRY" not in os.environ
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime as ort  # noqa: E402 - telemetry is switched off before the first import
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors  # noqa: E402

logger = logging.getLogger(__name__)
if _IMPORTED_BEFORE:
    logger.warning(
        "onnxruntime was imported before camkit first loaded a bundle, so its telemetry may be on; "
        "set ORT_DISABLE_TELEMETRY=1 in the environment"
    )

MINIMUM_VERSION: Final = (1, 24, 1)
PROVIDER_NAMES: Final = {
    "cpu": "CPUExecutionProvider",
    "cuda": "CUDAExecutionProvider",
    "tensorrt": "TensorrtExecutionProvider",
}
"""Names that a caller may ask of onnxruntime, and its own for them."""
OPENVINO: Final = "openvino"
_FALLBACKS: Final = {"tensorrt": ("cuda", "cpu"), "cuda": ("cpu",)}
_CREATION: Final = threading.Lock()
Memory = Literal["arena", "block", "shared"]
"""Of a session: an arena of its own, one block once sizes are known, the arena of all segments."""
_CGROUP: Final = Path("/sys/fs/cgroup")
_ORT_ERRORS: Final = (
    ort_errors.EPFail,
    ort_errors.Fail,
    ort_errors.InvalidArgument,
    ort_errors.InvalidGraph,
    ort_errors.InvalidProtobuf,
    ort_errors.NoModel,
    ort_errors.NoSuchFile,
    ort_errors.NotImplemented,
    ort_errors.RuntimeException,
)


def available_threads(requested: int | None = None) -> int:
    """Return the number of threads to compute with.

    Args:
        requested: The user's choice, or None for all that the machine grants.

    Returns:
        min(requested, CPUs this process may run on, CPU quota of its container), at least 1.

    Raises:
        ContractError: If fewer than one thread is requested.
    """
    if requested is not None and requested < 1:
        raise ContractError(f"threads must be >= 1; got {requested}")
    affinity = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    limits = [affinity, _quota_cpus(_CGROUP), requested]
    return max(1, min(limit for limit in limits if limit is not None))


def _quota_cpus(root: Path) -> int | None:
    """Read the container's CPU quota (cgroup v2, then v1), rounded up; None if there is none."""
    for names in (("cpu.max",), ("cpu/cpu.cfs_quota_us", "cpu/cpu.cfs_period_us")):
        try:
            words = " ".join((root / name).read_text() for name in names).split()
            quota, period = int(words[0]), int(words[1])
        except (OSError, ValueError, IndexError):
            continue
        if quota > 0 and period > 0:
            return math.ceil(quota / period)
    return None


def providers() -> tuple[str, ...]:
    """Return the providers of the installed onnxruntime, best first."""
    return tuple(ort.get_available_providers())


def usable_providers() -> tuple[str, ...]:
    """Return those of onnxruntime by the names of `PROVIDER_NAMES`, cpu first, then openvino."""
    return (*_built_in(), *[OPENVINO][: has_openvino()])


def _built_in() -> tuple[str, ...]:
    built = providers()
    return tuple(name for name, full in PROVIDER_NAMES.items() if full in built)


def device_and_library(provider: str) -> tuple[str, str]:
    """Return what a provider computes on, and the library with its version, for people."""
    if provider == OPENVINO:
        return openvino_facts()
    library = f"onnxruntime {ort.__version__}"
    if provider == "cpu":
        return processor_fact("model name") or "CPU", library
    listed: list[Any] = getattr(ort, "get_ep_devices", list)()
    devices = [one.device for one in listed if one.ep_name == PROVIDER_NAMES[provider]]
    if not devices:
        return "device 0", library
    return f"{devices[0].vendor} device {devices[0].device_id:#06x}", library


class NetworkEngine:
    """One network, ready to run: (1, channels, h, w) -> (1, outputs, s h, s w), float32.

    On the CPU the graph is optimised at level ALL, where every convolution takes the blocked path
    whose sums do not depend on the window; other providers promise no equal bits. Nothing is
    cached on disk.
    """

    def __init__(
        self,
        model: bytes,
        *,
        threads: int,
        provider: str = "cpu",
        scale: int = 1,
        block_bytes: float | None = None,
        bfloat16: bool = False,
    ) -> None:
        """Load a model.

        Args:
            model: Serialised ONNX model with the weights inside; never a path.
            threads: Threads per run, from `available_threads`.
            provider: Key of `PROVIDER_NAMES`, or openvino; arrays stay in the memory of the CPU.
            scale: Samples along a side of the output for one pixel of the input.
            block_bytes: Counted memory of a run per pixel (`block_bytes_per_pixel` of the graph):
                on the CPU its tensors then lie in one block of about that size, once onnxruntime
                has seen windows of a size. None for its arena, which takes fresh pages less often
                and may hold several times that.
            bfloat16: Multiply in bfloat16; for openvino alone.

        Raises:
            ContractError: If `model` is not bytes, threads or scale < 1.
            BundleError: If onnxruntime refuses the model or its inputs and outputs are not those
                of a network.
            UnsupportedError: If the installed onnxruntime is too old or lacks the provider, or
                the machine lacks bfloat16.
        """
        if not isinstance(model, bytes):
            raise ContractError(f"the model must be given as bytes; got {type(model).__name__}")
        if threads < 1 or scale < 1:
            raise ContractError(f"threads and scale must be >= 1; got {threads}, {scale}")
        self.block_bytes = block_bytes if provider == "cpu" else None
        self._session: Any
        if provider == OPENVINO:
            self._session = OpenvinoSession(model, threads=threads, bfloat16=bfloat16)
        else:
            _check_version(ort.__version__)
            with _CREATION:
                self._session = _create_session(
                    model,
                    threads,
                    provider,
                    memory="arena" if self.block_bytes is None else "block",
                )
        self._memory = nullcontext() if self.block_bytes is None else mapped_arrays
        self._model, self._cutting = model, threading.Lock()
        self._segments: tuple[SegmentEngine, ...] | None = None
        self.threads = threads
        self.provider = provider
        self.scale = scale
        self.channels, self.outputs = _check_contract(self._session)

    def run(
        self,
        window: FloatArray,
        out: FloatArray | None = None,
        *,
        cancel: Cancel | None = None,
    ) -> FloatArray:
        """Run the network on one window; may be called from many threads.

        Args:
            window: (1, channels, h, w) float32, C-contiguous, h and w multiples of the network's
                stride.
            out: (1, outputs, s h, s w) float32, C-contiguous, to be filled; None makes a new one.
            cancel: Asked while the network runs; true ends it between two of its nodes.

        Returns:
            `out`.

        Raises:
            ContractError: If shapes or types disagree, or onnxruntime refuses the size.
            Cancelled: If `cancel` said so.
        """
        window = self._checked(window)
        shape = (1, self.outputs, *(self.scale * side for side in window.shape[2:]))
        if out is None:
            out = np.empty(shape, np.float32)
        elif out.shape != shape or out.dtype != np.float32 or not out.flags.c_contiguous:
            raise ContractError(
                f"out must be C-contiguous float32 {shape}; got {out.dtype} {out.shape}"
            )
        if self.provider == OPENVINO:
            self._session.run_into(window, out, cancel)
        else:
            self._run_bound(window, out, cancel)
        return out

    def _run_bound(self, window: FloatArray, out: FloatArray, cancel: Cancel | None) -> None:
        """Run the session of onnxruntime, which reads and writes the arrays themselves."""
        binding = self._session.io_binding()
        binding.bind_cpu_input("input", window)
        binding.bind_output("output", "cpu", 0, np.float32, out.shape, out.ctypes.data)
        with self._memory:
            _run(self._session, binding, cancel, window.shape)

    def segments(self) -> tuple["SegmentEngine", ...]:
        """Return the network in segments with the same bits; none where it cannot be cut."""
        if self.provider != "cpu":
            return ()
        with self._cutting:
            if self._segments is None:
                # onnx takes a tenth of a second to import, and small pictures need no segments
                from camkit.runtime.network.graph_cuts import cut_network

                cut = cut_network(self._model)
                self._segments = tuple(SegmentEngine(one, threads=self.threads) for one in cut)
        return self._segments

    def _checked(self, window: FloatArray) -> FloatArray:
        if window.ndim != 4 or window.shape[:2] != (1, self.channels) or window.dtype != np.float32:
            raise ContractError(
                f"window must be float32 (1, {self.channels}, h, w); "
                f"got {window.dtype} {window.shape}"
            )
        return np.ascontiguousarray(window)


class SegmentEngine:
    """One segment of a network, ready to run on strips of whole rows; float32, on the CPU.

    All segments take their memory from one arena of the process: they run one after another.
    """

    def __init__(self, segment: Segment, *, threads: int) -> None:
        """Load a segment.

        Args:
            segment: Of `cut_network`.
            threads: Threads per run, from `available_threads`.

        Raises:
            BundleError: If onnxruntime refuses it.
        """
        self.segment = segment
        with _CREATION:
            _share_arena()
            self._session = _create_session(segment.model, threads, memory="shared")

    def run(self, inputs: Sequence[FloatArray]) -> list[FloatArray]:
        """Run the segment on one strip.

        Args:
            inputs: (1, c, rows, w) float32, C-contiguous, in the order of its feeds.

        Returns:
            (1, c, rows, w) of every output.

        Raises:
            ContractError: If onnxruntime refuses the strip.
        """
        first = self.segment.feeds[0]
        size_px = [side * first.step for side in inputs[0].shape[2:]]
        binding = self._session.io_binding()
        for feed, rows in zip(self.segment.feeds, inputs, strict=True):
            binding.bind_cpu_input(feed.name, rows)
        outputs = []
        for port in self.segment.outputs:
            shape = (1, port.channels, *(port.samples(side) for side in size_px))
            output = np.empty(shape, np.float32)
            binding.bind_output(port.name, "cpu", 0, np.float32, shape, output.ctypes.data)
            outputs.append(output)
        _run(self._session, binding, None, inputs[0].shape)
        return outputs


def largest_activations(
    model: bytes, names: Sequence[str], windows: Iterable[FloatArray]
) -> dict[str, float]:
    """Measure the largest |value| of tensors inside a network.

    Args:
        model: A model in which these tensors are outputs (see `graph.with_node_outputs`).
        names: Tensors to measure.
        windows: (1, channels, h, w) float32 inputs.

    Returns:
        Largest |value| by name over all windows; NaN where one occurred.

    Raises:
        BundleError: If onnxruntime refuses the model, or cannot run it.
    """
    with _CREATION:
        session = _create_session(model, available_threads(None))
    largest = dict.fromkeys(names, 0.0)
    for window in windows:
        try:
            values = session.run(list(names), {"input": window})
        except (RuntimeError, *_ORT_ERRORS) as error:
            raise BundleError(
                f"the network cannot run on a window of {window.shape}: {error}; export it again"
            ) from error
        for name, value in zip(names, values, strict=True):
            largest[name] = float(np.maximum(largest[name], np.abs(value).max(initial=0)))
    return largest


def tensor_values(
    model: bytes, names: Sequence[str], feeds: Mapping[str, NDArray[Any]]
) -> dict[str, Any]:
    """Return tensors of a model that need not be admissible yet, computed as it stands.

    Args:
        model: A model in which these tensors are outputs.
        names: Tensors to return.
        feeds: Inputs by name.

    Raises:
        BundleError: If onnxruntime refuses the model, or cannot run it.
    """
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 4
    try:
        session = ort.InferenceSession(model, options, providers=[PROVIDER_NAMES["cpu"]])
        values = session.run(list(names), dict(feeds))
    except (RuntimeError, *_ORT_ERRORS) as error:
        raise BundleError(f"onnxruntime cannot run it: {error}") from error
    return dict(zip(names, values, strict=True))


def _run(session: Any, binding: Any, cancel: Cancel | None, shape: tuple[int, ...]) -> None:
    """Run a session until it is done or cancelled.

    Raises:
        ContractError: If onnxruntime refuses the size.
        Cancelled: If `cancel` said so.
    """
    running = ort.RunOptions()

    def end() -> None:
        running.terminate = True

    try:
        with watched(cancel, end):
            session.run_with_iobinding(binding, running)
    except Cancelled:
        raise
    except (RuntimeError, *_ORT_ERRORS) as error:
        raise ContractError(
            f"the network cannot run on a window of {shape}: {error}; "
            "sides must be multiples of its stride"
        ) from error


@cache
def _share_arena() -> None:
    """Make the arena of all segments; once a process."""
    arena = ort.OrtMemoryInfo(
        "Cpu", ort.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, ort.OrtMemType.DEFAULT
    )
    # 1: grow by what is asked for, not by powers of two
    ort.create_and_register_allocator(arena, ort.OrtArenaCfg({"arena_extend_strategy": 1}))


def _check_version(version: str) -> None:
    parts = tuple(int(p) for p in version.split("+", maxsplit=1)[0].split(".")[:3] if p.isdigit())
    if parts < MINIMUM_VERSION:
        raise UnsupportedError(
            f"onnxruntime >= {'.'.join(map(str, MINIMUM_VERSION))} is needed; got {version}: "
            "older ones read files named inside a model; run 'pip install -U onnxruntime'"
        )


def _create_session(
    model: bytes, threads: int, provider: str = "cpu", *, memory: Memory = "arena"
) -> Any:
    candidates = _chosen_providers(provider)
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_ENABLE_ALL
    options.enable_mem_pattern = memory == "block"
    options.enable_cpu_mem_arena = memory != "block"
    if memory == "shared":
        options.add_session_config_entry("session.use_env_allocators", "1")
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4  # errors reach the caller as exceptions, not on stderr
    try:
        session = ort.InferenceSession(model, options, providers=candidates)
    except _ORT_ERRORS as error:
        raise BundleError(f"onnxruntime refused the network: {error}; export it again") from error
    # onnxruntime goes on without a provider whose libraries do not load.
    if PROVIDER_NAMES[provider] not in session.get_providers():
        raise UnsupportedError(
            f"onnxruntime has the provider {provider}, but it does not start here; check its "
            "driver and libraries, or use cpu"
        )
    return session


def _chosen_providers(provider: str) -> list[str | tuple[str, dict[str, str]]]:
    """Return the provider with those that take the nodes it does not know.

    Raises:
        UnsupportedError: If the installed onnxruntime lacks the provider.
    """
    usable = _built_in()
    if provider not in usable:
        raise UnsupportedError(
            f"this installation computes on {', '.join(usable_providers())}; got {provider!r}: "
            "install an onnxruntime built with it, or use one of these"
        )
    names = [name for name in (provider, *_FALLBACKS.get(provider, ())) if name in usable]
    # TF32 would round float32 to 10 bits and still be called fp32.
    settings = {"cuda": {"use_tf32": "0"}}
    return [
        (PROVIDER_NAMES[name], settings[name]) if name in settings else PROVIDER_NAMES[name]
        for name in names
    ]


def _check_contract(session: Any) -> tuple[int, int]:
    """Return the channels of input and output."""
    inputs, outputs = session.get_inputs(), session.get_outputs()
    names = [v.name for v in inputs], [v.name for v in outputs]
    types = {v.type for v in (*inputs, *outputs)}
    if names != (["input"], ["output"]) or types != {"tensor(float)"}:
        raise BundleError(
            f'a network has one float "input" and one float "output"; got {names}, {types}'
        )
    shape, out_shape = inputs[0].shape, outputs[0].shape
    is_valid = all(len(s) == 4 and s[0] == 1 and isinstance(s[1], int) for s in (shape, out_shape))
    if not is_valid:
        raise BundleError(
            "a network maps (1, channels, h, w) to (1, channels, h, w), channels stated; "
            f"got {shape} to {out_shape}"
        )
    return shape[1], out_shape[1]
