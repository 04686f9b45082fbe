"""Scores of a recovered picture of high dynamic range.

    result, truth -> as they are ------------> PSNR to 2^8, stops, unclipped, mu-law, PU21, EVs
             `----> one log scale (`aligned`) -> the same numbers, names in `_aligned`

Signals are linear, 1.0 = white, at most `CEILING` = 2^8. No PSNR exceeds `BEST_DB`: equal pictures
would be infinitely good, which no mean survives. What cannot be measured on a picture (stops where
nothing exceeds white, say) is left out.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from camkit.arrays import FloatArray
from camkit.colorimetry import encode_srgb
from camkit.errors import ContractError
from camkit.report.pu21 import MOST_NITS, pu21_mean_square, pu21_ssim
from camkit.scenes.saturation import CEILING

BEST_DB: Final = 120.0
MU: Final = 5000.0
EXPOSURES_EV: Final = (0, 4, 8)
NITS_PER_UNIT: Final = MOST_NITS / CEILING
"""White is 39.0625 cd/m^2 unless said otherwise: the ceiling is the end of PU21's range."""
GUESS_PER_PX2: Final = 0.6
DARKEST: Final = 2.0**-8
"""What is darker counts as this where stops are measured."""
ALIGN_FLOOR: Final = 0.01
"""Samples below say little about the scale of a picture: they are noise."""
ALIGNED: Final = "_aligned"
LEAST_SIDE_PX: Final = 11

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """Reference that a result is compared with.

    Attributes:
        truth: (3, h, w) float32 linear, at most `CEILING`.
        clipped: (3, h, w) bool, samples that are clipped in the capture; None if not known.
        bare: (3, h, w) float32 linear, the picture of the bare lens clipped at white; None if not
            known.
        nits_per_unit: Luminance of white in cd/m^2, see dissertation, eq. (2.1).
    """

    truth: FloatArray
    clipped: Mask | None = None
    bare: FloatArray | None = None
    nits_per_unit: float = NITS_PER_UNIT

    def __post_init__(self) -> None:
        check_picture("truth", self.truth, self.truth.shape)
        if self.bare is not None:
            check_picture("picture of the bare lens", self.bare, self.truth.shape)
        if self.clipped is not None and self.clipped.shape != self.truth.shape:
            raise ContractError(
                f"the mask of clipped samples must be {self.truth.shape}; got {self.clipped.shape}"
            )
        if not 0 < self.nits_per_unit < np.inf:
            raise ContractError(
                f"white must have a luminance > 0 cd/m^2; got {self.nits_per_unit:g}"
            )

    def cropped(self, inside: tuple[slice, ...]) -> "Reference":
        """Return a part of it."""
        return Reference(
            truth=self.truth[inside],
            clipped=None if self.clipped is None else self.clipped[inside],
            bare=None if self.bare is None else self.bare[inside],
            nits_per_unit=self.nits_per_unit,
        )


def hdr_scores(result: FloatArray, reference: Reference) -> dict[str, float]:
    """Return every number of a result.

    Args:
        result: (3, h, w) float32 linear.
        reference: Of the same shape.

    Returns:
        `hdr_psnr_db`, `stops_rmse`, `unclipped_psnr_db`, `mu_psnr_db`, `pu21_psnr_db`,
        `pu21_ssim`, `ev0_psnr_db`, `ev4_psnr_db`, `ev8_psnr_db`, and the same after `aligned`.

    Raises:
        ContractError: If the result is not finite or of another shape.
    """
    check_picture("result", result, reference.truth.shape)
    scores = _scores(result, reference)
    aligned_scores = _scores(aligned(result, reference.truth), reference)
    return scores | {f"{name}{ALIGNED}": value for name, value in aligned_scores.items()}


def guess_scores(reference: Reference) -> dict[str, float]:
    """Return `stops_rmse_guess`, also aligned: the stops of `blob_guess`, where it can be made."""
    if reference.clipped is None or reference.bare is None:
        return {}
    truth = reference.truth
    guess = blob_guess(reference.bare, reference.clipped)
    errors = {"": stops_rmse(guess, truth), ALIGNED: stops_rmse(aligned(guess, truth), truth)}
    return {f"stops_rmse_guess{end}": v for end, v in errors.items() if v is not None}


def check_picture(name: str, picture: FloatArray, shape: tuple[int, ...]) -> None:
    """Refuse a picture that cannot be scored.

    Raises:
        ContractError: If it is not (3, h, w), too small, of another shape, or not finite.
    """
    if picture.ndim != 3 or picture.shape[0] != 3 or picture.shape != shape:
        raise ContractError(f"the {name} must be (3, h, w) as the truth; got {picture.shape}")
    if min(picture.shape[1:]) < LEAST_SIDE_PX:
        raise ContractError(
            f"the {name} must have {LEAST_SIDE_PX} px a side, for SSIM; got {picture.shape}"
        )
    bad = picture.size - int(np.count_nonzero(np.isfinite(picture)))
    if bad:
        raise ContractError(f"the {name} must be finite; {bad} samples are NaN or infinite")


