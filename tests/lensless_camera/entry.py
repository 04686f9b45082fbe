"""The stage as manifests list it."""

from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from camkit.bundle.entry import NonNegative, Positive, Word
from camkit.bundle.plane import Plane
from camkit.bundle.stages import JoinError, PackageStage, Parts
from camkit.bundle.stages.entry import need_colours, need_rows, one_linear


class LenslessAdmm(PackageStage):
    """The scene whose blur, cropped by the sensor, is the capture; nowhere below zero.

    What its penalties mean stands in `tests.lensless_camera.solver.Settings`.

    Attributes:
        iterations: Rounds.
        crop_penalty: Of the blurred scene against what the crop holds.
        positive_penalty: Of the scene against its part above zero.
        gradient_penalty: Of the differences of the scene against those that `tv` shrank.
        tv: Weight of the total variation; 0 for none.
        white: Light of the scene that is white in the picture: a lamp in a dark room is brighter
            than its mean over the frame, of which the sensor takes its white.
    """

    runtime: ClassVar = "tests.lensless_camera.stage"
    type: Literal["lensless_admm"] = "lensless_admm"
    package: Literal["lensless-camera"] = "lensless-camera"
    takes: tuple[Word, ...] = ("light",)
    gives: tuple[Word, ...] = ("scene",)
    iterations: Annotated[int, Field(ge=1, le=1000)] = 100
    crop_penalty: Positive = 1.0
    positive_penalty: Positive = 10.0
    gradient_penalty: Positive = 3.0
    tv: NonNegative = 0.0
    white: Positive = 1.0

    def join(self, taken: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the plane as taken: light of the scene, where the sensor is."""
        plane = one_linear(taken)
        need_rows(plane)
        need_colours(plane, parts)
        optics = parts.need_optics("it undoes the blur of a mask")
        if optics.type != "frozen_psf" or optics.symmetry != "uniform":
            raise JoinError("it takes one kernel for the whole frame: symmetry uniform")
        if not plane.grid.warped or plane.grid.pitch_ratio != 1:
            raise JoinError("it works on the pixels of the sensor")
        return (plane,)
