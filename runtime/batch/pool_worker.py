"""A process of a `WorkerPool`: one camera loaded, then one capture after the other.

    <- stdin: bundle and options; then an `Order` for each capture, STOP for the one under way,
       None to end
    -> stdout: READY; then (work done, work in all) while a capture is made, and its `FileResult`;
       an exception in place of READY or of a result

Messages are pickles, between a program and its own child alone. The end of stdin is the end of the
parent: the capture under way is given up, and the process ends.
"""

import contextlib
import os
import pickle
import queue
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Final

from camkit.errors import CamkitError, ContractError, WorkerError, unexpected
from camkit.runtime.batch.making import ELSEWHERE
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.development import FileResult, make_file
from camkit.runtime.output.claim import claimed
from camkit.runtime.output.writer import SUFFIXES
from camkit.runtime.pipeline import Pipeline, load
from camkit.runtime.write_options import WriteOptions

READY: Final = "ready"
STOP: Final = "stop"
GRACE_S: Final = 5.0
"""Time to give up a capture; a process that takes longer is ended."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """One capture, as `make_file` takes it."""

    source: Path
    target: Path
    write: WriteOptions
    mosaic: MosaicOptions | None


class _Talk:
    """The messages of this process, once it has its camera."""

    def __init__(self, pipe: BinaryIO, answers: BinaryIO) -> None:
        self.orders: queue.SimpleQueue[Order | None] = queue.SimpleQueue()
        self.stop = threading.Event()
        self._pipe, self._answers = pipe, answers

    def answer(self, message: object) -> None:
        """Send a message to the parent."""
        self._answers.write(pickle.dumps(message))
        self._answers.flush()

    def listen(self) -> None:
        """Queue orders until there are no more; then end this process, if it does not itself."""
        try:
            while (message := pickle.load(self._pipe)) is not None:
                if message == STOP:
                    self.stop.set()
                else:
                    self.stop.clear()
                    self.orders.put(message)
        except (EOFError, OSError, pickle.UnpicklingError):  # the parent is gone
            self.stop.set()
        self.orders.put(None)
        time.sleep(GRACE_S)
        os._exit(1)


def main() -> None:
    """Load a camera and make captures until the parent says otherwise, or is gone."""
    # libraries may print: keep the pipes to ourselves and send strays to stderr
    pipe, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    bundle, options = pickle.load(pipe)
    talk = _Talk(pipe, answers)
    threading.Thread(target=talk.listen, name="camkit-orders", daemon=True).start()
    try:
        try:
            pipeline = load(bundle, options=options)
        except (CamkitError, OSError) as error:
            talk.answer(error)
            return
        talk.answer(READY)
        while (order := talk.orders.get()) is not None:
            talk.answer(_answer_to(order, pipeline, talk))
    except BrokenPipeError:
        return  # the parent is gone


def _answer_to(order: Order, pipeline: Pipeline, talk: _Talk) -> FileResult | Exception:
    """Return the result of a capture, or why there is none."""
    try:
        return _make(order, pipeline, talk)
    except BrokenPipeError:
        raise
    except CamkitError as error:
        return error
    except OSError as error:
        text = f"cannot write the picture: {error.strerror or error}"
        return OSError(error.errno, text, str(order.target))
    except MemoryError as error:
        return WorkerError(f"not enough memory: {error}".rstrip(": "))
    except Exception as error:  # noqa: BLE001 - raised by the parent
        return WorkerError(unexpected(error))


def _make(order: Order, pipeline: Pipeline, talk: _Talk) -> FileResult:
    _check_suffix(order, pipeline)
    try:
        order.target.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise ContractError(
            f"{order.target.parent} is no folder; {order.target.name} needs one"
        ) from None
    with claimed(order.target) as ours:
        if not ours:
            raise ContractError(f"{order.target}: {ELSEWHERE}")
        return make_file(
            order.source,
            order.target,
            pipeline,
            order.write,
            mosaic=order.mosaic,
            progress=lambda done, total: talk.answer((done, total)),
            cancel=talk.stop,
            place="picture",
        )


def _check_suffix(order: Order, pipeline: Pipeline) -> None:
    """Refuse a picture whose suffix is not that of its format.

    Raises:
        ContractError: Names the suffix; without a format, each that the capture may have.
    """
    write, outputs = order.write, pipeline.part.outputs
    name = outputs.names(order.source, pipeline.options, write)[0]
    suffixes = {Path(name).suffix}
    if order.target.suffix in suffixes:
        return
    for format_ in SUFFIXES if write.format is None else ():
        with contextlib.suppress(ContractError):
            other = replace(write, format=format_)
            name = outputs.names(order.source, pipeline.options, other)[0]
            suffixes.add(Path(name).suffix)
    raise ContractError(
        f"{order.source.name} becomes a file in {' or '.join(sorted(suffixes))}; "
        f"got {order.target.name}"
    )
