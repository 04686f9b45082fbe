"""A verdict from paired samples: does a supervised network overfit to where it was trained?

Both networks of a pair are the same but for their losses, and are judged on the same samples. Its
lead is the mean over samples of (supervised - other). Samples of one frame share its light and its
noise, so the error of a lead is that of whole frames (clusters); it is sure where it exceeds `SURE`
errors. What it loses is its lead at home less its lead abroad, with the errors of both added in
squares.

    holds    it leads at home, surely, and trails abroad, surely
    partly   it loses surely, and leads at home surely, but does not surely trail abroad
    fails    it surely leads abroad and does not surely lose; or its lead surely grows abroad
    behind   it surely trails at home already: whatever it loses, nothing was gained by it
    untold   all else: the samples are too few to tell

One number of a network says nothing of a loss: other seeds may give another verdict.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

SURE: Final = 2.0
HIGHER_IS_BETTER: Final = {"psnr_db": 1.0, "ssim": 1.0, "perceptual": -1.0}
SUPERVISED: Final = ("log_mse", "mse", "l1")

Entry = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Lead:
    """The distance by which one network is ahead of another.

    Attributes:
        mean: Over samples.
        error: Standard error of the mean; infinite for one frame.
    """

    mean: float
    error: float

    @property
    def sure(self) -> int:
        """Return 1 where it is ahead, -1 where it is behind, 0 where nobody can tell."""
        return int(np.sign(self.mean)) if abs(self.mean) > SURE * self.error else 0

    def less(self, other: "Lead") -> "Lead":
        """Return what is left when another lead is taken away."""
        return Lead(mean=self.mean - other.mean, error=float(np.hypot(self.error, other.error)))


def lead_of(one: Sequence[float], other: Sequence[float], frames: Sequence[int]) -> Lead:
    """Return the lead of one over the other.

    Args:
        one: Value of every sample.
        other: Likewise.
        frames: Number of the frame that a sample is of.
    """
    gaps = np.subtract(one, other)
    _, member = np.unique(frames, return_inverse=True)
    sums = np.bincount(member, weights=gaps - gaps.mean())
    if sums.size < 2:
        return Lead(mean=float(gaps.mean()), error=float(np.inf))
    error = np.sqrt(np.square(sums).sum() * sums.size / (sums.size - 1)) / gaps.size
    return Lead(mean=float(gaps.mean()), error=float(error))


def verdict_of(home: Lead, abroad: Lead) -> str:
    """Return holds, partly, fails, behind or untold."""
    growth = home.less(abroad).sure
    if home.sure < 0 and abroad.sure <= 0:
        return "behind"
    if home.sure > 0 and abroad.sure < 0:
        return "holds"
    if home.sure > 0 and growth > 0:
        return "partly"
    if (abroad.sure > 0 and growth <= 0) or growth < 0:
        return "fails"
    return "untold"


def overfitting(rows: Mapping[str, Entry]) -> list[Entry]:
    """Compare every supervised row with every other of the same recipes and network.

    Args:
        rows: Name -> `trained`, `loss`, `network` (alike where only losses differ), and of `lab`
            and `wild` for every metric the values of all samples (`each`), and their `frames`.
    """
    pairs = []
    for name, row in rows.items():
        if row.get("loss") not in SUPERVISED:
            continue
        for rival, other in rows.items():
            if other.get("loss") in (None, *SUPERVISED) or other["network"] != row["network"]:
                continue
            pairs.append({"supervised": name, "other": rival, **_compared(row, other)})
    return pairs


def _compared(row: Entry, other: Entry) -> Entry:
    leads: Entry = {}
    for metric, sign in HIGHER_IS_BETTER.items():
        home, abroad = (
            lead_of(
                np.multiply(sign, row[where]["each"][metric]).tolist(),
                np.multiply(sign, other[where]["each"][metric]).tolist(),
                row[where]["frames"],
            )
            for where in ("lab", "wild")
        )
        leads[metric] = {
            "lab": [home.mean, home.error],
            "wild": [abroad.mean, abroad.error],
            "verdict": verdict_of(home, abroad),
        }
    return leads


def sentences(pairs: Sequence[Entry]) -> list[str]:
    """Return it in words, a line for each pair and metric."""
    lines = []
    for pair in pairs:
        for metric in HIGHER_IS_BETTER:
            one = pair[metric]
            (home, home_error), (abroad, abroad_error) = one["lab"], one["wild"]
            lines.append(
                f"{pair['supervised']} against {pair['other']}, {metric}: ahead by {home:.3f} +- "
                f"{home_error:.3f} at home, {abroad:.3f} +- {abroad_error:.3f} abroad: "
                f'"supervised overfits": {one["verdict"]}'
            )
    return lines or ["no supervised row beside another loss of the same network: no verdict"]
