"""Difference of two pictures to the eye, place by place: by VGG features, or by gradients.

Without the weights of a network the substitute is the dissimilarity of gradient magnitudes at
three scales: 0 where edges are equally strong, towards 1 where one picture alone has an edge.

References: Xue et al. 2014 (gradient magnitude similarity), with its Prewitt filters and constant.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.report.analysis.point_image import Array

SUBSTITUTE: Final = "gradient magnitude dissimilarity, 3 scales"
VGG: Final = "VGG-19 conv3_3, mean square"
SCALES: Final = 3
CONSTANT: Final = 0.0026
"""170 of Xue et al. for values up to 255."""
LUMA: Final = (0.2126, 0.7152, 0.0722)
Measure = Callable[[FloatArray, FloatArray], Array]


def looks_different(first: FloatArray, second: FloatArray) -> Array:
    """Return the dissimilarity (h, w) of two pictures (3, h, w) of sRGB values, without weights."""
    one, other = (np.tensordot(LUMA, p.astype(np.float64), axes=1) for p in (first, second))
    height, width = one.shape
    total = np.zeros((height, width))
    for scale in range(SCALES):
        size = max(width >> scale, 3), max(height >> scale, 3)
        a, b = (_gradient(cv2.resize(p, size, interpolation=cv2.INTER_AREA)) for p in (one, other))
        difference = 1 - (2 * a * b + CONSTANT) / (a * a + b * b + CONSTANT)
        total += cv2.resize(difference, (width, height), interpolation=cv2.INTER_LINEAR)
    return total / SCALES


def vgg_measure(weights: Path) -> Measure:
    """Return the measure by the features of VGG-19 (needs torch).

    Raises:
        ContractError: If the file does not hold its weights.
    """
    import torch

    from camkit.models_def.training.adversarial.content import Conv33

    network = Conv33(weights)

    def measure(first: FloatArray, second: FloatArray) -> Array:
        with torch.no_grad():
            one, other = (
                network(torch.from_numpy(np.ascontiguousarray(p, np.float32))[None])[0].numpy()
                for p in (first, second)
            )
        difference = np.square(one - other).mean(axis=0).astype(np.float64)
        size = first.shape[2], first.shape[1]
        return np.asarray(cv2.resize(difference, size, interpolation=cv2.INTER_LINEAR))

    return measure


def _gradient(luma: Array) -> Array:
    ramp, flat = np.array([[1.0, 0.0, -1.0]]) / 3, np.ones((3, 1))
    across = cv2.filter2D(luma, -1, flat @ ramp, borderType=cv2.BORDER_REFLECT_101)
    down = cv2.filter2D(luma, -1, (flat @ ramp).T, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(np.hypot(across, down))
