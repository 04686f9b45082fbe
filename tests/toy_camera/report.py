"""The toy camera in reports: photographs, judged as such, and a scenario and a row of its own."""

from dataclasses import replace
from typing import Final

import numpy as np

from camkit.report.bench.part import BenchPart, RowMaker
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial
from camkit.report.kind import ReportPart
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.report.stress.stress_part import StressPart
from camkit.runtime.twin.exposure import Setting


def _stuck_row(judge: Judge, scene: Scene, value: float) -> Shot:
    shot = judge.rig.shoot(scene, setting=Setting(iso=200))
    samples = shot.capture.samples.copy()
    rows = np.arange(round(value)) * 7 % samples.shape[-2]
    samples[..., rows, :] = 0
    return replace(shot, capture=replace(shot.capture, samples=samples))


STUCK_ROWS: Final = Scenario(
    name="stuck_rows",
    title="Rows that stay black",
    knob="rows",
    unit="rows",
    values=(0.0, 1.0, 8.0),
    nominal=0.0,
    quick=(0.0, 8.0),
    shoot=_stuck_row,
)


def make_trials(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Trial], list[Skip]]:
    """Give one trial: the picture a stop brighter, which costs nothing."""
    threads = ground.base_threads(axes)
    trial = Trial(
        camera=entrant.camera,
        bundle=entrant.label,
        path=entrant.bundle.path,
        maker=ROWS.name,
        method="net",
        size=entrant.bundle.manifest.sizes[0],
        threads=threads,
        base_threads=threads,
        extra=(("exposure_ev", 1.0),),
    )
    return [trial], []


ROWS: Final = RowMaker(name="brighter", methods=("brighter",), trials=make_trials)

PART: Final = ReportPart(
    bench=BenchPart(rows=(ROWS,)),
    stress=StressPart(scenarios=(STUCK_ROWS,)),
)
