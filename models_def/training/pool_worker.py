"""The process that makes samples: python -m camkit.models_def.training.pool_worker FOLDER 0/1."""

import select
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Final

import torch

from camkit.models_def.training.pool import POLL_S, PoolFiles, read_job

REPORT_S: Final = 0.2


def work(folder: Path, share: tuple[int, int]) -> None:
    """Make samples up to the goal until the trainer stops the worker or is gone."""
    torch.set_num_threads(1)
    files, maker = read_job(folder).open()
    threading.Thread(target=_report, args=(files, share[0]), daemon=True).start()
    while files.goal[0] >= 0 and not _parent_is_gone():
        index = files.next_missing(share)
        if index is None:
            time.sleep(POLL_S)
        else:
            files.store(index, maker.make(index))


def _report(files: PoolFiles, number: int) -> None:
    """Report the CPU time so far to the trainer, also while a sample is being made."""
    while files.goal[0] >= 0:
        files.cpu_s[number] = time.process_time()
        time.sleep(REPORT_S)


def _parent_is_gone() -> bool:
    """Return whether the other end of stdin is closed; the trainer never writes to it."""
    readable, _, _ = select.select([sys.stdin], [], [], 0)
    return bool(readable)


if __name__ == "__main__":
    # Ctrl-C reaches the whole group; the trainer ends its workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    worker, workers = sys.argv[2].split("/")
    work(Path(sys.argv[1]), (int(worker), int(workers)))
