"""Seams: tiled against whole, which must agree in every bit."""

from dataclasses import replace

import numpy as np

from camkit.report.stress.rig import Rig
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, Verdict
from camkit.report.stress.twin import Shot

WHOLE = 1024.0


def _shot(rig: Rig, scene: Scene) -> Shot:
    return rig.shoot(scene)


def _measure(judge: Judge, scene: Scene, value: float) -> Verdict:
    rig = judge.rig
    shot = _shot(rig, scene)
    verdict, restored = judge.score(shot), rig.restore(shot)
    outcomes = dict(verdict.outcomes)
    planes, _, noise = rig.front(shot.capture)
    for network in rig.networks:
        whole = restored.planes.get(network.name)
        if whole is None or value >= WHOLE:
            continue
        tiled = network.run(planes, restored.planes["wiener"], noise, tile_px=round(value))
        seam = float(np.abs(tiled - whole).max())
        outcomes[network.name] = replace(
            outcomes[network.name],
            fault=f"a seam of {seam:.3g}" if seam > 0 else None,
            extra={"seam_max_abs": seam},
        )
    return Verdict(outcomes=outcomes, seen=verdict.seen)


SCENARIO = Scenario(
    name="tile_seams",
    title="Tile seams",
    knob="tile_px",
    unit="px",
    values=(48.0, 100.0, 160.0, 256.0, WHOLE),
    nominal=WHOLE,
    quick=(160.0, WHOLE),
    measure=_measure,
    log=True,
    note="1024 is the untiled picture; any difference between tiled and whole is a break.",
)
