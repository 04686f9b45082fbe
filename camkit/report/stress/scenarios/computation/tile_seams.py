"""Seams: tiled against whole, which must agree in every bit."""

from dataclasses import replace

import numpy as np

from camkit.report.stress.scenario import Scenario, has_networks
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.verdict import Verdict

WHOLE = 1024.0


def _measure(judge: Judge, scene: Scene, value: float) -> Verdict:
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
        outcomes[name] = replace(
            outcomes[name],
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
    applies=has_networks,
    log=True,
    note="1024 is the untiled picture; any difference between tiled and whole is a break.",
)
