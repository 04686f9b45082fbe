"""Worth of a method on one capture: PSNR, chi^2, faults, and where it is worst.

Pictures are compared as sRGB values in sensor geometry, vignetting divided out, brightened or
darkened back to the exposure of the scene, with the border cut off.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.colorimetry import encode_srgb
from camkit.report.stress.consistency import (
    CLIPPED_REACH_PX,
    Scale,
    calibrate,
    near,
    residual,
)
from camkit.report.stress.rig import INPUT, Restored, Rig
from camkit.report.stress.scene import Scene
from camkit.report.stress.shot import NOMINAL_ISO, Shot
from camkit.report.stress.verdict import Outcome, Verdict
from camkit.runtime.envelope import observe
from camkit.runtime.twin.truth import true_picture

BEST_DB: Final = 120.0
"""Equal pictures would be infinitely good, which no mean survives."""
PATCH_PX: Final = 96
LEAST_SHARE: Final = 0.02
"""A PSNR needs at least this share of the picture."""

Numbers = Callable[[FloatArray, FloatArray], Mapping[str, float]]
"""(picture, truth), both (3, h, w) linear Rec.709 -> numbers of a scenario, by name with unit."""


class Judge:
    """Scores captures of cameras that photograph; keeps the calibration of chi^2.

    Attributes:
        rig: The methods.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._scales: dict[tuple[str, str], Scale] = {}
        self._scored: dict[bytes, Verdict] = {}

    @property
    def methods(self) -> tuple[str, ...]:
        """Name the methods, from doing nothing to the networks."""
        return tuple(method.name for method in self.rig.methods)

    @property
    def rivals(self) -> tuple[str, ...]:
        """Name the methods that the networks must not fall behind."""
        return self.rig.rivals

    @property
    def primary(self) -> str:
        """Name the method whose break point is the scenario's."""
        return self.rig.primary

    @property
    def identity(self) -> tuple[object, ...]:
        """Return bundles and methods."""
        earlier_bundle = self.rig.earlier_bundle
        return self.rig.bundle.sha256, earlier_bundle and earlier_bundle.sha256, self.methods

    def pictures(self, shot: Shot) -> dict[str, FloatArray]:
        """Return the truth and what every method made of a capture as sRGB values."""
        compare = Comparison(shot)
        restored = self.rig.restore(shot).pictures
        return {"sharp": compare.sharp} | {m: compare.finish(p) for m, p in restored.items()}

    def score(self, shot: Shot) -> Verdict:
        """Restore a capture by every method and judge it; equal captures are judged once."""
        key = _digest(shot)
        if key not in self._scored:
            outcomes = self.judge(shot, self.rig.restore(shot))
            self._scored[key] = Verdict(outcomes=outcomes, seen=see(self.rig, shot))
        return self._scored[key]

    def judge(
        self, shot: Shot, restored: Restored, *, with_chi2: bool = True
    ) -> dict[str, Outcome]:
        """Judge what the methods made of a capture.

        Args:
            shot: The capture and its truth.
            restored: From the rig.
            with_chi2: False where chi^2 has no calibration.
        """
        compare = Comparison(shot)
        outcomes = {}
        errors = {method: compare.errors(p) for method, p in restored.pictures.items()}
        plain = [errors[method] for method in self.rivals if method in errors]
        for method, picture in restored.pictures.items():
            least = np.minimum.reduce(plain) if method not in self.rivals and plain else 0.0
            psnr_db, patch_px = compare.rate(errors[method], least)
            judged = with_chi2 and method != INPUT
            chi2 = self._chi2(method, restored, shot) if judged else None
            fault = None if np.isfinite(picture).all() else "NaN or inf in the picture"
            outcomes[method] = Outcome(psnr_db=psnr_db, chi2=chi2, fault=fault, patch_px=patch_px)
        for method, fault in restored.faults.items():
            outcomes[method] = Outcome(psnr_db=None, fault=fault)
        return outcomes

    def examine(self, shot: Shot, numbers: Numbers) -> Verdict:
        """Judge a capture of a scene of its own, chi^2 aside, with numbers that belong to it."""
        compare, restored = Comparison(shot), self.rig.restore(shot)
        outcomes = self.judge(shot, restored, with_chi2=False)
        for method, picture in restored.pictures.items():
            extra = numbers(compare.level(picture), compare.truth)
            outcomes[method] = replace(outcomes[method], extra=extra)
        return Verdict(outcomes=outcomes, seen=see(self.rig, shot))

    def scale(self, method: str, scene: Scene) -> Scale:
        """Return how chi^2 of a method is counted on a scene, from its nominal capture."""
        if (method, scene.name) not in self._scales:
            shot = self.rig.shoot(scene)
            for name, planes in self.rig.restore(shot).planes.items():
                nominal = residual(planes, shot, self.rig.assumed_lens) if name != INPUT else None
                self._scales[name, scene.name] = Scale() if nominal is None else calibrate(nominal)
        return self._scales.get((method, scene.name), Scale())

    def _chi2(self, method: str, restored: Restored, shot: Shot) -> float | None:
        if method not in restored.planes:
            return None
        residuals = residual(restored.planes[method], shot, self.rig.assumed_lens)
        return None if residuals is None else self.scale(method, shot.scene).chi2(residuals)


