"""What bank and network cost besides multiplications: the constants of `runtime/plan/tiers.py`.

    seconds = k * pixels * (develop + bank + fixed + multiplications of the network)

Two sizes of network give k and the fixed part, the picture without a network the bank.
"""

import time
from dataclasses import dataclass

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.runtime.plan.loss import EXACT
from camkit.runtime.twin.simulate import Simulation
from tools.plan.cells import PLAIN_TARGET, WIENER_TARGET, pipelines, start


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredWork:
    """Work per pixel, in multiplications of a network that take as long.

    Attributes:
        bank: Of the bank.
        fixed: Of a network besides its multiplications.
        ns: CPU nanoseconds of a multiplication.
    """

    bank: float
    fixed: float
    ns: float


def measure_work(
    bundle: Bundle, simulation: Simulation, small: str, macs: tuple[float, float], *, runs: int
) -> MeasuredWork:
    """Time a capture without clipped samples behind every tier, in turn, and give the medians.

    Args:
        bundle: With a reference size and a smaller one.
        simulation: The capture.
        small: The smaller size.
        macs: Multiplications per pixel of the reference size and of the smaller one.
        runs: How often.

    Raises:
        ContractError: If the larger network was not slower.
    """
    targets = pipelines(bundle)
    seconds: dict[str, list[float]] = {target: [] for target in targets}
    for _ in range(runs):
        for target, pipeline in targets.items():
            began = time.process_time()
            start(pipeline, simulation).fill(None)
            seconds[target].append(time.process_time() - began)
    pixels = simulation.samples.shape[-2] * simulation.samples.shape[-1]
    times = {target: np.array(values) / pixels for target, values in seconds.items()}
    per_mac = float(np.median(times[EXACT] - times[small])) / (macs[0] - macs[1])
    if per_mac <= 0:
        raise ContractError("the larger network was no slower; give a larger capture or more runs")
    bank = float(np.median(times[WIENER_TARGET] - times[PLAIN_TARGET])) / per_mac
    network = float(np.median(times[small] - times[WIENER_TARGET])) / per_mac
    return MeasuredWork(bank=bank, fixed=network - macs[1], ns=1e9 * per_mac)
