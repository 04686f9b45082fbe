"""The coarse band of a bundle on its whole sensor: made for export, computed again by a check."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.haze_golden import HazeGolden, haze_golden_from_bytes
from camkit.bundle.reader import HAZE_GOLDEN, Bundle
from camkit.bundle.stages import Dehaze
from camkit.errors import BundleError, ParityError
from camkit.runtime.bank.cell_means import cell_count
from camkit.runtime.bank.haze import CoarseBand, hazy_kernels, solve_coarse
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.scenes.scene_register import named_scene

ALLOWED: Final = 2e-3
"""Of the largest value; half precision takes half of a thousandth."""


def prove_haze(bundle: Bundle) -> str | None:
    """Find the scene of the stored capture again.

    Returns:
        What was shown; None where the bundle stores none.

    Raises:
        BundleError: If the case is damaged or not of this sensor.
        ParityError: If what is found differs by more than is allowed.
    """
    if HAZE_GOLDEN not in bundle.names:
        return None
    case = haze_golden_from_bytes(bundle.member(HAZE_GOLDEN), what=HAZE_GOLDEN)
    if case.cells.shape != _shape(bundle):
        raise BundleError(
            f"{HAZE_GOLDEN} has cells {case.cells.shape}, the sensor {_shape(bundle)}"
        )
    band = _solve(bundle, case.cells)
    worst = 0.0
    for name, got in (("picture", band.picture), ("gain", band.gain)):
        stored = getattr(case, name)
        error = float(np.abs(got - stored).max()) / max(1.0, float(np.abs(stored).max()))
        if not error <= ALLOWED:
            raise ParityError(
                f"the haze: {name} differs from the stored one by {error:.3g}, allowed is "
                f"{ALLOWED:g}; the bundle or a library under it changed"
            )
        worst = max(worst, error)
    return f"the haze of {case.cells.shape[2]} x {case.cells.shape[1]} cells, off by {worst:.2g}"


def make_haze_golden(bundle: Bundle, scene: str) -> HazeGolden:
    """Make the case of a bundle.

    Args:
        bundle: With a stage haze and a sensor of known size.
        scene: A named scene, which is taken for a capture in cells.
    """
    channels, height, width = _shape(bundle)
    colours = named_scene(scene, height, width)
    planes = np.stack([colours[channel % len(colours)] for channel in range(channels)])
    cells = np.clip(planes, 0, 1).astype(np.float16).astype(np.float32)
    band = _solve(bundle, cells)
    return HazeGolden(cells=cells, picture=band.picture, gain=band.gain)


def _stage(bundle: Bundle) -> Dehaze:
    stage = bundle.manifest.stage(Dehaze)
    if stage is None:
        raise BundleError(f"{HAZE_GOLDEN} is there, and no stage haze that it would prove")
    return stage


def _window(bundle: Bundle) -> SensorWindow:
    extent = bundle.manifest.sensor.extent
    if extent is None:
        raise BundleError(f"{HAZE_GOLDEN} is of a whole sensor, and this one has no size")
    size = extent.width_px, extent.height_px
    return SensorWindow(
        size_px=size,
        origin_px=(0, 0),
        sensor_size_px=size,
        pitch_um=extent.pixel_pitch_um,
        axis_px=extent.optical_centre_px,
    )


def _shape(bundle: Bundle) -> tuple[int, int, int]:
    cell_px, (width, height) = _stage(bundle).shrink, _window(bundle).size_px
    channels = len(bundle.manifest.sensor.channels)
    return channels, cell_count(height, cell_px), cell_count(width, cell_px)


def _solve(bundle: Bundle, cells: FloatArray) -> CoarseBand:
    stage, sensor = _stage(bundle), bundle.manifest.light_sensor
    kernels = hazy_kernels(bundle.psf, bundle.haze, *sensor.response_arrays())
    clipped = np.zeros(cells.shape, np.bool_)
    return solve_coarse(
        cells, clipped, kernels, _window(bundle), terms=stage.terms, rounds=stage.rounds
    )
