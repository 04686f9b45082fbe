"""ADMM with total variation of deepinv, in an environment of its own; it imports nothing of camkit.

    PYTHON_OF_DEEPINV tools/methods/deepinv_worker.py

A line "b weight step rounds" comes (weight of the total variation, step size, iterations), behind
it a part (3, b, b) and its kernels (3, b, b) with their middles at b // 2, float32; back go the
restored part and the CPU-seconds of the process so far, float64.
"""

import sys
import time

import deepinv
import numpy as np
import torch

TV_ROUNDS = 20
"""Of the inner solution; deepinv's own 1000 would take minutes a part."""


def main() -> None:
    """Restore parts until there are no more."""
    torch.set_num_threads(1)
    source, sink = sys.stdin.buffer, sys.stdout.buffer
    while line := source.readline():
        side, weight, step, rounds = map(float, line.split())
        shape = (1, 3, int(side), int(side))
        size = 4 * int(np.prod(shape))
        blurred, filters = (
            torch.from_numpy(np.frombuffer(source.read(size), np.float32).reshape(shape).copy())
            for _ in range(2)
        )
        model = deepinv.optim.ADMM(
            data_fidelity=deepinv.optim.L2(),
            prior=deepinv.optim.TVPrior(n_it_max=TV_ROUNDS),
            lambda_reg=weight,
            stepsize=step,
            max_iter=int(rounds),
        )
        with torch.no_grad():
            restored = model(blurred, deepinv.physics.BlurFFT(shape[1:], filters))
        sink.write(restored.numpy().astype(np.float32).tobytes())
        sink.write(np.float64(time.process_time()).tobytes())
        sink.flush()


if __name__ == "__main__":
    main()
