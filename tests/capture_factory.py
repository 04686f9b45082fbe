"""Small real DNG files photographed with the tiny bundle's camera."""

from pathlib import Path

import numpy as np

from camkit.bundle.reader import open_bundle
from camkit.runtime.twin.simulate import SimulationOptions, simulate, write_capture
from tests.bundle_factory import write_tiny_bundle


def write_tiny_captures(folder: Path, names: list[str]) -> Path:
    """Write captures NAME.dng that name the tiny bundle, and give the bundle's path."""
    path = write_tiny_bundle(folder)
    bundle = open_bundle(path)
    sensor = bundle.manifest.sensor
    for seed, name in enumerate(names):
        rng = np.random.default_rng(seed)
        scene = np.kron(rng.random((3, 8, 12)), np.ones((8, 8))).astype(np.float32)
        options = SimulationOptions(iso=100.0, seed=seed)
        write_capture(
            folder / f"{name}.dng", simulate(scene, sensor, bundle.psf, options), sensor, "tiny"
        )
    return path
