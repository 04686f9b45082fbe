"""The golden cases of an array: counts in three lights, and a scan of depth; made again to compare.

dim, typical, bright   a procedural scene counted; `image` in photons
scan                   surfaces in front of a wall, by time; `depth_m`
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.golden import IMAGE, GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kind_parts.proving import Cases, Proving
from camkit.runtime.kinds.spad.finer.camera import FineCamera, network_planes, white_of
from camkit.runtime.kinds.spad.finer.depth import FineSharpener
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.sharpen import Way
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.kinds.spad.twin.array import see_through
from camkit.runtime.kinds.spad.twin.counting import (
    Disturbances,
    count_frames,
    count_times,
    scaled_to,
)
from camkit.runtime.kinds.spad.twin.scene import light_of_depth
from camkit.runtime.kinds.spad.twin.simulate import fitted, luminance, seen_by, times_of
from camkit.scenes import procedural_scene

DEPTH: Final = "depth_m"
LIGHTS: Final = {"dim": (30.0, 20), "typical": (1e4, 21), "bright": (1e6, 22)}
"""Photons of white and seed of a scene."""
SCAN: Final = "scan"
SCAN_PHOTONS: Final = 300.0
SCAN_SEED: Final = 23
PROBE_PX: Final = (192, 256)
PROBE_PHOTONS: Final = 1e4
PROBE_SEED: Final = 24
ISO: Final = 100.0
"""Every case states one; it means nothing here."""


def golden_cases(bundle: Bundle) -> Cases:
    """Record the golden captures with the array of a bundle."""
    camera = FineCamera.of(bundle)
    cases = {
        name: _counted(camera, name, photons, seed) for name, (photons, seed) in LIGHTS.items()
    }
    if DEPTH in bundle.manifest.products:
        cases[SCAN] = _scanned(camera)
    return cases


def products_of(arrays: GoldenArrays) -> tuple[str, ...]:
    """Return the names of the products that can be made of a golden capture."""
    return (IMAGE,) if arrays.capture.ndim == 2 else (DEPTH,)


def _counted(
    camera: FineCamera, name: str, photons: float, seed: int
) -> tuple[GoldenCase, GoldenArrays]:
    light = fitted(luminance(_scene(camera, seed)), camera)
    mean = seen_by(camera, light[None]) * photons
    counts = count_frames(mean, Disturbances(), np.random.default_rng(seed))[0]
    case = _case(name, {"scene_seed": seed, "photons": photons, "white": photons})
    reference = (light * photons).astype(np.float32)[None]
    return case, GoldenArrays(capture=counts, reference=reference)


def _scanned(camera: FineCamera) -> tuple[GoldenCase, GoldenArrays]:
    axis, pulse = times_of(camera)
    depth = stage_set(camera, SCAN_SEED)
    albedo = 0.2 + 0.8 * np.clip(fitted(luminance(_scene(camera, SCAN_SEED)), camera), 0, 1)
    light = seen_by(camera, light_of_depth(depth, albedo, axis, pulse))
    counts = count_times(
        scaled_to(light, SCAN_PHOTONS),
        axis.orientation,
        Disturbances(),
        np.random.default_rng(SCAN_SEED),
    )
    case = _case(SCAN, {"scene_seed": SCAN_SEED, "photons": SCAN_PHOTONS})
    return case, GoldenArrays(capture=counts, reference=depth.astype(np.float32)[None])


def stage_set(camera: FineCamera, seed: int) -> NDArray[np.float64]:
    """Return depth in metres (m h, m w): discs and boxes before a wall that leans away.

    The wall lies a third into the time bins of the array.
    """
    axis, _ = times_of(camera)
    span_m = float(axis.edges_ps[-1] - axis.edges_ps[0]) * LIGHT_M_PER_PS / 2
    rng = np.random.default_rng(seed)
    sensor, scale = camera.sensor, camera.scale
    height, width = scale * sensor.height_px, scale * sensor.width_px
    y, x = np.mgrid[:height, :width]
    depth = span_m * (0.75 + 0.15 * x / width + 0.05 * y / height)
    for number in range(7):
        middle_x, middle_y = rng.uniform(0.1, 0.9) * width, rng.uniform(0.1, 0.9) * height
        radius, nearer = rng.uniform(0.08, 0.28) * height, rng.uniform(0.25, 0.65) * span_m
        tall = rng.uniform(0.4, 1.0)
        inside = (
            np.hypot(x - middle_x, y - middle_y) < radius
            if number % 2
            else (np.abs(x - middle_x) < radius) & (np.abs(y - middle_y) < tall * radius)
        )
        depth = np.where(inside, nearer + 0.1 * span_m * (x - middle_x) / width, depth)
    return np.asarray(depth, np.float64)


def _scene(camera: FineCamera, seed: int) -> FloatArray:
    sensor, scale = camera.sensor, camera.scale
    return procedural_scene(seed, scale * sensor.height_px, scale * sensor.width_px)


def _case(name: str, recipe: dict[str, Any]) -> GoldenCase:
    return GoldenCase(name=name, iso=ISO, recipe=recipe)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpadWork:
    """A golden capture on its way; see `camkit.runtime.kind_parts.proving.CaseWork`."""

    camera: FineCamera
    capture: NDArray[Any]
    size: str | None

    def shape_of(self, product: str) -> tuple[int, int, int]:
        """Return (1, m h, m w)."""
        self._check(product)
        scale, (height, width) = self.camera.scale, self.capture.shape[-2:]
        return 1, scale * height, scale * width

    def fill(self, out: FloatArray | None = None, product: str = IMAGE) -> FloatArray:
        """Return a picture of counts in photons, or the depth of a scan, NaN nowhere."""
        self._check(product)
        found = self._picture() if product == IMAGE else self._depth()
        if out is None:
            return found
        out[:] = found
        return out

    def network_input(self, role: str) -> FloatArray:
        """Return light and noise of the counts, or of all photons of a scan."""
        del role
        photons = self._photons()
        return network_planes(photons, white_of(photons))

    def _photons(self) -> FloatArray:
        counts = self.capture.astype(np.float32)
        return counts if counts.ndim == 2 else counts.sum(axis=0)

    def _picture(self) -> FloatArray:
        return finer_frames(self.camera, self._photons()[None], 0.0, self.size)

    def _depth(self) -> FloatArray:
        shape = self.capture.shape[1:]
        axis, pulse = times_of(self.camera)
        nothing = np.zeros(shape, dtype=bool)
        counts = np.ascontiguousarray(self.capture.transpose(1, 2, 0), dtype=np.float32)
        sharpener = FineSharpener(self.camera, axis, pulse, Way(), size=self.size)
        found = sharpener.cube(counts, np.zeros(shape), hot=nothing, blind=nothing).found
        return np.asarray(found.time_of_flight_ps * LIGHT_M_PER_PS / 2, np.float32)

    def _check(self, product: str) -> None:
        made = IMAGE if self.capture.ndim == 2 else DEPTH
        if product != made:
            raise ContractError(f"this golden capture gives {made}, not {product}")


def case_work(bundle: Bundle, case: GoldenCase, arrays: GoldenArrays, size: str | None) -> SpadWork:
    """Prepare the processing of a golden capture.

    Raises:
        BundleError: If the bundle makes no picture of photons finer.
    """
    del case
    camera = FineCamera.of(bundle)
    camera.check_shape((arrays.capture.shape[-2], arrays.capture.shape[-1]))
    return SpadWork(camera=camera, capture=arrays.capture, size=size)


def probe(bundle: Bundle, role: str) -> FloatArray:
    """Return light and noise of an array that is larger than that of the bundle."""
    camera = FineCamera.of(bundle, role=role)
    height, width = (camera.scale * side for side in PROBE_PX)
    light = luminance(procedural_scene(PROBE_SEED, height, width))[None]
    mean = see_through(light, camera.kernel, camera.grid) * PROBE_PHOTONS
    counts = count_frames(mean, Disturbances(), np.random.default_rng(PROBE_SEED))[0]
    return network_planes(counts.astype(np.float32), PROBE_PHOTONS)


PROVING: Final = Proving(cases=golden_cases, products=products_of, run=case_work, probe=probe)
