"""The computation itself, whatever the camera sees: sizes, seams, half precision, gratings."""

from dataclasses import replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.report.stress.rig import Method, Rig
from camkit.report.stress.scenario import has_networks, row
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, see
from camkit.report.stress.shot import Shot
from camkit.report.stress.taking import showing
from camkit.report.stress.verdict import Outcome, Verdict
from camkit.runtime.capture import Capture
from camkit.runtime.network.ranges import node_activations
from camkit.runtime.twin.exposure import signal_of
from camkit.runtime.twin.light import crop_light

FP16_MAX: Final = 65504.0
SIDE_PX: Final = 256
MOST_MTF: Final = 1.1
"""Contrast above the scene's own is invented."""
MEAN, CONTRAST = 0.4, 0.6
BORDER_PX: Final = 64
WHOLE: Final = 1024.0


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
    work, peak = method.pipeline.start(capture), 0.0
    for role in bundle.manifest.networks:
        stride_px = bundle.network_facts(role, size).stride_px
        window = _whole_cells(work.network_input(role), stride_px)
        largest = node_activations(bundle.network_bytes(role, size), [window[None]])
        peak = max(peak, *largest.values())
    return peak


def _whole_cells(planes: FloatArray, stride_px: int) -> FloatArray:
    height, width = (side // stride_px * stride_px for side in planes.shape[1:])
    return np.ascontiguousarray(planes[:, :height, :width])


def _activations(judge: Judge, scene: Scene, value: float) -> Verdict:
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


def _cut(judge: Judge, scene: Scene, value: float) -> Shot:
    """Photograph a picture of few rows, judged up to its very borders."""
    rig = judge.rig
    height = round(value)
    width = min(height + height // 2, scene.size_px[0]) | 1 if height < 400 else scene.size_px[0]
    light = crop_light(rig.light(scene), (width, min(height, scene.size_px[1])))
    return replace(rig.record(scene, light), border_px=0)


def grating(scene: Scene, cycles_per_px: float) -> Scene:
    """Return a grey sine grating in place of a scene."""
    height, width = scene.linear.shape[1:]
    angle = np.pi * (scene.number % 8) / 8
    y, x = np.mgrid[:height, :width]
    phase = 2 * np.pi * cycles_per_px / scene.scale * (np.cos(angle) * x + np.sin(angle) * y)
    wave = (MEAN * (1 + CONTRAST * np.sin(phase))).astype(np.float32)
    return scene.showing(np.stack([wave] * 3), f"grating/{cycles_per_px:g}/{scene.name}")


def modulation(plane: FloatArray, truth: FloatArray) -> float:
    """Return the contrast of a picture at the frequencies of the truth, 1 for all of it."""
    inner = np.s_[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    got, true = (p[inner].astype(np.float64) for p in (plane, truth))
    got, true = got - got.mean(), true - true.mean()
    return float((got * true).sum() / np.square(true).sum())


_shoot_grating = showing(grating)


def _contrasts(judge: Judge, scene: Scene, value: float) -> Verdict:
    """Photograph a grating and compare its contrast with that of the scene."""
    rig, shot = judge.rig, _shoot_grating(judge, scene, value)
    restored = rig.restore(shot)
    outcomes = judge.judge(shot, restored, with_chi2=False)
    for method, planes in restored.planes.items():
        middle = len(planes) // 2
        mtf = modulation(planes[middle], shot.light.clean[middle])
        fault = f"MTF {mtf:.2f}: contrast that is not in the scene" if mtf > MOST_MTF else None
        outcomes[method] = replace(
            outcomes[method], fault=outcomes[method].fault or fault, extra={"mtf": mtf}
        )
    return Verdict(outcomes=outcomes, seen=see(rig, shot))


def _seams(judge: Judge, scene: Scene, value: float) -> Verdict:
    """Compare tiled with whole, which must agree in every bit."""
    rig = judge.rig
    shot = rig.shoot(scene)
    verdict, whole = judge.score(shot), rig.restore(shot).pictures
    if value >= WHOLE:
        return verdict
    outcomes = dict(verdict.outcomes)
    tiled = rig.choosing(tile_px=round(value)).restore(shot).pictures
    for name in (method.name for method in rig.networks):
        if name not in whole or name not in tiled:
            continue
        seam = float(np.abs(tiled[name] - whole[name]).max())
        fault = f"a seam of {seam:.3g}" if seam > 0 else None
        outcomes[name] = replace(outcomes[name], fault=fault, extra={"seam_max_abs": seam})
    return Verdict(outcomes=outcomes, seen=verdict.seen)


SCENARIOS: Final = (
    row(
        *("fp16_range", "Range of half precision", "light_ev", "EV"),
        "[0] 2 4 6 (8) 12 16 20",
        measure=_activations,
        applies=has_networks,
        rival=False,
        note="Float light above white (HDR input); the largest fp32 activation against 65504. A "
        "CPU run of the fp16 graph proves nothing, since it computes in fp32.",
    ),
    row(
        *("picture_size", "Odd and tiny pictures", "height_px", "px"),
        "(1) 2 3 7 17 (31) 63 127 255 [511]",
        shoot=_cut,
        log=True,
        bounds={"side_px": "low"},
        note="Light from outside the picture falls into it, as on a real crop; nothing is cut off "
        "before judging.",
    ),
    row(
        *("resolution", "Invented detail: gratings", "cycles_per_px", "cycles/px"),
        "0.02 [0.05] 0.1 0.15 (0.2) 0.25 0.3 0.4",
        shoot=_shoot_grating,
        measure=_contrasts,
        rival=False,
        note="Sine gratings, one direction per scene. MTF above 1.1 is invented contrast and a "
        "break, nothing else is: chi^2 is not calibrated for pictures that are all aliasing; "
        "near 0.5 cycles/px the colour mosaic aliases whatever the method.",
    ),
    row(
        *("tile_seams", "Tile seams", "tile_px", "px"),
        f"48 100 (160) 256 [{WHOLE:g}]",
        measure=_seams,
        applies=has_networks,
        log=True,
        note="1024 is the untiled picture; any difference between tiled and whole is a break.",
    ),
)
