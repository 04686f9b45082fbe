"""Ways of sampling of an array, and methods that make its photons finer.

    learned             the plate of the bundle, and its networks
    gaussian_untrained  the same networks behind the thesis's Gaussian, which they never saw
    low_fill, full_fill, gaussian    behind nothing, all of a pixel, a diffuser: networks of the
                        baselines, trained for the same time
    srcnn, vdsr         other networks behind the plate, of the baselines as well

References: Sun 2021, tables 4.1 and 4.2.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle, built_in_bundles, open_bundle
from camkit.report.bench.trial import Skip
from camkit.report.kinds.spad.bicubic import bicubic
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.sampling import (
    GAUSSIAN_PIXELS,
    box_kernel,
    gaussian_kernel,
    point_kernel,
)
from camkit.runtime.network.engine import NetworkEngine, available_threads

BASELINES: Final = "spad-sr-baselines"
"""Built-in bundle with the networks of other samplings."""
NET: Final = "net"
TRAINED: Final = ("low_fill", "full_fill", "gaussian")
"""Ways of sampling whose networks are baselines."""
OTHERS: Final = ("srcnn", "vdsr")

Restore = Callable[[FloatArray, float], FloatArray]
"""(light and noise (2, h, w), photons of a pixel on average or inf) -> picture (m h, m w)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """Method that makes photons finer.

    Attributes:
        name: net, linear, bicubic, srcnn or vdsr.
        size: Of a network that has several; None for others.
        restore: It.
    """

    name: str
    size: str | None = None
    restore: Restore


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Way:
    """A way of sampling, with the methods that are judged behind it.

    Attributes:
        sampling: Its name.
        kernel: (n, n) of unit sum, on the fine grid.
        light: How many times the light of one sub-pixel a pixel collects.
        sigma: Of a Gaussian, in sub-pixels; None for others.
        methods: What makes its photons finer.
    """

    sampling: str
    kernel: FloatArray
    light: float = 1.0
    sigma: float | None = None
    methods: Sequence[Method] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Baselines:
    """Networks of the bundle of baselines by role, as far as they are there.

    Attributes:
        cameras: Role -> the array that sees as that role does.
        skips: Why there is none, or which role is not held.
    """

    cameras: Mapping[str, FineCamera] = field(default_factory=dict)
    skips: Sequence[Skip] = ()


def read_baselines(camera: FineCamera) -> Baselines:
    """Read the built-in baselines, if they are of an array like this one."""
    path = built_in_bundles().get(BASELINES)
    if path is None:
        return Baselines(skips=_absent("it is not built in"))
    bundle = open_bundle(path)
    roles = list(bundle.manifest.networks)
    cameras = {role: FineCamera.of(bundle, _threads(), role=role) for role in roles}
    if any(other.grid != camera.grid for other in cameras.values()):
        return Baselines(skips=_absent("their pixels see at another sub-pixel"))
    missing = [role for role in (*TRAINED, *OTHERS) if role not in cameras]
    skips = [Skip(what=f"network {role}", reason=f"{BASELINES} holds none") for role in missing]
    return Baselines(cameras=cameras, skips=skips)


def ways_of(
    bundle: Bundle, sizes: Sequence[str], baselines: Mapping[str, FineCamera]
) -> tuple[Way, ...]:
    """Return all ways of sampling.

    Args:
        bundle: The camera.
        sizes: Of its networks.
        baselines: Of `read_baselines`.
    """
    camera = FineCamera.of(bundle, _threads())
    grid, side = camera.grid, camera.kernel.shape[0]
    nets = [Method(name=NET, size=size, restore=by_network(camera.network(size))) for size in sizes]
    trained = [
        Method(name=name, restore=_of_role(baselines[name])) for name in OTHERS if name in baselines
    ]
    diffuser = baselines["gaussian"].stage.sigma if "gaussian" in baselines else None
    thesis = grid.scale * GAUSSIAN_PIXELS
    kernels = {
        "low_fill": (point_kernel(side), 1.0, None),
        "full_fill": (box_kernel(side, grid), float(grid.scale**2), None),
        "gaussian": (gaussian_kernel(side, diffuser or thesis), 1.0, diffuser or thesis),
    }
    learned = Way(
        sampling="learned",
        kernel=camera.kernel,
        methods=(*nets, *trained, *_untrained(camera, camera.kernel)),
    )
    untrained = Way(
        sampling="gaussian_untrained",
        kernel=gaussian_kernel(side, thesis),
        sigma=thesis,
        methods=nets,
    )
    others = [
        Way(
            sampling=name,
            kernel=kernel,
            light=light,
            sigma=sigma,
            methods=(*_net(baselines.get(name)), *_untrained(camera, kernel)),
        )
        for name, (kernel, light, sigma) in kernels.items()
    ]
    return (learned, *others, untrained) if nets else (learned, *others)


def by_network(engine: NetworkEngine) -> Restore:
    """Return what a network makes of light and noise."""

    def restore(planes: FloatArray, photons: float) -> FloatArray:
        del photons
        return np.asarray(engine.run(np.ascontiguousarray(planes[None]))[0, 0])

    return restore


def by_linear(camera: FineCamera, kernel: FloatArray) -> Restore:
    """Return the best linear estimate of an array behind a kernel, at the level of its photons."""

    def restore(planes: FloatArray, photons: float) -> FloatArray:
        return np.asarray(camera.linear(photons, kernel)(planes[:1])[0])

    return restore


def _untrained(camera: FineCamera, kernel: FloatArray) -> tuple[Method, ...]:
    """Return the methods that no training is needed for."""
    grid = camera.grid
    return (
        Method(name="linear", restore=by_linear(camera, kernel)),
        Method(name="bicubic", restore=lambda planes, _photons: bicubic(planes[0], grid)),
    )


def _net(camera: FineCamera | None) -> tuple[Method, ...]:
    if camera is None:
        return ()
    return (Method(name=NET, size=camera.size(None), restore=_of_role(camera)),)


def _of_role(camera: FineCamera) -> Restore:
    return by_network(camera.network(camera.size(None)))


def _absent(reason: str) -> tuple[Skip, ...]:
    return (Skip(what=f"networks of {BASELINES}", reason=reason),)


def _threads() -> int:
    return available_threads(None)
