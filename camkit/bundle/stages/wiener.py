"""The Wiener bank."""

from collections.abc import Sequence
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from camkit.bundle.entry import NonNegative, Positive, Since, Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import RGB
from camkit.bundle.stages.entry import (
    PORTABLE,
    JoinError,
    Parts,
    StageEntry,
    need_colours,
    need_count,
    need_domain,
    need_masks,
    need_rows,
)
from camkit.bundle.stages.together import Mosaic, Together

_PITCH_RTOL: Final = 1e-6


class Wiener(StageEntry):
    """The Wiener bank: overlapping windowed blocks, each with its own PSF.

    Attributes:
        block_px: Side of a block.
        overlap_px: Overlap of neighbouring blocks, less than half a block or equal to it.
        prior_scale: Scale of the power spectrum assumed for a sharp scene.
        prior_exponent: Its fall with frequency: scale * f^-exponent.
        clip_iterations: Rounds of re-estimating clipped pixels; 0 for none.
        clip_reach_px: Farther than this from clipped samples nothing is re-estimated (format 2.1);
            None for whole blocks, as before.
        clip_power: Each round's correction to this power: 2 goes about twice as far in a round,
            up to 3 it settles (format 2.4).
        clip_windows: Which windows re-estimate clipped pixels where few of a block clip: such as
            hold half of a kernel's side, or the whole of it (format 2.8; bundles of formats before
            2.4 have the latter, later ones the former).
        whole_blocks: Whether there are no such windows: a block with clipped pixels is re-estimated
            as a whole, as other readers do (format 2.12).
        together: How the colours are restored together (format 2.4); None for each alone.
        mosaic: Where the colours are restored from the samples of the mosaic, with the numbers of
            `together`, and not from demosaicked planes (format 2.10); None for nowhere.
        depth: Whose kernels are taken where nobody says how far the scene is: the mean over the
            depths of the PSF, or those of the distance that every part of the capture shows
            (format 2.8).
    """

    type: Literal["wiener"] = "wiener"
    takes: tuple[Word, ...] = ("rgb", "unknown")
    gives: tuple[Word, ...] = ("restored",)
    block_px: Annotated[int, Field(ge=16, le=8192)] = 512
    overlap_px: Annotated[int, Field(ge=0)] = 160
    prior_scale: Positive
    prior_exponent: NonNegative
    clip_iterations: Annotated[int, Field(ge=0, le=100)] = 0
    clip_reach_px: Annotated[int, Field(ge=2, le=1024)] | None = None
    clip_power: Annotated[float, Field(ge=1.0, lt=3.0)] = 1.0
    clip_windows: Literal["half_kernel", "whole_kernel"] = "half_kernel"
    whole_blocks: Annotated[bool, PORTABLE] = False
    together: Together | None = None
    mosaic: Annotated[
        Mosaic | None, Since((2, 10), "a bank works from the samples of the mosaic")
    ] = None
    depth: Annotated[
        Literal["mean", "estimated"], Since((2, 8), "a bank finds the distance of the scene")
    ] = "mean"

    @model_validator(mode="after")
    def _check(self) -> "Wiener":
        if 2 * self.overlap_px > self.block_px:
            raise ValueError(
                f"overlap_px may be half of block_px at most; got {self.overlap_px} of "
                f"{self.block_px}"
            )
        if self.mosaic is not None and self.together is None:
            raise ValueError("mosaic needs together, whose numbers it takes")
        return self

    def alone(self) -> Self:
        """Return the bank that restores every colour alone."""
        return self.model_copy(update={"together": None, "mosaic": None})

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the plane as taken: deconvolved."""
        need_count(planes, 1, 2)
        plane = planes[0]
        need_domain(plane, "linear")
        need_rows(plane)
        need_masks(planes[1:], plane, "deconvolves")
        optics = parts.need_optics("it deconvolves with the kernels of optics")
        if optics.type == "lens_profile":
            raise JoinError("it needs optics with kernels; a lens_profile has none")
        need_colours(plane, parts)
        if self.together is not None and len(self.together.noise) != len(plane.channels):
            raise JoinError(
                f"it restores {len(self.together.noise)} colours together and takes "
                f"{len(plane.channels)}"
            )
        if self.mosaic is not None and plane.channels != RGB:
            raise JoinError("it works from the samples of a mosaic, and takes no planes of R, G, B")
        if not plane.grid.warped:
            raise JoinError("it works in the geometry of the sensor, before any undistortion")
        if parts.sensor.extent is not None:
            pitch_um = parts.sensor.extent.pixel_pitch_um * plane.grid.pitch_ratio
            if abs(optics.pixel_pitch_um - pitch_um) > _PITCH_RTOL * pitch_um:
                raise JoinError(
                    f"its kernels are sampled at {optics.pixel_pitch_um:g} um, its planes at "
                    f"{pitch_um:g} um"
                )
        return (plane,)
