"""The wrong bundle: light through the kernels of another place of the field, by and by."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.stress.scenario import Scenario, varies_over_field
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.light import Lens


def other_lens(lens: Lens, share: float) -> Lens:
    """Return a lens that does in the middle what this one does in the corner, by a share."""
    corner_mm = float(lens.psf.field_heights_mm.max())

    def kernels_at(x_mm: float, y_mm: float) -> FloatArray:
        height_mm = float(np.hypot(x_mm, y_mm))
        other_mm = max(corner_mm - height_mm, 0.0)
        away = (x_mm / height_mm, y_mm / height_mm) if height_mm else (0.0, 1.0)
        other = lens.kernels_at(-away[0] * other_mm, -away[1] * other_mm)
        return np.asarray((1 - share) * lens.kernels_at(x_mm, y_mm) + share * other, np.float32)

    return Lens(psf=lens.psf, kernels_at=kernels_at, margin_px=lens.margin_px, haze=lens.haze)


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    lens = other_lens(rig.lens, value / 100) if value else None
    return rig.shoot(scene, lens)


SCENARIO = Scenario(
    name="wrong_bundle",
    title="Wrong bundle",
    knob="other_percent",
    unit="%",
    values=(0.0, 10.0, 25.0, 50.0, 75.0, 100.0),
    nominal=0.0,
    quick=(0.0, 100.0),
    shoot=_shoot,
    applies=varies_over_field,
    note="The other lens does in the middle what this one does in the corner, turned by 180 "
    "degrees; below 100 % light goes both ways.",
)
