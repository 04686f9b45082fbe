"""Half precision: do the numbers inside the network still fit when the light is far above white?"""

from dataclasses import replace
from typing import Final

import numpy as np

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.report.stress.rig import Method, Rig
from camkit.report.stress.scenario import Scenario, has_networks
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.verdict import Outcome, Verdict
from camkit.runtime.capture import Capture
from camkit.runtime.network.ranges import node_activations
from camkit.runtime.twin.exposure import signal_of
from camkit.runtime.twin.light import crop_light

FP16_MAX: Final = 65504.0
SIDE_PX: Final = 256


def unclipped(rig: Rig, scene: Scene, factor: float) -> Capture:
    """Return capture of light times a factor that no converter clipped: float samples, no noise."""
    whole = rig.light(scene)
    width, height = whole.window.size_px
    light = crop_light(whole, (min(SIDE_PX, width), min(SIDE_PX, height)))
    capture = rig.record(scene, light).capture
    black, white = np.float32(rig.sensor.black_level), np.float32(rig.sensor.white_level)
    signal = signal_of(light, rig.sensor) * np.float32(factor)
    return replace(capture, samples=(black + signal * (white - black)).astype(np.float32))


def largest_activation(method: Method, capture: Capture) -> float:
    """Return the largest |activation| of the networks of a method, on what they are given.

    Raises:
        ContractError: If a network in front of another gives what is not believed.
    """
    bundle, size = method.bundle, method.pipeline.size
    assert size is not None
    work, found = method.pipeline.start(capture), 0.0
    for role in bundle.manifest.networks:
        stride_px = bundle.network_facts(role, size).stride_px
        window = _whole_cells(work.network_input(role), stride_px)
        largest = node_activations(bundle.network_bytes(role, size), [window[None]])
        found = max(found, *largest.values())
    return found


def _whole_cells(planes: FloatArray, stride_px: int) -> FloatArray:
    height, width = (side // stride_px * stride_px for side in planes.shape[1:])
    return np.ascontiguousarray(planes[:, :height, :width])


def _measure(judge: Judge, scene: Scene, value: float) -> Verdict:
    """Run each network on light that no sensor clipped, and look at its largest activation."""
    capture = unclipped(judge.rig, scene, 2.0**value)
    outcomes = {}
    for method in judge.rig.networks:
        try:
            largest = largest_activation(method, capture)
        except ContractError as error:
            outcomes[method.name] = Outcome(psnr_db=None, fault=str(error))
            continue
        fits = np.isfinite(largest) and largest < FP16_MAX
        outcomes[method.name] = Outcome(
            psnr_db=None,
            fault=None if fits else f"an activation of {largest:.3g}, fp16 ends at {FP16_MAX:g}",
            extra={"max_activation": largest},
        )
    return Verdict(outcomes=outcomes)


SCENARIO = Scenario(
    name="fp16_range",
    title="Range of half precision",
    knob="light_ev",
    unit="EV",
    values=(0.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0, 20.0),
    nominal=0.0,
    quick=(0.0, 8.0),
    measure=_measure,
    applies=has_networks,
    rival=False,
    note="Float light above white (HDR input); the largest fp32 activation against 65504. A CPU "
    "run of the fp16 graph proves nothing, since it computes in fp32.",
)
