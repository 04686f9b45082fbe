"""High dynamic range: how bright the clipped lights come back, and what became of the rest.

The numbers are those of `camkit.report.hdr_score`, without the border that every metric leaves out;
JOD is measured where `cvvdp` is installed.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.report.bench.metric import Column, Metric
from camkit.report.hdr_score import (
    ALIGNED,
    NITS_PER_UNIT,
    Mask,
    Reference,
    aligned,
    guess_scores,
    hdr_scores,
)
from camkit.report.jod import DISPLAY, jod, obstacle
from camkit.report.quality import BORDER_PX

COMPARED: Final = {
    "hdr_psnr_db": "hdr_psnr_std_db",
    "stops_rmse": "stops_rmse_std",
    "unclipped_psnr_db": "unclipped_psnr_std_db",
}
"""Columns with their spread."""
ALONE: Final = (
    *("mu_psnr_db", "pu21_psnr_db", "pu21_ssim", "ev0_psnr_db", "ev4_psnr_db", "ev8_psnr_db"),
    "jod",
)


def measure(
    result: FloatArray,
    _truth: FloatArray,
    *,
    linear: FloatArray,
    clipped: Mask | None = None,
    input: FloatArray | None = None,  # noqa: A002  # the name by which captures bring it
    nits_per_unit: float = NITS_PER_UNIT,
) -> dict[str, float]:
    """Compare a picture with the linear truth.

    Args:
        result: (3, h, w) float32 linear Rec.709.
        linear: The truth, likewise; at most 2^8.
        clipped: (3, h, w), samples that are clipped in the capture.
        input: (3, h, w) float32 linear, the picture of the bare lens clipped at white.
        nits_per_unit: Luminance of white in cd/m^2.

    Raises:
        ContractError: If the result is not finite.
    """
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    reference = Reference(truth=linear, clipped=clipped, bare=input, nits_per_unit=nits_per_unit)
    inner = reference.cropped(inside)
    scores = hdr_scores(result[inside], inner) | guess_scores(inner)
    scores |= _jods(result[inside], inner)
    return scores | {"nits_per_unit": nits_per_unit}


def _jods(result: FloatArray, reference: Reference) -> dict[str, float]:
    if obstacle() is not None:
        return {}
    truth, nits = reference.truth, reference.nits_per_unit
    pictures = {"jod": result, f"jod{ALIGNED}": aligned(result, truth)}
    return {name: jod(picture, truth, nits) for name, picture in pictures.items()}


def _notes() -> Mapping[str, str]:
    reason = obstacle()
    return {"jod_display": DISPLAY if reason is None else f"not measured: {reason}"}


def _columns(end: str) -> tuple[Column, ...]:
    measured = (
        Column(
            name=f"{name}{end}",
            spread=COMPARED.get(name) if not end else None,
            of_input=f"input_{name}{end}",
        )
        for name in (*COMPARED, *ALONE)
    )
    return (*measured, Column(name=f"stops_rmse_guess{end}"))


METRIC = Metric(
    name="hdr",
    columns=(*_columns(""), *_columns(ALIGNED), Column(name="nits_per_unit")),
    measure=measure,
    needs=("linear",),
    takes=("clipped", "input", "nits_per_unit"),
    notes=_notes,
    each_picture=True,
)
