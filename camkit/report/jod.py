"""JOD: how far from the truth a picture looks, by `cvvdp` on a stated display.

It stands where the dissertation has HDR-VDP 2, which has no port to Python: a visual difference
predictor for high dynamic range by the same group, whose scale ends at 10 for no visible
difference. The package is optional (`pip install camkit[hdrvdp]`).

References: Mantiuk et al., "ColorVideoVDP: A visual difference predictor for image, video and
display distortions", ACM TOG 43(4), 2024.
"""

import importlib
from functools import cache
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import UnsupportedError
from camkit.report.pu21 import LEAST_NITS, MOST_NITS

RESOLUTION_PX: Final = (512, 512)
DIAGONAL_INCH: Final = 24.0
DISTANCE_M: Final = 1.0
DISPLAY: Final = (
    f"linear Rec.709 shown at its luminance from {LEAST_NITS:g} to {MOST_NITS:g} cd/m^2 in a dark "
    f"room; {DIAGONAL_INCH:g} inch, {RESOLUTION_PX[0]}x{RESOLUTION_PX[1]} px, "
    f"{DISTANCE_M:g} m away (20.7 px per degree)"
)
"""The dissertation's viewing conditions (sec. 5.5); a larger picture has pixels of that size."""


def jod(result: FloatArray, truth: FloatArray, nits_per_unit: float) -> float:
    """Return the quality of a picture in just-objectionable differences; 10 is perfect.

    Args:
        result: (3, h, w) linear Rec.709.
        truth: Likewise.
        nits_per_unit: Luminance of white (1.0) in cd/m^2.

    Raises:
        UnsupportedError: If `cvvdp` is not installed, or does not load here.
    """
    import torch

    metric = _metric()
    displayed = [torch.from_numpy(np.ascontiguousarray(p * nits_per_unit)) for p in (result, truth)]
    with torch.no_grad():
        quality, _ = metric.predict(*(p.to(torch.float32) for p in displayed), dim_order="CHW")
    return float(quality)


@cache
def obstacle() -> str | None:
    """Return why there is no JOD here; None if there is."""
    try:
        _package()
    except UnsupportedError as error:
        return str(error)
    return None


def _package() -> Any:
    try:
        return importlib.import_module("pycvvdp")
    except ModuleNotFoundError as error:
        if error.name not in ("pycvvdp", "torch"):
            raise UnsupportedError(f"cvvdp lacks {error.name}; install it again") from error
        raise UnsupportedError(
            "cvvdp is not installed; pip install 'camkit[hdrvdp]' brings it"
        ) from error
    except (ImportError, RuntimeError, OSError) as error:
        # its torchvision loads only beside the very build of torch that it was made for
        raise UnsupportedError(
            f"cvvdp does not load ({' '.join(str(error).split())}); torch and torchvision must "
            "come from the same index"
        ) from error


@cache
def _metric() -> Any:
    package = _package()
    import torch

    display = package.vvdp_display_photo_eotf(
        MOST_NITS,
        contrast=MOST_NITS / LEAST_NITS,
        source_colorspace="BT.709-linear",
        E_ambient=0,
    )
    geometry = package.vvdp_display_geometry(
        RESOLUTION_PX, distance_m=DISTANCE_M, diagonal_size_inches=DIAGONAL_INCH
    )
    return package.cvvdp(
        display_photometry=display,
        display_geometry=geometry,
        device=torch.device("cpu"),
        quiet=True,
    )