def psnr_db(mean_square: float, peak: float = 1.0) -> float:
    """Return a PSNR in dB, at most `BEST_DB`, of a mean squared error."""
    least = peak**2 * 10 ** (-BEST_DB / 10)
    return float(10 * np.log10(peak**2 / max(mean_square, least)))


def stops_rmse(result: FloatArray, truth: FloatArray) -> float | None:
    """Return the RMS of log2(result / truth) over samples whose truth exceeds white; None for none.

    What is darker than `DARKEST` counts as that.
    """
    bright = truth > 1
    if not bright.any():
        return None
    got = np.maximum(result[bright].astype(np.float64), DARKEST)
    return float(np.sqrt(np.mean(np.square(np.log2(got / truth[bright])))))


def mu_law(linear: FloatArray) -> NDArray[np.float64]:
    """Map 0..`CEILING` to 0..1 by a logarithm; what lies outside is cut.

    References: Kalantari and Ramamoorthi, "Deep high dynamic range imaging of dynamic scenes",
        ACM TOG 36(4), 2017: the curve before the loss, with mu = 5000.
    """
    share = np.clip(linear.astype(np.float64) / CEILING, 0, 1)
    return np.asarray(np.log1p(MU * share) / np.log1p(MU))


def exposed(linear: FloatArray, down_ev: float) -> FloatArray:
    """Return sRGB values of a picture exposed by so many stops less, clipped at white."""
    return encode_srgb(linear * np.float32(2.0**-down_ev))


def aligned(result: FloatArray, truth: FloatArray) -> FloatArray:
    """Return the result times the scale that fits it best to the truth in log space.

    Least absolute deviations of log(scale x result / truth) over the samples in which both exceed
    `ALIGN_FLOOR`: the scale is the median of truth / result; 1 where there are none. Least squares
    would let the few lights that are lost move the scale of all the rest.
    """
    bright = (truth > ALIGN_FLOOR) & (result > ALIGN_FLOOR)
    if not bright.any():
        return result
    scale = np.median(truth[bright].astype(np.float64) / result[bright])
    return np.asarray(result * np.float32(scale), dtype=np.float32)


def blob_guess(bare: FloatArray, clipped: Mask) -> FloatArray:
    """Estimate clipped lights from the size of their blobs alone, which measures nothing.

    A clipped sample d pixels from the nearest sample of its colour that is not clipped gets
    0.6 d^2, at least white and at most `CEILING`; the others keep the picture of the bare lens.
    What lies outside the frame counts as not clipped.

    Args:
        bare: (3, h, w) float32 linear, clipped at white.
        clipped: (3, h, w).
    """
    border = ((1, 1), (1, 1))
    distance = np.stack(
        [distance_transform_edt(np.pad(plane, border))[1:-1, 1:-1] for plane in clipped]
    )
    lights = np.clip(GUESS_PER_PX2 * np.square(distance), 1, CEILING)
    return np.asarray(np.where(clipped, lights, bare), dtype=np.float32)


def _scores(result: FloatArray, reference: Reference) -> dict[str, float]:
    truth, nits = reference.truth, reference.nits_per_unit
    scores = {
        "hdr_psnr_db": psnr_db(_mean_square(result, truth), CEILING),
        "stops_rmse": stops_rmse(result, truth),
        "mu_psnr_db": psnr_db(_mean_square(mu_law(result), mu_law(truth))),
        "pu21_psnr_db": psnr_db(pu21_mean_square(result, truth, nits)),
        "pu21_ssim": pu21_ssim(result, truth, nits),
    }
    if reference.clipped is not None and not reference.clipped.any(axis=0).all():
        # colours of the output are mixed of those of the camera
        unclipped = np.broadcast_to(~reference.clipped.any(axis=0), truth.shape)
        scores["unclipped_psnr_db"] = psnr_db(_mean_square(result[unclipped], truth[unclipped]))
    for ev in EXPOSURES_EV:
        scores[f"ev{ev}_psnr_db"] = psnr_db(_mean_square(exposed(result, ev), exposed(truth, ev)))
    return {name: value for name, value in scores.items() if value is not None}


def _mean_square(one: FloatArray | NDArray[np.float64], other: object) -> float:
    difference = one.astype(np.float64) - np.asarray(other, dtype=np.float64)
    return float(np.mean(np.square(difference)))
