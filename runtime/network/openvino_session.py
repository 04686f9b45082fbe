"""The only door to openvino: a session like that of onnxruntime, in float32 or bfloat16.

openvino is an extra. Its telemetry, which reports every import, is kept out. A network is compiled
for the size of its windows (tens of milliseconds), since kernels for any size are slower;
the windows of a picture have one size. Its last compilation is kept: others would hold the
memory of their activations beside it.
"""

import logging
import sys
import threading
from collections.abc import Sequence
from functools import cache
from importlib import util
from typing import Any, Final, NamedTuple

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import BundleError, ContractError, UnsupportedError
from camkit.runtime.cancel import Cancel, watched
from camkit.runtime.machine.processor import BFLOAT16_FLAGS, lacks_bfloat16, processor_fact

logger = logging.getLogger(__name__)
INSTALLED_BY: Final = "pip install 'camkit[openvino]'"
_TELEMETRY: Final = "openvino_telemetry"


class End(NamedTuple):
    """An input or output, as onnxruntime states it."""

    name: str
    type: str
    shape: list[int | str]


def has_openvino() -> bool:
    """Return whether openvino is installed."""
    return util.find_spec("openvino") is not None


def openvino_facts() -> tuple[str, str]:
    """Return the processor as openvino names it, and openvino with its version."""
    name = _core().get_property("CPU", "FULL_DEVICE_NAME")
    return str(name).strip(), f"openvino {_openvino().__version__.split('-')[0]}"


def missing_bfloat16() -> str | None:
    """Return what this machine lacks for bfloat16, for people; None if it lacks nothing."""
    if not has_openvino():
        return f"the package openvino ({INSTALLED_BY})"
    devices = _core().get_property("CPU", "OPTIMIZATION_CAPABILITIES")
    if lacks_bfloat16() or "BF16" not in devices:
        name = processor_fact("model name") or "this one"
        return f"a processor with {' or '.join(BFLOAT16_FLAGS)} ({name} has neither)"
    return None


class OpenvinoSession:
    """One network on openvino's CPU; callers from many threads wait for each other."""

    def __init__(self, model: bytes, *, threads: int, bfloat16: bool) -> None:
        """Read a model.

        Args:
            model: Serialised ONNX model with the weights inside.
            threads: Threads of a run.
            bfloat16: Multiply in bfloat16; float32 otherwise.

        Raises:
            BundleError: If the model is refused.
            UnsupportedError: If openvino is not installed, or the machine has no bfloat16.
        """
        if not has_openvino():
            raise UnsupportedError(
                f"{option_text('provider', 'openvino')} needs the package openvino: run "
                f"{INSTALLED_BY}, or use {option_text('provider', 'cpu')}"
            )
        if bfloat16 and (missing := missing_bfloat16()) is not None:
            raise UnsupportedError(
                f"{option_text('dtype', 'bf16')} needs {missing}; use "
                f"{option_text('dtype', 'fp32')}"
            )
        from camkit.runtime.network.graph import parse_graph  # a start on the CPU spares onnx

        parse_graph(model)  # openvino would read files that a model names
        self._settings = {
            "INFERENCE_PRECISION_HINT": "bf16" if bfloat16 else "f32",
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
            "ENABLE_CPU_PINNING": False,
        }
        try:
            self._network = _core().read_model(model)
        except RuntimeError as error:
            raise BundleError(f"openvino refused the network: {error}; export it again") from error
        self._lock = threading.Lock()
        self._shape: tuple[int, ...] | None = None
        self._request: Any = None

    def get_inputs(self) -> list[End]:
        """Return the inputs of the network."""
        return _ends(self._network.inputs)

    def get_outputs(self) -> list[End]:
        """Return the outputs of the network."""
        return _ends(self._network.outputs)

    def run_into(self, window: FloatArray, out: FloatArray, cancel: Cancel | None) -> None:
        """Run the network on one window.

        Args:
            window: (1, channels, h, w) float32, C-contiguous.
            out: (1, outputs, s h, s w) float32, C-contiguous, to be filled.
            cancel: Asked while the network runs.

        Raises:
            ContractError: If the size of window or output is not one of the network.
            Cancelled: If `cancel` said so.
        """
        ov = _openvino()
        with self._lock:
            try:
                request = self._compiled(window.shape)
                # by reference: openvino reads and writes the arrays themselves
                request.set_input_tensor(ov.Tensor(window, shared_memory=True))
                request.set_output_tensor(ov.Tensor(out, shared_memory=True))
                with watched(cancel, request.cancel):
                    request.infer()
            except RuntimeError as error:
                raise ContractError(
                    f"the network cannot run on a window of {window.shape}: {error}; "
                    "sides must be multiples of its stride"
                ) from error

    def _compiled(self, shape: tuple[int, ...]) -> Any:
        """Return the request of the network, compiled for a shape of its window."""
        if shape != self._shape:
            self._request, self._shape = None, None
            self._network.reshape(list(shape))
            compiled = _core().compile_model(self._network, "CPU", self._settings)
            self._request, self._shape = compiled.create_infer_request(), shape
        return self._request


def _ends(ports: Sequence[Any]) -> list[End]:
    return [
        End(
            name=port.get_any_name(),
            type="tensor(float)" if port.get_element_type().get_type_name() == "f32" else "other",
            shape=[side.get_length() if side.is_static else "?" for side in port.partial_shape],
        )
        for port in ports
    ]


@cache
def _core() -> Any:
    return _openvino().Core()


@cache
def _openvino() -> Any:
    """Import openvino without the package that reports the import to its makers."""
    if _TELEMETRY in sys.modules:
        logger.warning("openvino was imported before camkit, so its telemetry may be on")
        import openvino

        return openvino
    sys.modules[_TELEMETRY] = None  # type: ignore[assignment]
    try:
        import openvino
    finally:
        del sys.modules[_TELEMETRY]
    return openvino
