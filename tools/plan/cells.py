"""Losses of every lattice cell of a simulated capture with less than the exact result.

    picture -> capture -> content, and per cell the squared sRGB error of exact, bank, development
                           and every other size of network

The captures go through the bundle's own optics; `tools/plan_report.py` fits the loss model to them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.colorimetry import apply_matrix, encode_srgb
from camkit.report.quality import BORDER_PX, FIELD_SHARES, QUADRANTS, crop_origin
from camkit.runtime.content import CELL_PX, CellArray, Content, lattice_shape, measure_content
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.plan.loss import EXACT
from camkit.runtime.plan.rules.size import REFERENCE
from camkit.runtime.twin.simulate import Simulation, SimulationOptions
from camkit.runtime.twin.simulate import photograph as photographed
from tools.capture.simulated import captured, color_sensor, rec709_of

PLAIN_TARGET: Final = "plain"
WIENER_TARGET: Final = "wiener"


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureCells:
    """One capture, measured cell by cell.

    Attributes:
        name: Picture and ISO.
        content: What the runtime sees of it.
        pixels: (row, column) pixels that count; a border of BORDER_PX does not.
        errors: Target -> (row, column) squared sRGB error summed over pixels and colours / 3.
    """

    name: str
    content: Content
    pixels: CellArray
    errors: dict[str, CellArray]


def photograph(
    bundle: Bundle, scene: FloatArray, *, number: int, iso: float, exposure: float = 1.0
) -> Simulation:
    """Photograph a picture at a place of the sensor and a distance that are drawn by chance.

    Args:
        bundle: The camera.
        scene: (3, h, w) linear Rec.709.
        number: Seed of field position, quadrant, distance (of those the PSF knows), each drawn
            apart from the others, and of the noise.
        iso: Sensitivity.
        exposure: Factor on the scene.
    """
    sensor = color_sensor(bundle)
    size = (scene.shape[2], scene.shape[1])
    whole = (sensor.width_px, sensor.height_px)
    rng = np.random.default_rng(number)
    share = FIELD_SHARES[rng.integers(len(FIELD_SHARES))]
    origin = crop_origin(size, whole, share, QUADRANTS[rng.integers(len(QUADRANTS))])
    depths_mm = bundle.psf.depths_mm
    options = SimulationOptions(
        iso=iso,
        seed=1000 * number + int(iso),
        origin_px=origin,
        exposure=exposure,
        depth_mm=float(rng.choice(depths_mm)),
    )
    return photographed(scene, bundle, options)


def sharp_of(simulation: Simulation, bundle: Bundle) -> FloatArray:
    """Return (3, h, w) sRGB values of the sharp picture in sensor geometry."""
    return encode_srgb(apply_matrix(rec709_of(color_sensor(bundle)), simulation.clean))


def start(pipeline: Pipeline, simulation: Simulation) -> Reconstruction:
    """Plan the reconstruction of a simulated capture."""
    return pipeline.start(captured(pipeline, simulation))


def cell_sums(squares: FloatArray) -> CellArray:
    """Sum (h, w) over the lattice cells, without a border of BORDER_PX."""
    inner = np.zeros(squares.shape, dtype=np.float64)
    inside = np.s_[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    inner[inside] = squares[inside]
    rows = np.add.reduceat(inner, np.arange(0, squares.shape[0], CELL_PX), axis=0)
    sums = np.add.reduceat(rows, np.arange(0, squares.shape[1], CELL_PX), axis=1)
    return np.asarray(sums.reshape(lattice_shape(*squares.shape)))


def cell_errors(restored: FloatArray, sharp: FloatArray) -> CellArray:
    """Return the squared sRGB error per cell of linear Rec.709 against sRGB values."""
    return cell_sums(np.square(encode_srgb(restored) - sharp).mean(axis=0))


def pipelines(bundle: Bundle) -> Mapping[str, Pipeline]:
    """Return a pipeline per target, in sensor geometry, on one thread."""
    by_target = {
        EXACT: Pipeline(bundle, Options(size=REFERENCE, undistort=False, threads=1)),
        WIENER_TARGET: Pipeline(bundle, Options(method="wiener", undistort=False, threads=1)),
    }
    for size in bundle.manifest.sizes:
        if size != REFERENCE:
            by_target[size] = Pipeline(bundle, Options(size=size, undistort=False, threads=1))
    # where nothing else is done to a cell, the haze is taken out of it all the same
    least = "haze" if bundle.manifest.has_haze else DEVELOP
    by_target[PLAIN_TARGET] = Pipeline(bundle, Options(method=least, undistort=False, threads=1))
    return by_target


def measure_cells(
    bundle: Bundle, targets: Mapping[str, Pipeline], name: str, simulation: Simulation
) -> CaptureCells:
    """Reconstruct a capture by every target and measure the errors per cell.

    Args:
        bundle: The camera.
        targets: From `pipelines`.
        name: Of the capture.
        simulation: The capture and the truth.
    """
    sharp = sharp_of(simulation, bundle)
    errors = {}
    for target, pipeline in targets.items():
        errors[target] = cell_errors(start(pipeline, simulation).fill(None), sharp)
    noise = color_sensor(bundle).noise_at(simulation.iso).with_gains(simulation.white_balance)
    capture = captured(targets[PLAIN_TARGET], simulation)
    content = measure_content(capture, noise, simulation.white_balance, simulation.window)
    return CaptureCells(
        name=name,
        content=content,
        pixels=cell_sums(np.ones(sharp.shape[1:], np.float32)),
        errors=errors,
    )
