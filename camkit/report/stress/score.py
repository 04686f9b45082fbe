"""What a method is worth on one capture: PSNR, chi^2, faults, and where it is worst.

Pictures are compared as sRGB values in sensor geometry, vignetting divided out, brightened or
darkened back to the exposure of the scene, with the border cut off.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.colorimetry import apply_matrix, encode_srgb, rec709_from_camera
from camkit.contracts import FloatArray
from camkit.report.stress.consistency import (
    CLIPPED_REACH_PX,
    Residual,
    Scale,
    calibrate,
    near,
    residual,
)
from camkit.report.stress.rig import INPUT, WIENER, Restored, Rig
from camkit.report.stress.scene import Scene
from camkit.report.stress.twin import Shot
from camkit.runtime.color import recover_highlights
from camkit.runtime.envelope import observe
from camkit.runtime.geometry.illumination import divide_illumination

BEST_DB: Final = 120.0
"""Equal pictures would be infinitely good, which no mean survives."""
PATCH_PX: Final = 96
LEAST_SHARE: Final = 0.02
"""A PSNR needs at least this share of the picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One method on one capture.

    Attributes:
        psnr_db: On sRGB values; None where nothing can be compared.
        chi2: Per sample, 1 on nominal captures; None where nothing can be judged.
        fault: What is wrong whatever the PSNR: it breaks the method at this value.
        patch_px: (x, y) of the worst square of `PATCH_PX`.
        extra: Other numbers of the scenario, by name with unit.
    """

    psnr_db: float | None
    chi2: float | None = None
    fault: str | None = None
    patch_px: tuple[int, int] | None = None
    extra: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """All methods on one capture.

    Attributes:
        outcomes: Method -> outcome.
        seen: What the runtime sees of the capture beforehand (`camkit.runtime.envelope`).
    """

    outcomes: Mapping[str, Outcome]
    seen: Mapping[str, float] = field(default_factory=dict)


class Judge:
    """Scores captures of a rig; keeps the calibration of chi^2 per method and scene."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._scales: dict[tuple[str, str], Scale] = {}
        self._scored: dict[bytes, Verdict] = {}

    def score(self, shot: Shot) -> Verdict:
        """Let every method restore a capture and judge it; equal captures are judged once."""
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
        compare = Comparison(shot, self.rig)
        outcomes = {}
        errors = {method: compare.errors(planes) for method, planes in restored.planes.items()}
        plain = [errors[method] for method in (INPUT, WIENER) if method in errors]
        for method, planes in restored.planes.items():
            least = np.minimum.reduce(plain) if method not in (INPUT, WIENER) and plain else 0.0
            psnr_db, patch_px = compare.rate(errors[method], least)
            judged = with_chi2 and method != INPUT
            chi2 = self._chi2(method, planes, shot) if judged else None
            fault = None if np.isfinite(planes).all() else "NaN or inf in the picture"
            outcomes[method] = Outcome(psnr_db=psnr_db, chi2=chi2, fault=fault, patch_px=patch_px)
        for method, fault in restored.faults.items():
            outcomes[method] = Outcome(psnr_db=None, fault=fault)
        return outcomes

    def scale(self, method: str, scene: Scene) -> Scale:
        """Give how chi^2 of a method is counted on a scene, from its nominal capture."""
        if (method, scene.name) not in self._scales:
            shot = self.rig.shoot(scene)
            for name, planes in self.rig.restore(shot).planes.items():
                nominal = residual(planes, shot, self.rig.assumed_lens) if name != INPUT else None
                self._scales[name, scene.name] = Scale() if nominal is None else calibrate(nominal)
        return self._scales.get((method, scene.name), Scale())

    def _chi2(self, method: str, planes: FloatArray, shot: Shot) -> float | None:
        found: Residual | None = residual(planes, shot, self.rig.assumed_lens)
        if found is None:
            return None
        return self.scale(method, shot.light.scene).chi2(found)


def see(rig: Rig, shot: Shot) -> dict[str, float]:
    """Give what the runtime sees of a capture before it is processed."""
    camera = rig.bundle.manifest.camera
    noise = shot.capture.noise or camera.noise_at(shot.capture.iso or 100.0)
    return observe(shot.capture, noise)


def _digest(shot: Shot) -> bytes:
    """Give what decides the verdict on a capture."""
    capture, light = shot.capture, shot.light
    parts: list[object] = [capture.iso, capture.white_balance, capture.white_level, shot.noise]
    parts += [capture.origin_px, shot.exposure, shot.border_px, shot.away_from_clipped]
    parts += [light.scene.name, shot.spoiled is None]
    arrays = (capture.samples, light.clean)
    digest = hashlib.sha256(repr(parts).encode())
    for array in arrays:
        digest.update(np.ascontiguousarray(array).data)
    return digest.digest()


class Comparison:
    """A capture's truth, against which planes are rated."""

    def __init__(self, shot: Shot, rig: Rig) -> None:
        color_matrix = np.array(rig.bundle.manifest.camera.color_matrix, dtype=np.float64)
        self._matrix = rec709_from_camera(color_matrix)
        self._shot, self._psf = shot, rig.lens.psf
        self.sharp = encode_srgb(apply_matrix(self._matrix, shot.light.clean))
        self._judged = _judged_pixels(shot)

    def finish(self, planes: FloatArray) -> FloatArray:
        """Give sRGB values (3, h, w) of white-balanced camera planes of the capture."""
        light = self._shot.light
        raised = recover_highlights(planes, light.gains)
        even = divide_illumination(raised, 0, self._psf, light.window)
        even /= np.float32(self._shot.exposure)
        return encode_srgb(apply_matrix(self._matrix, even))

    def errors(self, planes: FloatArray) -> NDArray[np.float64]:
        """Give (h, w) squared errors of planes, the mean over the colours."""
        error = self.finish(planes).astype(np.float64) - self.sharp
        return np.asarray(np.square(error).mean(axis=0))

    def rate(
        self, error: NDArray[np.float64], least: NDArray[np.float64] | float = 0.0
    ) -> tuple[float | None, tuple[int, int] | None]:
        """Give the PSNR in dB and the (x, y) of the worst patch.

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
    """Give the (x, y) of the square of `PATCH_PX` with the largest mean error, inside."""
    height, width = error.shape
    mean = scipy.ndimage.uniform_filter(error, PATCH_PX, mode="constant")
    half = PATCH_PX // 2
    inner = mean[half : max(height - half + 1, half + 1), half : max(width - half + 1, half + 1)]
    if inner.size == 0:
        return 0, 0
    y, x = np.unravel_index(int(np.argmax(inner)), inner.shape)
    return int(x), int(y)


def _judged_pixels(shot: Shot) -> NDArray[np.bool_]:
    """Give (h, w), true where pictures are compared."""
    capture, border = shot.capture, shot.border_px
    judged = np.ones((capture.height, capture.width), dtype=bool)
    if shot.away_from_clipped:
        judged &= ~near(capture.saturated_rows(0, capture.height), CLIPPED_REACH_PX)
    if border:
        judged[:border] = judged[-border:] = False
        judged[:, :border] = judged[:, -border:] = False
    return judged
