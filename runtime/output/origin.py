"""Facts of one capture or one camera body that travel beside the planes to every writer."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from camkit.picture_window import PictureWindow
from camkit.runtime.files.raw_tags import SensorPlace
from camkit.runtime.metadata import Metadata
from camkit.runtime.unit import Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """The origin of a product.

    Attributes:
        camera: Make and model as people read it; empty if not stated.
        metadata: What the photograph says of itself.
        orientation: EXIF orientation 1..8 of the capture.
        white_balance: Gains in the planes, one per channel of the sensor.
        color_matrix: (3, 3) XYZ (D65) to camera; None if not stated.
        bundle: Name of the bundle; None where it was only developed.
        bundle_sha256: Its hash.
        unit: The camera body; None if not known.
        window: Where the pixels of the capture lie in a larger picture; None if not stated.
        place: Place on the sensor of a picture that is not restored yet; None for all others.
    """

    camera: str = ""
    metadata: Metadata = field(default_factory=Metadata)
    orientation: int = 1
    white_balance: tuple[float, ...] = (1.0, 1.0, 1.0)
    color_matrix: NDArray[np.float64] | None = None
    bundle: str | None = None
    bundle_sha256: str | None = None
    unit: Unit | None = None
    window: PictureWindow | None = None
    place: SensorPlace | None = None

    def stripped(self) -> Self:
        """Return the same without what tells of photographer, camera, date and place.

        What a picture needs to be shown (orientation, gains, colour matrix) stays.
        """
        return replace(self, camera="", metadata=Metadata())
