"""deepinv beside camkit: part by part in a process of an environment of its own.

It sees what the classical methods of `tools.comparison.peers` see: tapered parts with the kernels
of their places.
"""

import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np
import scipy.fft

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.bank.blocks import Block, BlockBank
from tools.comparison.peers import LocalCapture, part_sides

TV_WEIGHT: Final = 10.0
"""Of the total variation, in the variance of the noise at the mean of a part. With the step size
the best of 3 x 3 on one picture of `valid_open` at ISO 100, 0.02 dB off the best at ISO 1600."""
STEP_SIZE: Final = 300.0
ROUNDS: Final = 12


class SeparatePeer:
    """ADMM-TV of deepinv as a method of planes; a context manager, since it owns a process."""

    def __init__(self, python: Path) -> None:
        """Start the process.

        Args:
            python: Interpreter of the environment that has deepinv.

        Raises:
            ContractError: If there is none.
        """
        command = [str(python), deepinv_worker_path()]
        try:
            self._worker = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=Path.home()
            )
        except OSError as error:
            raise ContractError(f"cannot start {python}: {error.strerror}") from error
        self._worker_s = 0.0

    def __enter__(self) -> "SeparatePeer":
        return self

    def __exit__(self, *_: object) -> None:
        """End the process."""
        with suppress(OSError):
            self._worker.communicate()

    def cpu_s(self) -> float:
        """Return the CPU time of both processes so far."""
        return time.process_time() + self._worker_s

    def restore(self, capture: LocalCapture) -> FloatArray:
        """Restore a developed capture.

        Raises:
            ContractError: If the process has ended.
        """
        part_px, overlap_px = part_sides(capture.psf.kernels.kernels.shape[-1])

        def restored(block: Block) -> FloatArray:
            return self._restored(block, capture)

        bank = BlockBank(capture.psf, restored, block_px=part_px, overlap_px=overlap_px)
        return bank.restore_array(capture.planes)

    def _restored(self, block: Block, capture: LocalCapture) -> FloatArray:
        side = block.samples.shape[-1]
        kernels = scipy.fft.irfft2(block.otf, s=(side, side))
        kernels = np.roll(kernels, (side // 2, side // 2), axis=(-2, -1))
        noise, mean = capture.noise, np.maximum(block.samples.mean((1, 2)), 0)
        variance = np.mean(np.array(noise.shot) * mean + np.array(noise.read_variance))
        line = f"{side} {TV_WEIGHT * variance} {STEP_SIZE} {ROUNDS}\n".encode()
        source, sink = self._worker.stdout, self._worker.stdin
        assert source is not None
        assert sink is not None
        try:
            sink.write(line + block.samples.tobytes() + kernels.astype(np.float32).tobytes())
            sink.flush()
            planes, seconds = source.read(block.samples.nbytes), source.read(8)
            self._worker_s = float(np.frombuffer(seconds, np.float64)[0])
        except (OSError, IndexError, ValueError) as error:
            raise ContractError(
                "the process of deepinv has ended; its message stands above"
            ) from error
        return np.frombuffer(planes, np.float32).reshape(block.samples.shape)


def deepinv_worker_path() -> str:
    """Return the script that the other environment runs."""
    return str(Path(__file__).with_name("deepinv_worker.py"))
