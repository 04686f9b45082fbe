"""Every method on one capture: the input, the Wiener bank and the networks behind it.

The stages are those of `camkit.runtime.job.reconstruction`, joined so that the Wiener bank, which
all methods share, is computed once; a test holds both to the same bits.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.manifest import Demosaic, Network, Wiener
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray, NoiseModel
from camkit.errors import ContractError
from camkit.report.stress.scene import Scene
from camkit.report.stress.twin import (
    Lens,
    Light,
    Setting,
    Shot,
    light_of,
    nominal_lens,
    photograph,
)
from camkit.runtime.bank.baselines import restoration_bank
from camkit.runtime.bank.blocks import LocalPsf
from camkit.runtime.bank.psf import color_kernels, kernel_at
from camkit.runtime.capture import Capture
from camkit.runtime.geometry.placement import place
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import check_graph
from camkit.runtime.network.guard import TileGuard
from camkit.runtime.network.tiling import TileLimits, infer_bands, plan_windows
from camkit.runtime.rows import ArrayRows
from camkit.runtime.signal.front_rows import FrontRows
from camkit.runtime.signal.stabilise import stabilise, unstabilise

INPUT: Final = "input"
WIENER: Final = "wiener"
BEFORE: Final = "before"
"""Marks the networks of the bundle that is compared with: "M before"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """A network with what it needs to run.

    Attributes:
        name: Of the method.
        bundle: Where it came from.
        size: S, M or L.
        engine: The network, on one thread.
        scale: Of the stabilising transform.
    """

    name: str
    bundle: Bundle
    size: str
    engine: NetworkEngine
    scale: float

    def run(
        self,
        planes: FloatArray,
        wiener: FloatArray,
        noise: NoiseModel,
        *,
        tile_px: int | None = None,
    ) -> FloatArray:
        """Restore (3, h, w) white-balanced planes; bad tiles are errors that name them.

        Raises:
            ContractError: If a tile is not finite or not bounded.
        """
        given = np.concatenate(
            [stabilise(part, noise, scale=self.scale) for part in (planes, wiener)]
        )
        facts = self.bundle.network_facts(self.size)
        limits = TileLimits(
            stride_px=facts.stride_px,
            halo_px=facts.reach_px,
            bytes_per_px=facts.bytes_per_pixel,
            tile_px=tile_px,
            whole=tile_px is None,
        )
        plan = plan_windows(planes.shape[1], planes.shape[2], limits)
        guard = TileGuard(fallback=False)
        bands = infer_bands(self.engine.run, ArrayRows(given), plan, guard=guard)
        stable = np.concatenate(list(bands), axis=1)
        return unstabilise(stable, noise, scale=self.scale)


@dataclass(frozen=True, slots=True, kw_only=True)
class Restored:
    """What the methods made of one capture.

    Attributes:
        planes: Method -> (3, h, w) float32, white-balanced camera space, vignetting still in.
        faults: Method -> why it gave nothing.
        noise: After white balance, as the methods were told.
    """

    planes: Mapping[str, FloatArray]
    faults: Mapping[str, str]
    noise: NoiseModel


