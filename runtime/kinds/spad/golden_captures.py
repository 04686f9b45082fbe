"""The golden captures of an array: counts in three lights, and a scan of depth.

dim, typical, bright   a procedural scene counted; `image` in photons
scan                   surfaces in front of a wall, by time; `depth_m`
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.golden import GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle
from camkit.runtime.kind_parts.golden import Cases, GoldenCaptures
from camkit.runtime.kinds.spad.finer.camera import FineCamera, network_planes
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.kinds.spad.twin.array import see_through
from camkit.runtime.kinds.spad.twin.counting import (
    Disturbances,
    count_frames,
    count_times,
    scaled_to,
)
from camkit.runtime.kinds.spad.twin.photon_twin import fitted, luminance, seen_by, times_of
from camkit.runtime.kinds.spad.twin.scene import light_of_depth
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
        radius, distance = rng.uniform(0.08, 0.28) * height, rng.uniform(0.25, 0.65) * span_m
        tall = rng.uniform(0.4, 1.0)
        inside = (
            np.hypot(x - middle_x, y - middle_y) < radius
            if number % 2
            else (np.abs(x - middle_x) < radius) & (np.abs(y - middle_y) < tall * radius)
        )
        depth = np.where(inside, distance + 0.1 * span_m * (x - middle_x) / width, depth)
    return np.asarray(depth, np.float64)


def _scene(camera: FineCamera, seed: int) -> FloatArray:
    sensor, scale = camera.sensor, camera.scale
    return procedural_scene(seed, scale * sensor.height_px, scale * sensor.width_px)


def _case(name: str, recipe: dict[str, Any]) -> GoldenCase:
    return GoldenCase(name=name, iso=ISO, recipe=recipe)


def probe(bundle: Bundle, role: str) -> FloatArray:
    """Return light and noise of an array that is larger than that of the bundle."""
    camera = FineCamera.of(bundle, role=role)
    height, width = (camera.scale * side for side in PROBE_PX)
    light = luminance(procedural_scene(PROBE_SEED, height, width))[None]
    mean = see_through(light, camera.kernel, camera.grid) * PROBE_PHOTONS
    counts = count_frames(mean, Disturbances(), np.random.default_rng(PROBE_SEED))[0]
    return network_planes(counts.astype(np.float32), PROBE_PHOTONS)


GOLDEN: Final = GoldenCaptures(cases=golden_cases, probe=probe)
