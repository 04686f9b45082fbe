"""Compiled loops that are kept between processes, in the user's cache folder.

`torch.compile` keeps machine code between processes, but traces Python anew in each, which takes
most of the time of a lens. Here the whole loop is kept, by `aot_compile`: a later process reads it
and traces nothing. A file is of one layout of a lens, one version of torch, one kind of processor
and one state of the tracer's own files.
"""

import functools
import hashlib
import logging
import os
import pickle
import platform
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor

_LOG = logging.getLogger(__name__)
_RECOMPILATIONS: Final = 64
_FAULTS: Final = (
    *(RuntimeError, OSError, ImportError, pickle.PickleError, EOFError),
    *(AttributeError, TypeError, ValueError, LookupError, AssertionError),
)
"""Errors that the storing of a loop may raise, which is no part of torch that is settled."""

Loop = Callable[..., tuple[Tensor, ...]]
Layout = tuple[tuple[tuple[int, ...], torch.dtype], ...]


def layout_of(values: Sequence[Tensor]) -> Layout:
    """Return shapes and types of the tensors of a lens."""
    return tuple((tuple(value.shape), value.dtype) for value in values)


def stored_path(key: tuple[object, ...], suffix: str) -> Path:
    """Return the file of what depends on a key: in `XDG_CACHE_HOME` or `~/.cache`, camkit/tracer.

    Args:
        key: Of what is stored; torch, the processor and the tracer's own files are added.
        suffix: Of the file.
    """
    processor = (platform.system(), platform.machine(), torch.backends.cpu.get_cpu_capability())
    # torch guards a stored loop by the number of threads
    threads = torch.get_num_threads()
    whole = (key, torch.__version__, platform.python_version(), processor, threads, _own_files())
    digest = hashlib.sha256(repr(whole).encode()).hexdigest()[:32]
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "camkit" / "tracer" / f"{digest}.{suffix}"


class StoredLoop:
    """A function of tensors, compiled at its first call or read from an earlier process."""

    def __init__(self, function: Loop, key: tuple[object, ...]) -> None:
        """Keep the function, and what it depends on beside its inputs."""
        self._function, self._path = function, stored_path(key, "loop")
        self._stored: Loop | None = None
        self._compiled: Loop | None = None

    def __call__(self, *columns: Tensor) -> tuple[Tensor, ...]:
        """Run it without gradient; compiled in the usual way where it cannot be stored."""
        with torch.no_grad():
            if self._compiled is not None:
                return _patiently(self._compiled, columns)
            if self._stored is None:
                self._stored = self._read() or self._new_loop(columns)
            if self._stored is not None:
                try:
                    return self._stored(*columns)
                except RuntimeError as error:  # columns of another kind than the first ones
                    _LOG.debug("a stored loop does not fit: %s", error)
            self._compiled = torch.compile(self._function, fullgraph=True, dynamic=True)
            return _patiently(self._compiled, columns)

    def _read(self) -> Loop | None:
        if not hasattr(torch.compile(self._function), "aot_compile"):
            return None
        try:
            with self._path.open("rb") as file:
                if not _is_own(file.fileno()):
                    _LOG.debug("%s is another user's", self._path)
                    return None
                return torch.compiler.load_compiled_function(file)
        except FileNotFoundError:
            return None
        except _FAULTS as error:
            _LOG.debug("%s is not read: %s", self._path, error)
            return None

    def _new_loop(self, columns: tuple[Tensor, ...]) -> Loop | None:
        """Return the loop, compiled and stored; None where this torch cannot."""
        compiled: Any = torch.compile(self._function, fullgraph=True, dynamic=True)
        if len(columns[-1]) < 2 or not hasattr(compiled, "aot_compile"):
            return None  # a single ray would become a part of the loop
        from torch._dynamo import config

        try:
            with config.patch(specialize_float=True):
                loop = compiled.aot_compile((columns, {}))
        except _FAULTS as error:
            _LOG.debug("the loop is not to be stored: %s", error)
            return None
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=self._path.parent) as folder:
                whole = Path(folder) / self._path.name
                loop.save_compiled_function(str(whole))
                whole.chmod(0o600)
                whole.replace(self._path)
        except _FAULTS as error:
            _LOG.debug("the loop is not stored: %s", error)
        fitting: Loop = loop
        return fitting


def _is_own(file: int) -> bool:
    """Return whether an open file is the user's own, and nobody else may write it: it is code."""
    status = os.fstat(file)
    return not hasattr(os, "getuid") or (
        status.st_uid == os.getuid() and not status.st_mode & 0o022
    )


def _patiently(loop: Loop, columns: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
    """Run a compiled loop; allow as many layouts of lenses as a session may use."""
    # imported here: it takes a second that a plain trace need not wait for
    from torch._dynamo import config

    with config.patch(recompile_limit=_RECOMPILATIONS, specialize_float=True):
        return loop(*columns)


@functools.cache
def _own_files() -> str:
    """Return a digest of the files of the tracer."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
