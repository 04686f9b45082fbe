"""A plate as designed and as etched, by the PSF that the array sees of either."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.contracts import FloatArray
from camkit.models_def.kinds.spad.sampling import Sampling, make_sampling
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.effective import effective_psf
from camkit.models_def.optics.dots.match import match_dots
from camkit.models_def.optics.dots.target import FloatGrid, likeness, to_target
from camkit.models_def.optics.dots.unit import DotPlate

LEVELS: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Etched:
    """A plate as it was made.

    Attributes:
        depth_error: Share by which every mask etches too deep.
        height_um: (cells, cells) of one unit.
        seen: (11, 11) light in the active areas, shares of the light let in.
    """

    depth_error: float
    height_um: FloatGrid
    seen: FloatGrid

    @property
    def kernel(self) -> FloatArray:
        """Return its PSF, of unit sum."""
        return np.asarray(self.seen / self.seen.sum(), np.float32)

    @property
    def sampling(self) -> Sampling:
        """Return how an array samples behind it."""
        return make_sampling("learned", kernel=self.kernel)

    def like(self, wanted: FloatArray) -> dict[str, float]:
        """Return how its PSF is like another, as plain values."""
        return likeness(self.seen, wanted.astype(np.float64)).to_json()


def matched_plate(psf: FloatArray, camera: DotCamera) -> DotPlate:
    """Return the plate of 8 levels for a PSF (11, 11), as `camkit plate match` makes it."""
    return match_dots(to_target(psf), camera, LEVELS, np.random.default_rng(0)).plate


def etched(plate: DotPlate, depth_error: float) -> Etched:
    """Etch a plate by masks that all go too deep by a share; 0 makes it as designed."""
    made_um = plate.etched_um((depth_error,) * plate.masks.shape[0])
    seen = effective_psf(made_um, plate.camera)
    return Etched(depth_error=depth_error, height_um=made_um, seen=seen)
