"""A capture of the comparison, developed for methods that are not of the bundle, and finished.

shot -> simulated capture -> white-balanced planes -> foreign method -> Rec.709
              |
              +--------------> the bundle's own pipeline -------------> Rec.709
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.colorimetry import apply_matrix, rec709_from_camera
from camkit.contracts import FloatArray, FrozenPsf
from camkit.report.quality import Shot, expose
from camkit.runtime.bank.blocks import LocalPsf
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.color import recover_highlights
from camkit.runtime.geometry.illumination import divide_illumination
from camkit.runtime.options import Method, Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.signal.front_rows import FrontRows
from camkit.runtime.simulate import Simulation
from tools.comparison.peers import LocalCapture

PROTOCOL_VERSION: Final = 1
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
        """Give the distance of the crop's middle from the axis."""
        return float(np.hypot(*self.simulation.window.centre_mm))


Restorer = Callable[[Photograph], FloatArray]


def photograph(shot: Shot, scene: FloatArray, bundle: Bundle, lens: FrozenPsf) -> Photograph:
    """Photograph a picture and develop it; see `camkit.report.quality.expose`."""
    exposed = expose(shot, scene, bundle, lens)
    return Photograph(
        simulation=exposed.simulation,
        sharp=exposed.sharp,
        local=_develop(exposed.simulation, bundle),
    )


def finish_planes(planes: FloatArray, taken: Photograph, bundle: Bundle) -> FloatArray:
    """Give linear Rec.709 of white-balanced camera planes, vignetting divided out.

    These are the last stages of the pipeline, for planes that a foreign method restored.
    """
    raised = recover_highlights(planes, taken.simulation.white_balance)
    even = divide_illumination(raised, 0, bundle.psf, taken.simulation.window)
    color_matrix = np.array(bundle.manifest.camera.color_matrix, dtype=np.float64)
    return apply_matrix(rec709_from_camera(color_matrix), even)


def bundle_restorer(bundle: Bundle, *, method: Method = "net", size: str = "M") -> Restorer:
    """Give a restoration of the bundle's pipeline, in sensor geometry, on one thread.

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

    def restore(taken: Photograph) -> FloatArray:
        simulation = taken.simulation
        x, y = (int(v) for v in simulation.window.origin_px)
        return pipeline.process_array(
            simulation.mosaic,
            iso=simulation.iso,
            white_balance=simulation.white_balance,
            origin_px=(x, y),
        )

    return restore


def _develop(simulation: Simulation, bundle: Bundle) -> LocalCapture:
    camera = bundle.manifest.camera
    x, y = (int(v) for v in simulation.window.origin_px)
    capture = Pipeline(bundle, Options(method="wiener", threads=1)).capture_of(
        simulation.mosaic,
        iso=simulation.iso,
        white_balance=simulation.white_balance,
        origin_px=(x, y),
    )
    front = FrontRows(capture, simulation.white_balance, method="fast", repair=True)
    saturated = capture.saturated_rows(0, capture.height)
    return LocalCapture(
        planes=front.read(0, capture.height),
        psf=LocalPsf(
            kernels=color_kernels(bundle.psf, *camera.channel_response.to_arrays()),
            field_heights_mm=bundle.psf.field_heights_mm,
            window=simulation.window,
        ),
        noise=camera.noise_at(simulation.iso).with_gains(simulation.white_balance),
        saturated=saturated if saturated.any() else None,
    )
