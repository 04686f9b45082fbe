"""The array of a bundle behind a stage that makes its photons finer: linearly, or by its network.

    photons (n, h, w) -- linear estimate at their level of light --> (n, m h, m w)
                      -- light and 3 sigma, white = 1 -- network --> (n, m h, m w)

With c counts, d of them dark, a network is given (c - d) / N and 3 sqrt(c + 1) / N, N the photons
of white, as it was in training. Whatever N is, what it gives is photons again.
"""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle, is_built_in
from camkit.bundle.sensor import SpadSensor
from camkit.bundle.stages import SuperResolve
from camkit.bundle.stages.super_resolve import LEAST_WHITE, NOISE_SCALE, WHITE_PERCENTILE
from camkit.caller import option_text
from camkit.errors import BundleError, ContractError
from camkit.runtime.cancel import Cancel, check_cancelled
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance
from camkit.runtime.kinds.spad.finer.linear import Grid, LinearEstimate, linear_estimate
from camkit.runtime.kinds.spad.finer.sampling import sampling_kernel
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import check_graph

DEFAULT_SIZE: Final = "M"


def network_planes(
    photons: FloatArray, white: float, dark: NDArray[np.floating] | float = 0.0
) -> FloatArray:
    """Return what a network is given of a picture, (2, h, w): light, and 3 sigma of it.

    Args:
        photons: (h, w), without dark counts.
        white: Photons of white.
        dark: Dark counts that were taken off, (h, w) or one number.
    """
    noise = NOISE_SCALE * np.sqrt(np.maximum(photons + dark, 0) + 1)
    return np.stack([photons, noise]).astype(np.float32) / np.float32(white)


