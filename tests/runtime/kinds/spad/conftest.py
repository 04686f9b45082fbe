"""The gate of the prototype, and photons drawn behind it."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from tests.spad_bundle import write_spad_bundle

Draw = Callable[..., NDArray[np.float32]]


@pytest.fixture(scope="session")
def pulse() -> GatedPulse:
    return GatedPulse(width_ps=200, rc_ps=60, sigma_ps=42.5)


@pytest.fixture(scope="session")
def axis() -> TimeAxis:
    return TimeAxis.regular("gate", bins=125, time_bin_ps=20)


@pytest.fixture(scope="session")
def draw(pulse: GatedPulse) -> Draw:
    """(axis, times (p,), photons, even=0, seed=0) -> Poisson counts (p, bins)."""

    def drawn(
        axis: TimeAxis,
        times_ps: NDArray[np.float64],
        photons: float,
        even: float = 0.0,
        seed: int = 0,
    ) -> NDArray[np.float32]:
        bins = np.broadcast_to(np.arange(axis.bins), (len(times_ps), axis.bins))
        mean = photons * axis.shares(pulse, times_ps, bins) + even
        return np.random.default_rng(seed).poisson(mean).astype(np.float32)

    return drawn


@pytest.fixture(scope="session")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_spad_bundle(tmp_path_factory.mktemp("spad-bundle"))


@pytest.fixture(scope="session")
def camera(bundle: Bundle) -> FineCamera:
    return FineCamera.of(bundle)
