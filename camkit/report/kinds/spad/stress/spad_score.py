"""Worth of a picture, or of depth, beside the truth.

pictures  PSNR of light, white = 1, of the whole picture; chi^2 is the squared error over that of
          the same way on the undisturbed capture of the scene
depth     the time that the bins span over the mean error, in dB, stands in the place of PSNR;
          chi^2 is the square of the 68 % quantile of |error| / sigma where a return is believed
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.report.kinds.spad.stress.spad_shot import DepthShot
from camkit.report.stress.score import BEST_DB, worst_patch
from camkit.report.stress.verdict import Outcome
from camkit.runtime.kinds.spad.sharpen import Sharpened
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS

OF_PICTURES: Final = (
    "chi^2 is the squared error over that of the same way on the undisturbed capture."
)
OF_DEPTH: Final = (
    "chi^2 is the square of what 68 % of the errors of believed sub-pixels stay below, in sigmas."
)
"""For the notes of scenarios."""
ONE_SIGMA: Final = 0.6827
FAR_MM: Final = 15.0
"""Beyond, a depth is another surface's."""
LEAST_VALID: Final = 0.5
MOST_WRONG: Final = 0.05
"""Of the believed sub-pixels: further off than the gate is wide."""
LEAST_BOTH: Final = 0.5
NEAR_PS: Final = 100.0
"""Of two surfaces; of nearer ones half of what they lie apart."""
FEWEST: Final = 100
"""Believed sub-pixels, of which a quantile may be taken."""
MM_PER_PS: Final = LIGHT_M_PER_PS / 2 * 1000


def picture_errors(picture: FloatArray, truth: FloatArray) -> NDArray[np.float64]:
    """Return squared errors (h, w) of light; what no screen shows is cut off."""
    return np.square(np.clip(picture, 0, 1).astype(np.float64) - truth)


def picture_outcome(
    errors: NDArray[np.float64], least: NDArray[np.float64] | float, nominal: float | None
) -> Outcome:
    """Judge a picture.

    Args:
        errors: Squared.
        least: Those of simpler ways: the worst patch is where they are exceeded most.
        nominal: Mean of the same way's on the undisturbed capture; None for no chi^2.
    """
    mean = float(errors.mean())
    if not np.isfinite(mean):
        return Outcome(psnr_db=None, fault="NaN or inf in the picture")
    return Outcome(
        psnr_db=_decibels(1, np.sqrt(mean)),
        chi2=None if not nominal else mean / nominal,
        patch_px=worst_patch(errors - least),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DepthErrors:
    """Errors of a way.

    Attributes:
        first_ps: (m h, m w) of the nearer surface.
        preview: (m h, m w) 0..1, for people to look at.
    """

    first_ps: NDArray[np.float64]
    preview: FloatArray


def depth_errors(depth: Sharpened, shot: DepthShot) -> DepthErrors:
    """Compare times with the truth."""
    edges = shot.axis.edges_ps
    share = (depth.time_of_flight_ps[0] - edges[0]) / (edges[-1] - edges[0])
    return DepthErrors(
        first_ps=depth.time_of_flight_ps[0] - shot.times_ps[0],
        preview=np.asarray(np.clip(share, 0, 1), np.float32),
    )


def depth_outcome(depth: Sharpened, shot: DepthShot, least: NDArray[np.float64] | float) -> Outcome:
    """Judge depth; `least` are the errors of simpler ways, in ps."""
    errors, judged = depth_errors(depth, shot), shot.judged
    errors_ps = np.asarray(np.abs(errors.first_ps))
    if not np.isfinite(errors_ps[judged]).all():
        return Outcome(psnr_db=None, fault="NaN or inf in the times")
    valid = depth.valid[0] & judged
    span_ps = float(shot.axis.edges_ps[-1] - shot.axis.edges_ps[0])
    mean_ps = float(errors_ps[judged].mean())
    share = float(valid.sum() / judged.sum())
    wrong = float((errors_ps[valid] > shot.pulse.height_ps).mean()) if valid.any() else 0.0
    outcome = Outcome(
        psnr_db=_decibels(span_ps, mean_ps),
        chi2=_spread(errors_ps, depth.sigma_ps[0], valid),
        fault=_fault(share, wrong),
        patch_px=worst_patch(np.where(judged, errors_ps - least, 0)),
        extra={
            "mean_error_mm": mean_ps * MM_PER_PS,
            "bias_mm": float(np.median(errors.first_ps[judged])) * MM_PER_PS,
            "far_share": float((errors_ps[judged] * MM_PER_PS > FAR_MM).mean()),
            "valid_share": share,
        },
    )
    return outcome if len(shot.times_ps) == 1 else _with_second(outcome, depth, shot)


def _with_second(outcome: Outcome, depth: Sharpened, shot: DepthShot) -> Outcome:
    reach_ps = min(NEAR_PS, float(np.ptp(shot.times_ps, axis=0).max()) / 2)
    near = np.abs(depth.time_of_flight_ps - shot.times_ps) < reach_ps
    both_valid: NDArray[np.bool_] = np.all(near & depth.valid, axis=0)
    both = float(both_valid[shot.judged].mean())
    few = f"both surfaces within {reach_ps:.3g} ps in {both:.0%} of the sub-pixels"
    fault = few if both < LEAST_BOTH else None
    return replace(outcome, chi2=None, fault=fault, extra={**outcome.extra, "both_share": both})


def _spread(
    away_ps: NDArray[np.float64], sigma_ps: NDArray[np.float64], valid: NDArray[np.bool_]
) -> float | None:
    if valid.sum() < FEWEST:
        return None
    return float(np.quantile(away_ps[valid] / sigma_ps[valid], ONE_SIGMA)) ** 2


def _fault(valid: float, wrong: float) -> str | None:
    if valid < LEAST_VALID:
        return f"{valid:.0%} of the sub-pixels are believed"
    return f"{wrong:.0%} of the believed are of no surface" if wrong > MOST_WRONG else None


def _decibels(peak: float, error: float) -> float:
    return BEST_DB if error == 0 else min(20 * float(np.log10(peak / error)), BEST_DB)
