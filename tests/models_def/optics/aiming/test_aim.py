"""Launch points of whole beams: through their points of the stop, the few and the many alike."""

import math
from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.aiming import aim as aiming
from camkit.models_def.optics.aiming.aim import aim
from camkit.models_def.optics.aiming.start import launch, with_open_apertures
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.trace import refract, surface_tensors, trace
from tests.models_def.optics.aiming.test_chief_path import window

WAVES = torch.tensor([[0.45], [0.6]], dtype=torch.float64)


def _slopes(*angles_deg: float) -> torch.Tensor:
    return torch.tan(torch.deg2rad(torch.tensor(angles_deg, dtype=torch.float64)))[:, None, None]


@pytest.mark.parametrize("count", [40, 600])
@pytest.mark.parametrize(
    ("lens", "angles_deg"),
    [
        (find_lens("double-gauss"), (0.0, 14.0, 25.0)),
        (find_lens("cooke-triplet-f5"), (0.0, 20.0, 28.0)),
        (window(), (0.0, 30.0, 50.0, 65.0)),
        (window(300.0), (0.0, 30.0, 50.0)),
    ],
    ids=["double-gauss", "cooke", "window", "near window"],
)
def test_every_ray_that_is_aimed_passes_its_point(
    lens: Lens, angles_deg: tuple[float, ...], count: int
) -> None:
    tensors = with_open_apertures(surface_tensors(lens, WAVES))
    disc, radius_mm, slope = half_disc(count), 2.0, _slopes(*angles_deg)
    target = (radius_mm * disc.x, radius_mm * disc.y)
    found = aim(lens, tensors, target, slope)
    assert found.x.shape == (len(angles_deg), len(WAVES), count)
    rays = launch(found.x, found.y, slope, lens.object_distance_mm)
    met = refract(tensors, trace(tensors, rays, surfaces=range(lens.stop)), lens.stop)
    off_mm = torch.hypot(met.x - target[0], met.y - target[1])
    assert float(off_mm.max()) < 1e-7
    assert bool((found.weight > 0).all())


@pytest.mark.parametrize("stop_mm", [4.0, 30.0])
def test_the_many_start_where_each_would_by_itself(
    stop_mm: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a part of the beam cannot be aimed: the same rays are lost, but for a few."""
    lens = replace(
        find_lens("double-gauss"), aperture_kind="stop_semi_diameter_mm", aperture_value=stop_mm
    )
    tensors, disc = surface_tensors(lens, WAVES), half_disc(800)
    target, slope = (stop_mm * disc.x, stop_mm * disc.y), _slopes(0.0, 10.0, 20.0)
    together = aim(lens, tensors, target, slope)
    monkeypatch.setattr(aiming, "MANY", 10**6)
    alone = aim(lens, tensors, target, slope)
    assert bool((alone.weight == 0).any()) == (stop_mm > 20)
    kept = (alone.weight > 0) & (together.weight > 0)
    differ = (alone.weight > 0) != (together.weight > 0)
    assert float(differ.double().mean()) <= 0.01 * (stop_mm > 20)
    assert float((together.x - alone.x)[kept].abs().max()) < 1e-7
    assert float((together.y - alone.y)[kept].abs().max()) < 1e-7
    torch.testing.assert_close(together.weight[kept], alone.weight[kept], rtol=1e-5, atol=0.0)


def test_the_weight_of_an_aimed_ray_is_the_area_of_its_beam() -> None:
    """Before a plane window: launch area per stop area, known from the law of refraction."""
    lens, angle = window(), math.radians(40.0)
    tensors = surface_tensors(lens, torch.tensor(0.55, dtype=torch.float64))
    zero = torch.zeros(1, dtype=torch.float64)
    weight = aim(lens, tensors, (zero, zero), torch.tan(zero + angle)).weight
    # parallel rays stay parallel in plates: every beam keeps its area in planes across the axis
    assert float(weight) == pytest.approx(1.0, abs=1e-6)
