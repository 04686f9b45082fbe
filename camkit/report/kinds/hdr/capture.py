"""A scene photographed twice: with the plate, and through the bare lens that it stands beside.

scene, ends at 2^8 -> capture with streaks                -> what methods get
                   -> capture of the bare lens, developed -> what they are held against
"""

from dataclasses import replace
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle
from camkit.cfa import CfaPattern, cfa_channels
from camkit.report.quality import Exposed, Shot, expose
from camkit.report.sensor_geometry import in_sensor_geometry
from camkit.runtime.capture import Capture
from camkit.runtime.network.engine import available_threads
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.twin.light import stated_balance
from camkit.runtime.twin.simulate import Simulation, bare_psf
from camkit.runtime.twin.truth import light_sensor, true_picture
from camkit.scenes.saturation import CEILING

REACH_PX: Final = 1
"""A pixel is made of samples of its colour at most so far away."""


def photograph(shot: Shot, scene: FloatArray, bundle: Bundle, lens: FrozenOptics) -> Exposed:
    """Photograph a scene, and beside it what the bare lens gives.

    Args:
        shot: Place, ISO and noise of both captures.
        scene: (3, h, w) float32 linear Rec.709; ends at 2^8 times white.
        bundle: The camera; its optics write streaks.
        lens: With its plate.

    Returns:
        The capture with streaks. Its extras are `linear`, the truth; `input`, the capture of the
        bare lens as it is developed; `clipped`, what clipped in either of the two captures.
    """
    ended = np.minimum(scene, np.float32(CEILING))
    bare_optics = FrozenOptics(psf=bare_psf(bundle))
    coded, bare = (expose(shot, ended, bundle, optics) for optics in (lens, bare_optics))
    pipeline = developer(bundle, available_threads(None))
    captures = [capture_of(pipeline, exposed.simulation) for exposed in (coded, bare)]
    extras = {
        "linear": true_picture(coded.simulation.clean, light_sensor(bundle.manifest)),
        "input": pipeline.start(captures[1]).fill(),
        "clipped": np.logical_or(*(clipped_planes(capture) for capture in captures)),
    }
    return replace(coded, extras=extras)


def developer(bundle: Bundle, threads: int) -> Pipeline:
    """Return what develops captures of a camera and restores nothing, in sensor geometry."""
    geometry = in_sensor_geometry(bundle.manifest)
    return Pipeline(bundle, Options(method=DEVELOP, threads=threads, **geometry))


def capture_of(pipeline: Pipeline, simulation: Simulation) -> Capture:
    """Return a simulated photograph as its camera's pipeline takes it."""
    x, y = (int(v) for v in simulation.window.origin_px)
    capture: Capture = pipeline.capture_of(
        simulation.samples,
        iso=simulation.iso,
        white_balance=stated_balance(simulation.white_balance),
        origin_px=(x, y),
    )
    return capture


def clipped_planes(capture: Capture) -> NDArray[np.bool_]:
    """Return (3, h, w): pixels of each colour that are made of a clipped sample of it."""
    clipped = capture.saturated_rows(0, capture.height)
    planes = sites_of(capture.cfa, clipped.shape) & clipped
    side = 2 * REACH_PX + 1
    return np.asarray(scipy.ndimage.maximum_filter(planes, (1, side, side), mode="constant"))


def sites_of(cfa: CfaPattern | None, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return (3, h, w): where a mosaic (h, w) has samples of each colour; everywhere in planes."""
    planes = np.ones((3, *shape[-2:]), dtype=bool)
    if cfa is None:
        return planes
    for row, colours in enumerate(cfa_channels(cfa)):
        for column, colour in enumerate(colours):
            planes[:, row::2, column::2] = (np.arange(3) == colour)[:, None, None]
    return planes
