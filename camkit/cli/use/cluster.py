"""The cluster that `process` was given: a scheduler's, or workers of its own."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from camkit.errors import ContractError

if TYPE_CHECKING:
    from distributed import Client


@contextmanager
def cluster_client(
    scheduler: str | None, workers: int | None, jobs: int
) -> "Iterator[Client | None]":
    """Return a client of dask.distributed; None where this process makes the pictures.

    Raises:
        ContractError: If both are given, or jobs beside one of them, or no scheduler answers.
        UnsupportedError: If dask.distributed is not installed.
    """
    if scheduler is None and workers is None:
        yield None
        return
    if scheduler is not None and workers is not None:
        raise ContractError("--scheduler has workers of its own; leave --workers out")
    if jobs > 1:
        raise ContractError("--jobs are those of one process; leave it out with workers")
    from camkit.runtime.batch.cluster.connection import connected, own_workers

    _quiet()
    with connected(scheduler) if scheduler is not None else own_workers(workers or 0) as client:
        yield client


def _quiet() -> None:
    """Keep dask's own messages from the terminal: camkit prints its own."""
    for name in ("distributed", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
