"""Lights that the sensor clipped, read back from the streaks that the optics wrote of them."""

from collections.abc import Sequence
from typing import ClassVar, Final, Literal

from camkit.bundle.entry import Since, Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages.entry import (
    JoinError,
    Parts,
    StageEntry,
    need_count,
    need_domain,
    one_linear,
)

_FROM_SAMPLES: Final = Since((2, 8), "streaks are taken from the samples of the mosaic")


class Highlights(StageEntry):
    """Clipped lights found from their streaks, streaks and veil taken away (format 2.2).

    Where it takes the mosaic beside its colours (format 2.8), streaks are taken from the samples,
    as far as they are known, and these are made colours anew; rims have colours of their own.

    Attributes:
        method: Of that demosaic.
    """

    runtime: ClassVar[str] = "camkit.runtime.kinds.hdr.stages.highlights"
    type: Literal["highlights"] = "highlights"
    takes: tuple[Word, ...] = ("rgb",)
    gives: tuple[Word, ...] = ("lit",)
    method: Literal["fast", "quality"] = "quality"

    @property
    def from_samples(self) -> bool:
        """Return whether streaks are taken from the samples of the mosaic."""
        return len(self.takes) > 1

    def needs(self) -> list[Since]:
        """Return what of this stage readers of older formats do not know."""
        return super().needs() + ([_FROM_SAMPLES] if self.from_samples else [])

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the plane as taken; its lights may lie far above white."""
        need_count(planes, 1, 2)
        plane = one_linear(planes[:1])
        if len(planes) > 1:
            need_domain(planes[1], "linear")
            if planes[1].channels != MOSAIC or planes[1].grid != plane.grid:
                raise JoinError("beside its colours it takes their mosaic")
        if plane.channels != RGB:
            raise JoinError("it takes red, green and blue")
        if not plane.grid.warped or plane.grid.pitch_ratio != 1:
            raise JoinError("it works on the pixels of the sensor, before any undistortion")
        optics = parts.need_optics("it reads lights from the streaks of optics")
        if optics.type != "streaks":
            raise JoinError(f"it needs optics that write streaks, not {optics.type}")
        return (plane,)