class Rig:
    """A bundle with its networks made ready, and the lights that its scenarios share.

    Attributes:
        lens: Through which captures are taken: the bundle's, at its reference depth.
        assumed_lens: What restorations go by: the kernels of the bank. Another one only where
            the bundle knows several depths.
    """

    def __init__(
        self, bundle: Bundle, sizes: tuple[str, ...], *, before: Bundle | None = None
    ) -> None:
        """Make the networks ready.

        Raises:
            ContractError: If the bundle has no Wiener bank or lacks a size.
        """
        stage = bundle.manifest.stage(Wiener)
        if stage is None:
            raise ContractError(
                f"bundle {bundle.manifest.name} has no Wiener bank to compare its networks with"
            )
        self.bundle = bundle
        self.before = before
        self.networks = tuple(_trained(bundle, size, size) for size in sizes)
        if before is not None:
            have = [size for size in sizes if size in before.manifest.networks]
            self.networks += tuple(_trained(before, size, f"{size} {BEFORE}") for size in have)
        self._stage = stage
        self.lens = nominal_lens(bundle)
        self.assume(None)
        self._lights: dict[str, Light] = {}

    def assume(self, depth_mm: float | None) -> None:
        """Give the bank the kernels of a depth, as `--depth-m` does; None for the mean kernel."""
        response = self.bundle.manifest.camera.channel_response.to_arrays()
        kernels = color_kernels(self.bundle.psf, *response, depth_mm=depth_mm)
        heights_mm = self.bundle.psf.field_heights_mm
        self._kernels = kernels
        self.assumed_lens = replace(
            self.lens, kernels_at=lambda x, y: kernel_at(kernels, heights_mm, x, y)
        )
        self._last: tuple[Capture, Restored] | None = None

    def told(self, depth_mm: float) -> "Rig":
        """Give a rig like this one whose methods know the depth."""
        other = copy.copy(self)
        other.assume(depth_mm)
        return other

    @property
    def methods(self) -> tuple[str, ...]:
        """Name the methods, from doing nothing to the networks."""
        return (INPUT, WIENER, *(n.name for n in self.networks))

    @property
    def primary(self) -> str:
        """Name the method whose break point is the scenario's: M, else the first network."""
        names = [n.name for n in self.networks]
        return "M" if "M" in names else (names[0] if names else WIENER)

    def light(self, scene: Scene, lens: Lens | None = None) -> Light:
        """Let a scene fall on the sensor; that through the nominal lens is kept by its name."""
        if lens is not None:
            return light_of(scene, self.bundle, lens)
        if scene.name not in self._lights:
            self._lights[scene.name] = light_of(scene, self.bundle, self.lens)
        return self._lights[scene.name]

    def shoot(self, scene: Scene, lens: Lens | None = None, setting: Setting | None = None) -> Shot:
        """Record a scene through a lens (None: the nominal one) with a setting of the camera."""
        return self.record(self.light(scene, lens), setting)

    def record(self, light: Light, setting: Setting | None = None) -> Shot:
        """Record light with a setting of the camera."""
        return photograph(light, self.bundle.manifest.camera, setting or Setting())

    def front(self, capture: Capture) -> tuple[FloatArray, NDArray[np.bool_], NoiseModel]:
        """Give repaired, balanced, demosaicked (3, h, w) planes, unknown samples and the noise."""
        gains = capture.white_balance or (1.0, 1.0, 1.0)
        camera = self.bundle.manifest.camera
        noise = capture.noise or camera.noise_at(capture.iso or 100.0)
        demosaic = self.bundle.manifest.stage(Demosaic)
        method = "fast" if demosaic is None else demosaic.method
        rows = FrontRows(capture, gains, method=method, repair=True)
        planes = rows.read(0, capture.height)
        return planes, rows.unknown_rows(0, capture.height), noise.with_gains(gains)

    def deconvolve(
        self,
        capture: Capture,
        planes: FloatArray,
        unknown: NDArray[np.bool_],
        noise: NoiseModel,
    ) -> FloatArray:
        """Give the Wiener planes of a capture's planes."""
        window = place(capture, self.bundle.manifest.camera, None).window
        local = LocalPsf(
            kernels=self._kernels,
            field_heights_mm=self.bundle.psf.field_heights_mm,
            window=window,
        )
        bank = restoration_bank(local, self._stage, noise)
        return bank.restore_array(planes, unknown)

    def restore(self, shot: Shot) -> Restored:
        """Let every method restore a capture; what fails is a fault of the method.

        The last result is kept, since a scenario may look at one capture in several ways.
        """
        if self._last is None or not _same(self._last[0], shot.capture):
            self._last = shot.capture, self._restore(shot)
        return self._last[1]

    def _restore(self, shot: Shot) -> Restored:
        planes, unknown, noise = self.front(shot.capture)
        wiener = self.deconvolve(shot.capture, planes, unknown, noise)
        found, faults = {INPUT: planes, WIENER: wiener}, {}
        for network in self.networks:
            try:
                found[network.name] = network.run(planes, wiener, noise)
            except ContractError as error:
                faults[network.name] = str(error)
        return Restored(planes=found, faults=faults, noise=noise)


def _same(a: Capture, b: Capture) -> bool:
    """Tell whether two captures are restored alike."""
    facts = [(c.iso, c.white_balance, c.white_level, c.origin_px) for c in (a, b)]
    return facts[0] == facts[1] and np.array_equal(
        a.samples, b.samples, equal_nan=a.samples.dtype == np.float32
    )


def _trained(bundle: Bundle, size: str, name: str) -> Trained:
    networks, stage = bundle.manifest.networks, bundle.manifest.stage(Network)
    if size not in networks or stage is None:
        raise ContractError(
            f"bundle {bundle.manifest.name} holds size(s) {', '.join(sorted(networks)) or 'none'}; "
            f"asked for {size}"
        )
    data = bundle.network_bytes(size)
    check_graph(data, bundle.network_facts(size))
    engine = NetworkEngine(data, threads=1)
    return Trained(name=name, bundle=bundle, size=size, engine=engine, scale=stage.scale)
