"""A worker process of a pool whose captures end as their names say; the others are made."""

import os
import signal
import time
from pathlib import Path
from typing import Any

from camkit.errors import MemoryCapError
from camkit.runtime.batch import pool_worker
from camkit.runtime.cancel import Cancelled
from camkit.runtime.output.part_file import part_path

COMMAND = "from tests.faulty_worker import main; main()"
_make_file = pool_worker.make_file


def _die(target: Path) -> None:
    part_path(target).write_bytes(b"half a picture")
    os.kill(os.getpid(), signal.SIGKILL)


def _make(source: Path, target: Path, *rest: Any, cancel: Any, **named: Any) -> Any:
    match source.stem:
        case "die":
            _die(target)
        case "die-once" if not source.with_suffix(".died").exists():
            source.with_suffix(".died").touch()
            _die(target)
        case "wait":
            named["progress"](1, 4)
            while not cancel.is_set():
                time.sleep(0.01)
            raise Cancelled("stopped on request")
        case "hang":
            named["progress"](1, 4)
            time.sleep(60)
        case "cap":
            raise MemoryCapError("raise the cap", 123_456_789)
        case "lack":
            raise MemoryError
        case "fault":
            raise ZeroDivisionError("of nobody")
    return _make_file(source, target, *rest, cancel=cancel, **named)


def main() -> None:
    pool_worker.make_file = _make
    pool_worker.main()
