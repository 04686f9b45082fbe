"""Threads of torch for work of many small steps, such as aiming rays.

Two threads took 97 CPU-seconds for a freeze that one does in 8: they wait for each other after
every step (`camkit make` of a double Gauss, 2 cores of an AMD EPYC, torch 2.13).
"""

import contextlib
from collections.abc import Iterator

import torch


@contextlib.contextmanager
def one_torch_thread() -> Iterator[None]:
    """Yield while torch computes on one thread, and set the number that there was before."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
