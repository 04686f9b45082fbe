"""The process that makes samples: python -m camkit.models_def.training.pool_worker FOLDER 0/1."""

import select
import signal
import sys
import time
from pathlib import Path

import torch

from camkit.models_def.training.pool import POLL_S, read_job


def work(folder: Path, share: tuple[int, int]) -> None:
    """Make samples up to the goal until the trainer says stop or is gone."""
    torch.set_num_threads(1)
    files, maker = read_job(folder).open()
    while files.goal[0] >= 0 and not _parent_is_gone():
        index = files.next_missing(share)
        if index is None:
            time.sleep(POLL_S)
        else:
            files.store(index, maker.make(index))
            files.cpu_s[share[0]] = time.process_time()


def _parent_is_gone() -> bool:
    """Tell whether the other end of stdin is closed; the trainer never writes to it."""
    readable, _, _ = select.select([sys.stdin], [], [], 0)
    return bool(readable)


if __name__ == "__main__":
    # Ctrl-C reaches the whole group; the trainer ends its workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    worker, workers = sys.argv[2].split("/")
    work(Path(sys.argv[1]), (int(worker), int(workers)))