def white_of(photons: FloatArray) -> float:
    """Return the photons that are taken for white in a picture (h, w), or in several (n, h, w).

    Of several, that of the brightest: most bins of light in flight are dark.
    """
    each = np.percentile(photons, WHITE_PERCENTILE, axis=(-2, -1))
    return max(float(np.max(each, initial=0.0)), LEAST_WHITE)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FineCamera:
    """The array of a bundle; safe to share between threads.

    Attributes:
        bundle: The camera.
        stage: How it makes pictures finer.
        networks: Gives the network of a role and size.
    """

    bundle: Bundle
    stage: SuperResolve
    networks: Callable[[str, str], NetworkEngine]

    @classmethod
    def of(cls, bundle: Bundle, threads: int = 1, *, role: str | None = None) -> "FineCamera":
        """Return the fine camera of a bundle.

        Args:
            bundle: The camera.
            threads: Of its networks.
            role: Of the networks that make pictures finer; None for those of its first stage.

        Raises:
            BundleError: If it makes no picture of photons finer, or has no such role.
        """
        manifest = bundle.manifest
        stages = manifest.stages_of(SuperResolve)
        stage = next((s for s in stages if role is None or s.role == role), None)
        if stage is None and stages:
            roles = ", ".join(s.role for s in stages)
            raise BundleError(f"bundle {manifest.name} has no role {role!r}; it has {roles}")
        if stage is None or not isinstance(manifest.sensor, SpadSensor):
            raise BundleError(
                f"bundle {manifest.name} has no stage super_resolve; captures of single photons "
                f"are sharpened with {option_text('bundle', 'none')}"
            )
        return cls(bundle=bundle, stage=stage, networks=_Networks(bundle, threads))

    @property
    def sensor(self) -> SpadSensor:
        """Return its array."""
        sensor = self.bundle.manifest.sensor
        assert isinstance(sensor, SpadSensor)
        return sensor

    @property
    def scale(self) -> int:
        """Return the sub-pixels along a side of a pixel."""
        return self.sensor.sub_pixels

    @property
    def grid(self) -> Grid:
        """Return where a pixel sees."""
        return Grid(scale=self.sensor.sub_pixels, phase=self.sensor.phase)

    @property
    def kernel(self) -> FloatArray:
        """Return the light of a point on the fine grid, (n, n)."""
        return sampling_kernel(self.stage, np.array(self.bundle.psf.kernels[0, 0, 0]), self.grid)

    @property
    def sizes(self) -> Mapping[str, object]:
        """Return its networks by size."""
        return self.bundle.manifest.networks.get(self.stage.role, {})

    def size(self, choice: str | None) -> str:
        """Return the size of network to run: the one asked for, else M.

        Raises:
            ContractError: If there is none.
        """
        return size_of(self.bundle.manifest, self.stage.role, choice)

    def size_of_bins(self, choice: str | None) -> str:
        """Return the size of network that makes bins finer for depth: asked for, else the smallest.

        A larger one brings times nearer by a few percent at most (`tools.spad.depth` at 2a55aa66),
        and every bin costs what it costs.

        Raises:
            ContractError: If there is none.
        """
        small = next((s for s in self.bundle.manifest.sizes if s in self.sizes), None)
        return self.size(choice or small)

    def linear(self, photons: float, kernel: FloatArray | None = None) -> LinearEstimate:
        """Return the linear estimate at a level of light.

        Args:
            photons: Of a pixel, on average; inf for no noise.
            kernel: (n, n) of an array that sees otherwise; None for that of this one.

        Raises:
            ContractError: As `linear_estimate`.
        """
        array_kernel = self.kernel if kernel is None else kernel
        return linear_estimate(array_kernel, self.grid, PictureCovariance.of(self.stage), photons)

    def network(self, size: str) -> NetworkEngine:
        """Return the network of a size, made when first asked for.

        Raises:
            BundleError: If there is none, or its graph is not what the bundle says.
        """
        return self.networks(self.stage.role, size)

    def by_network(
        self,
        frames: FloatArray,
        size: str,
        *,
        white: float,
        dark: NDArray[np.floating] | float = 0.0,
        cancel: Cancel | None = None,
    ) -> FloatArray:
        """Return pictures (n, m h, m w) of photons (n, h, w) by the network of a size.

        Args:
            frames: Photons without dark counts.
            size: Of the network.
            white: Photons of white in all of them.
            dark: Dark counts that were taken off, (h, w) or one number.
            cancel: Asked while the network runs.

        Raises:
            Cancelled: If `cancel` said so.
        """
        engine, scale = self.network(size), self.scale
        count, height, width = frames.shape
        pictures = np.empty((count, scale * height, scale * width), np.float32)
        for frame, out in zip(frames, pictures, strict=True):
            check_cancelled(cancel)
            planes = network_planes(frame, white, dark)[None]
            engine.run(planes, out[None, None], cancel=cancel)
        np.maximum(pictures, 0, out=pictures)
        pictures *= np.float32(white)
        return pictures


def size_of(manifest: Manifest, role: str, choice: str | None) -> str:
    """Return the size of network to run for a role: the one asked for, else M.

    Raises:
        ContractError: If there is none.
    """
    sizes = manifest.networks.get(role, {})
    if not sizes or (choice is not None and choice not in sizes):
        have = ", ".join(sizes) or "none"
        raise ContractError(
            f"bundle {manifest.name} holds size(s) {have}; asked for "
            f"{choice or 'a network'}; {option_text('method', 'linear')} needs none"
        )
    return choice or (DEFAULT_SIZE if DEFAULT_SIZE in sizes else next(iter(sizes)))


class _Networks:
    """The networks of a bundle outside a pipeline."""

    def __init__(self, bundle: Bundle, threads: int) -> None:
        self._bundle, self._threads = bundle, threads
        self._engines: dict[tuple[str, str], NetworkEngine] = {}
        self._lock = threading.Lock()

    def __call__(self, role: str, size: str) -> NetworkEngine:
        """Return a network, made when first asked for."""
        with self._lock:
            if (role, size) not in self._engines:
                facts = self._bundle.network_facts(role, size)
                data = self._bundle.network_bytes(role, size)
                graph = check_graph(data, facts)
                self._engines[role, size] = NetworkEngine(
                    data,
                    threads=self._threads,
                    scale=facts.output_scale,
                    block_bytes=None if is_built_in(self._bundle) else graph.block_bytes_per_pixel,
                )
            return self._engines[role, size]
