"""Half precision: do the numbers inside the network still fit when the light is far above white?"""

import numpy as np

from camkit.report.stress.rig import Rig
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, Outcome, Verdict
from camkit.report.stress.twin import NOMINAL_ISO
from camkit.runtime.network.ranges import node_activations
from camkit.runtime.signal.stabilise import stabilise

FP16_MAX = 65504.0
SIDE_PX = 256


def _measure(judge: Judge, scene: Scene, value: float) -> Verdict:
    """Run each network on light that no sensor clipped, and look at its largest activation."""
    rig: Rig = judge.rig
    light = rig.light(scene)
    noise = rig.bundle.manifest.camera.noise_at(NOMINAL_ISO).with_gains(light.gains)
    planes = light.planes[:, :SIDE_PX, :SIDE_PX] * np.float32(2.0**value)
    outcomes = {}
    for network in rig.networks:
        given = np.concatenate([stabilise(planes, noise, scale=network.scale)] * 2)[None]
        side = SIDE_PX // network.bundle.network_facts(network.size).stride_px
        side *= network.bundle.network_facts(network.size).stride_px
        model = network.bundle.network_bytes(network.size)
        window = np.ascontiguousarray(given[:, :, :side, :side])
        largest = max(node_activations(model, [window]).values())
        fits = np.isfinite(largest) and largest < FP16_MAX
        outcomes[network.name] = Outcome(
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
    rival=False,
    note="Float light above white (HDR input); the largest fp32 activation against 65504. A CPU "
    "run of the fp16 graph proves nothing, since it computes in fp32.",
)