def judge_of(bundle: Bundle, sizes: tuple[str, ...], earlier_bundle: Bundle | None) -> Judge:
    """Return the judge of a camera that photographs.

    Args:
        bundle: What is tested.
        sizes: Of its networks.
        earlier_bundle: Another bundle of the same camera, whose networks stand beside.
    """
    return Judge(Rig(bundle, sizes, earlier_bundle=earlier_bundle))


def see(rig: Rig, shot: Shot) -> dict[str, float]:
    """Return what the runtime sees of a capture before it is processed."""
    noise = shot.capture.noise or rig.sensor.noise_at(shot.capture.iso or NOMINAL_ISO)
    return observe(shot.capture, noise)


def _digest(shot: Shot) -> bytes:
    """Return what decides the verdict on a capture."""
    capture, light = shot.capture, shot.light
    parts: list[object] = [capture.iso, capture.white_balance, capture.white_level, shot.noise]
    parts += [capture.origin_px, shot.exposure, shot.border_px, shot.away_from_clipped]
    parts += [shot.scene.name, shot.spoiled is None, capture.noise]
    return digest_of(parts, (capture.samples, capture.black_level, light.clean))


def digest_of(facts: Sequence[object], arrays: Iterable[NDArray[Any]]) -> bytes:
    """Return a hash of facts and arrays."""
    digest = hashlib.sha256(repr(facts).encode())
    for array in arrays:
        digest.update(np.ascontiguousarray(array).data)
    return digest.digest()


class Comparison:
    """A capture's truth, against which pictures are rated.

    Attributes:
        truth: (3, h, w) linear Rec.709.
        sharp: (3, h, w) sRGB values of it.
    """

    def __init__(self, shot: Shot) -> None:
        self._exposure = np.float32(shot.exposure)
        self.truth = true_picture(shot.light.clean, shot.sensor)
        self.sharp = encode_srgb(self.truth)
        self._judged = _judged_pixels(shot)

    def finish(self, picture: FloatArray) -> FloatArray:
        """Return sRGB values (3, h, w) of linear Rec.709, at the brightness of the scene."""
        return encode_srgb(self.level(picture))

    def level(self, picture: FloatArray) -> FloatArray:
        """Return linear Rec.709 (3, h, w) at the brightness of the scene."""
        return picture / self._exposure

    def errors(self, picture: FloatArray) -> NDArray[np.float64]:
        """Return (h, w) squared errors of linear Rec.709, the mean over the colours."""
        error = self.finish(picture).astype(np.float64) - self.sharp
        return np.asarray(np.square(error).mean(axis=0))

    def rate(
        self, error: NDArray[np.float64], least: NDArray[np.float64] | float = 0.0
    ) -> tuple[float | None, tuple[int, int] | None]:
        """Return the PSNR in dB and the (x, y) of the worst patch.

        Args:
            error: Of the method, from `errors`.
            least: What simpler methods leave: the worst patch is where `error` exceeds it most,
                so that it shows where the method fails and not where the scene is hard.
        """
        if self._judged.mean() < LEAST_SHARE:
            return None, None
        mean = float(error[self._judged].mean())
        if not np.isfinite(mean):
            return None, None
        psnr_db = BEST_DB if mean == 0 else min(-10 * float(np.log10(mean)), BEST_DB)
        return psnr_db, worst_patch(np.where(self._judged, error - least, 0))


def worst_patch(error: NDArray[np.float64]) -> tuple[int, int]:
    """Return the (x, y) of the square of `PATCH_PX` with the largest mean error, inside."""
    height, width = error.shape
    mean = scipy.ndimage.uniform_filter(error, PATCH_PX, mode="constant")
    half = PATCH_PX // 2
    inner = mean[half : max(height - half + 1, half + 1), half : max(width - half + 1, half + 1)]
    if inner.size == 0:
        return 0, 0
    y, x = np.unravel_index(int(np.argmax(inner)), inner.shape)
    return int(x), int(y)


def _judged_pixels(shot: Shot) -> NDArray[np.bool_]:
    """Return (h, w) of the picture, true where pictures are compared."""
    capture, border = shot.capture, shot.border_px
    judged = np.ones((capture.height, capture.width), dtype=bool)
    if shot.away_from_clipped:
        clipped = capture.saturated_rows(0, capture.height)
        any_clipped = np.logical_or.reduce(clipped.reshape(-1, *judged.shape))
        judged &= ~near(any_clipped, CLIPPED_REACH_PX)
    if border:
        judged[:border] = judged[-border:] = False
        judged[:, :border] = judged[:, -border:] = False
    scale = shot.scene.scale
    return judged.repeat(scale, axis=0).repeat(scale, axis=1)
