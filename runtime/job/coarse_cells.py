"""A capture in coarse cells, for stages that look at all of it before their first row."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages import Demosaic
from camkit.cfa import CfaPattern
from camkit.runtime.bank.cell_means import cell_means
from camkit.runtime.job.job import Job


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """A capture in cells.

    Attributes:
        means: (c, rows, columns) float32.
        clipped: The same shape; where a sample clipped.
        cfa: Of the mosaic whose samples were summed; None for planes.
    """

    means: FloatArray
    clipped: NDArray[np.bool_]
    cfa: CfaPattern | None


def cells_of(job: Job, takes: Sequence[str], cell_px: int) -> Cells:
    """Read once what lies before a stage.

    Args:
        job: The capture.
        takes: The planes that the stage takes: its picture, and a mask or none. Of a picture made
            of a mosaic the mosaic is read.
        cell_px: Side of a cell, even.
    """
    light, *mask = job.probe(_summed(job, takes[0]), *takes[1:])
    cfa = job.capture.cfa if light.shape[0] == 1 else None
    means, clipped = cell_means(light, mask[0] if mask else None, cfa, cell_px)
    return Cells(means=means, clipped=clipped, cfa=cfa)


def _summed(job: Job, picture: str) -> str:
    """Return the plane whose samples are summed: the mosaic, if nothing else was made of it."""
    giver = next((stage for stage in job.setup.stages if picture in stage.gives), None)
    mosaic = isinstance(giver, Demosaic) and job.capture.cfa is not None
    return giver.takes[0] if giver is not None and mosaic else picture
