"""What of a capture a picture does not explain: |PSF * x - y| / sigma of every sample, squared.

    picture x -> light through the lens, its haze too -> what the samples would be -> against y

Sigma is the noise of photons, amplifier and converter alone. Of the true scene the mean is 1; above
it a picture holds what the capture denies, or lacks what it shows. What the optics pass nothing of
is neither.
"""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.analysis.point_image import Array
from camkit.report.stress.consistency import CLIPPED_REACH_PX, near
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import signal_of, variance_of
from camkit.runtime.twin.light import Lens, LightOptions, light_of


def unexplained(picture: FloatArray, shot: Shot, lens: Lens) -> Array:
    """Give chi^2 of every pixel, (h, w); NaN near clipped samples.

    Args:
        picture: (3, s h, s w) linear Rec.709 in the geometry of the sensor, vignetting divided
            out; where that is not finite or below zero it counts as black.
        shot: Its capture.
        lens: What the light went through.
    """
    capture = shot.capture
    seen = np.nan_to_num(np.maximum(picture, 0), nan=0.0, posinf=0.0).astype(np.float32)
    options = LightOptions(exposure=shot.exposure, scale=shot.scene.scale, distort=False)
    light = light_of(seen, shot.sensor, lens, shot.light.window, options)
    predicted = signal_of(light, shot.sensor).astype(np.float64)
    captured = capture.linear_rows(0, capture.height).astype(np.float64)
    chi2 = np.square(captured - predicted) / variance_of(predicted, shot.noise, shot.step)
    chi2[near(capture.saturated_rows(0, capture.height), CLIPPED_REACH_PX)] = np.nan
    # planes are as many samples of a pixel
    return np.asarray(chi2 if chi2.ndim == 2 else chi2.mean(axis=0))
