"""The sensor of a joint design: the twin of `expose`, with gradients where something is seen."""

import numpy as np
import pytest
import torch
from torch import Tensor

from camkit.cfa import CFA_PATTERNS, cfa_channels
from camkit.models_def.design.plate.recording import Pixels, recorded, whole_kernels
from camkit.models_def.kinds.hdr.samples import develop
from camkit.models_def.sensors.exposure import expose
from tests.camera_factory import make_sensor

GAINS = (2.0, 1.0, 1.5)
SIDE = 96


def _shown(light: Tensor, cfa: str, shot: float = 0.0, read: float = 0.0) -> Tensor:
    normal = torch.randn(1, SIDE, SIDE, generator=torch.Generator().manual_seed(2))
    return recorded(
        light,
        Pixels(cfa=cfa, gains=GAINS),  # type: ignore[arg-type]
        shot=torch.tensor([shot]),
        read_variance=torch.tensor([read]),
        normal=normal,
    )


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_without_noise_it_is_what_the_sensor_records(cfa: str) -> None:
    """Up to the steps of the sensor, and the noise that `expose` cannot leave away."""
    sensor = make_sensor(cfa=cfa)
    scene = torch.rand(1, 3, 12, 12, generator=torch.Generator().manual_seed(1)) * 3
    light = torch.nn.functional.interpolate(scene, (SIDE, SIDE), mode="nearest")
    rng = np.random.default_rng(0)
    raw = np.mean([expose(light, GAINS, sensor, 100.0, rng)[0] for _ in range(40)], axis=0)
    wanted = torch.from_numpy(develop(raw.astype(np.float32), GAINS, sensor.cfa))[None]
    found = _shown(light, sensor.cfa)
    assert float((found - wanted).abs().mean()) < 2e-3
    assert float((found - wanted).abs().max()) < 0.03


@pytest.mark.parametrize("level", [0.05, 0.5])
def test_noise_is_that_of_photons_and_of_reading(level: float) -> None:
    sensor = make_sensor()
    noise = sensor.noise_at(1600.0)
    light = torch.full((1, 3, SIDE, SIDE), level)
    found = _shown(light, sensor.cfa, noise.shot[0], noise.read_variance[0])
    for y, x in np.ndindex(2, 2):
        colour = cfa_channels(sensor.cfa)[y][x]
        seen = found[0, colour, y::2, x::2] / GAINS[colour]
        wanted = noise.shot[0] * level / GAINS[colour] + noise.read_variance[0]
        assert float(seen.var()) == pytest.approx(wanted, rel=0.1)


def test_what_is_clipped_passes_no_gradient_on() -> None:
    light = torch.full((1, 3, SIDE, SIDE), 0.5)
    light[..., 40:56, 40:56] = 9.0
    light.requires_grad_()
    (slope,) = torch.autograd.grad(_shown(light, "RGGB").sum(), light)
    assert not slope[..., 44:52, 44:52].any()
    assert (slope[..., :30, :30].sum(1) > 0).all()


def test_light_that_leaves_the_window_is_not_lost() -> None:
    light = torch.zeros(2, 9, 9, requires_grad=True)
    kernels = whole_kernels(light + torch.tensor([0.9, 0.5]).reshape(2, 1, 1) / 81)
    torch.testing.assert_close(kernels.sum((-2, -1)), torch.ones(2))
    assert float(kernels.detach().min()) > 0
    (slope,) = torch.autograd.grad(kernels[0, 4, 4], light)
    # one more unit in the middle takes 1/81 of it from the haze everywhere
    assert float(slope[0, 4, 4]) == pytest.approx(1 - 1 / 81)
    assert float(slope[0, 0, 0]) == pytest.approx(-1 / 81)
