"""The protocol of tables 4.1 and 4.2: whole pictures of known sets, PSNR and SSIM on luminance.

L = 0.299 R + 0.587 G + 0.114 B of the sRGB-coded values, full range; a picture is cut to whole
pixels at its right and lower border, seen at the true phase, counted once, restored, clipped to
0..1 and compared over its whole area. The thesis's own figures could not be reproduced by any
protocol, so they stand beside these as printed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.colorimetry import luma
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.samples import photograph
from camkit.models_def.kinds.spad.sampling import Sampling
from camkit.models_def.networks.bicubic import SCALE, Bicubic
from camkit.models_def.training.kind import Restorer
from camkit.models_def.training.losses import ssim
from camkit.models_def.training.pictures import list_pictures, read_picture

SEED: Final = 404
SETS: Final = ("set5", "set14", "bsd100_half_a")
"""Folders of the test pictures, as they lie beside each other."""
MOST_DB: Final = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureScore:
    """The likeness of pictures to the truth.

    Attributes:
        psnr_db: White = 1; mean over the pictures.
        ssim: 11 px Gaussian of 1.5 px; mean over the pictures.
        pictures: How many.
    """

    psnr_db: float
    ssim: float
    pictures: int


def read_luminance(path: Path) -> FloatArray:
    """Read L (h, w) of a picture, cut to whole pixels of the array.

    Raises:
        DecodeError: If it cannot be decoded.
    """
    coded = np.asarray(read_picture(path).transpose(2, 0, 1) / 255, dtype=np.float32)
    luminance = luma(coded)
    height, width = (n // SCALE * SCALE for n in luminance.shape)
    return np.ascontiguousarray(luminance[:height, :width])


def read_set(folder: Path) -> tuple[FloatArray, ...]:
    """Read all pictures of a folder; raises as `list_pictures` and `read_luminance` do."""
    return tuple(read_luminance(path) for path in list_pictures(folder))


def psnr_db(picture: Tensor, truth: Tensor) -> float:
    """Return the PSNR in dB, white = 1, at most `MOST_DB`."""
    error = float((picture.double() - truth.double()).square().mean())
    return min(float(-10 * np.log10(max(error, 1e-30))), MOST_DB)


def bicubic(sampling: Sampling) -> Restorer:
    """Return bicubic interpolation, a = -0.5, at the true phase of a sampling."""
    finer = Bicubic(SCALE, sampling.phase)
    return lambda planes: torch.as_tensor(finer(planes[:, :1]))


def evaluate(
    pictures: Sequence[FloatArray],
    sampling: Sampling,
    exposure: Exposure,
    restore: Restorer,
    *,
    seed: int = SEED,
) -> PictureScore:
    """Photograph pictures, restore them and compare.

    Args:
        pictures: (h, w) each, of whole pixels.
        sampling: How the array samples.
        exposure: Of one sub-pixel; a pixel that collects more light counts more.
        restore: (1, 2, h, w) light and noise -> (1, 1, 4 h, 4 w).
        seed: Of the noise; every picture has its own.
    """
    scores = evaluate_each(pictures, sampling, exposure, restore, seed=seed)
    mean_psnr, mean_ssim = np.mean(scores, axis=0)
    return PictureScore(psnr_db=float(mean_psnr), ssim=float(mean_ssim), pictures=len(scores))


def evaluate_each(
    pictures: Sequence[FloatArray],
    sampling: Sampling,
    exposure: Exposure,
    restore: Restorer,
    *,
    seed: int = SEED,
) -> tuple[tuple[float, float], ...]:
    """Return PSNR in dB and SSIM of every picture; arguments as of `evaluate`."""
    return tuple(
        _compare(torch.from_numpy(picture)[None, None], sampling, exposure, restore, (seed, i))
        for i, picture in enumerate(pictures)
    )


@torch.no_grad()
def _compare(
    fine: Tensor, sampling: Sampling, exposure: Exposure, restore: Restorer, seed: tuple[int, int]
) -> tuple[float, float]:
    planes = photograph(fine, sampling, exposure, np.random.default_rng(seed))
    restored = restore(planes).clamp(0, 1)
    return psnr_db(restored, fine), float(ssim(restored, fine))
