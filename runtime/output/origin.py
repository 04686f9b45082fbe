"""What belongs to one capture or one camera body, and travels beside the planes to every writer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.unit import Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where a product comes from.

    Attributes:
        camera: Make and model as people read it; empty if not stated.
        iso: ISO speed; None if not stated.
        exposure_time_s: Exposure time; None if not stated.
        orientation: EXIF orientation 1..8 of the capture.
        white_balance: Gains in the planes, one per channel of the sensor.
        color_matrix: (3, 3) XYZ (D65) to camera; None if not stated.
        bundle: Name of the bundle; None where it was only developed.
        bundle_sha256: Its hash.
        unit: The camera body; None if not known.
    """

    camera: str = ""
    iso: float | None = None
    exposure_time_s: float | None = None
    orientation: int = 1
    white_balance: tuple[float, ...] = (1.0, 1.0, 1.0)
    color_matrix: NDArray[np.float64] | None = None
    bundle: str | None = None
    bundle_sha256: str | None = None
    unit: Unit | None = None
