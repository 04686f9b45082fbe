"""A capture of the comparison, developed for methods that are not of the bundle, and finished.

shot -> simulated capture -> white-balanced planes -> foreign method -> Rec.709
              |
              +--------------> the bundle's own pipeline -------------> Rec.709
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Wiener
from camkit.colorimetry import apply_matrix
from camkit.errors import ContractError
from camkit.report.quality import Shot, expose
from camkit.runtime.bank.blocks import LocalPsf
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.color import recover_highlights
from camkit.runtime.geometry.illumination import divide_illumination
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation
from tools.capture.simulated import captured, color_sensor, rec709_of
from tools.comparison.peers import LocalCapture

PROTOCOL_VERSION: Final = 2
"""2: through eight copies."""
TUNING_SEED: Final = 2004
"""Fabrication errors that the classical methods are tuned on; no comparison uses them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """A capture that was simulated, beside the truth.

    Attributes:
        simulation: Mosaic and place.
        sharp: (3, h, w) float32 sRGB values of the sharp picture in sensor geometry.
        local: The developed planes for methods that are not of the bundle.
    """

    simulation: Simulation
    sharp: FloatArray
    local: LocalCapture

    @property
    def height_mm(self) -> float:
        """Return the distance of the crop's middle from the axis."""
        return float(np.hypot(*self.simulation.window.centre_mm))


Restorer = Callable[[Photograph], FloatArray]


def photograph(shot: Shot, scene: FloatArray, bundle: Bundle, lens: FrozenOptics) -> Photograph:
    """Photograph a picture and develop it; see `camkit.report.quality.expose`."""
    exposed = expose(shot, scene, bundle, lens)
    return Photograph(
        simulation=exposed.simulation,
        sharp=exposed.sharp,
        local=_develop(exposed.simulation, bundle),
    )


def finish_planes(planes: FloatArray, capture: Photograph, bundle: Bundle) -> FloatArray:
    """Return linear Rec.709 of white-balanced camera planes, vignetting divided out.

    These are the last stages of the pipeline, for planes that a foreign method restored.
    """
    red, green, blue = capture.simulation.white_balance
    raised = recover_highlights(planes, (red, green, blue))
    even = divide_illumination(raised, 0, bundle.psf, capture.simulation.window)
    return apply_matrix(rec709_of(color_sensor(bundle)), even)


def bundle_restorer(bundle: Bundle, *, method: str = "net", size: str = "M") -> Restorer:
    """Return a restoration of the bundle's pipeline, in sensor geometry, on one thread.

    Args:
        bundle: The camera.
        method: The network, the Wiener bank or another classical method on its blocks.
        size: Of the network.

    Raises:
        ContractError: If the bundle lacks the size.
    """
    pipeline = Pipeline(
        bundle, Options(method=method, size=size, undistort=False, vignetting=True, threads=1)
    )

    def restore(capture: Photograph) -> FloatArray:
        return pipeline.start(captured(pipeline, capture.simulation)).fill()

    return restore


def _develop(simulation: Simulation, bundle: Bundle) -> LocalCapture:
    """Return what the bundle's own bank is given.

    Raises:
        ContractError: If the bundle has no bank.
    """
    bank, sensor = bundle.manifest.stage(Wiener), color_sensor(bundle)
    if bank is None:
        raise ContractError(
            f"classical methods are compared with a Wiener bank; {bundle.manifest.name} has none"
        )
    pipeline = Pipeline(bundle, Options(method="wiener", demosaic="fast", threads=1))
    work = pipeline.start(captured(pipeline, simulation))
    planes, *masks = (work.rows_of(name) for name in bank.takes)
    height = planes.shape[1]
    saturated = masks[0].read(0, height) if masks else None
    return LocalCapture(
        planes=planes.read(0, height),
        psf=LocalPsf(
            kernels=color_kernels(bundle.psf, *sensor.response_arrays()),
            window=simulation.window,
        ),
        noise=sensor.noise_at(simulation.iso).with_gains(simulation.white_balance),
        saturated=None if saturated is None or not saturated.any() else saturated,
    )
