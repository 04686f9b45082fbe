"""What was measured as plain values: means with their spread over seeds, and gains.

spread of a mean   standard deviation over seeds of training (n - 1); null for one
spread of a gain   root of the sum of both rows' variances over seeds; beside it the standard
                   error over pictures, whose gain is taken one by one
"""

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from tools.spad.table.judged import Judged
from tools.spad.table.measuring import LEVELS, Entry, Measured

GAINS: Final = {
    "learned.M over low_fill.M": ("learned.M", "low_fill.M"),
    "learned.M over gaussian.M": ("learned.M", "gaussian.M"),
    "learned.M over full_fill.M": ("learned.M", "full_fill.M"),
    "learned.M over full_fill.M=equal": ("learned.M", "full_fill.M=equal"),
    "learned.M over learned.dbpn": ("learned.M", "learned.dbpn"),
    "learned.M over learned.linear": ("learned.M", "learned.linear"),
}
_OURS: Final = {
    "set5": [30.76, 0.9399],
    "set14": [26.91, 0.8557],
    "bsd100_half_a": [26.23, 0.8198],
}
THESIS: Final[Mapping[str, Mapping[str, Sequence[float]]]] = {
    "low_fill.bicubic": {
        "set5": [24.26, 0.8336],
        "set14": [21.51, 0.7589],
        "bsd100_half_a": [20.83, 0.7175],
    },
    "learned.srcnn": {
        "set5": [25.27, 0.8620],
        "set14": [22.34, 0.7812],
        "bsd100_half_a": [21.58, 0.7397],
    },
    "learned.vdsr": {
        "set5": [25.45, 0.8717],
        "set14": [22.57, 0.7915],
        "bsd100_half_a": [21.74, 0.7481],
    },
    "low_fill.M": {
        "set5": [27.17, 0.9019],
        "set14": [23.97, 0.8066],
        "bsd100_half_a": [23.82, 0.7691],
    },
    "full_fill.M": {
        "set5": [29.77, 0.9317],
        "set14": [26.13, 0.8442],
        "bsd100_half_a": [25.59, 0.8069],
    },
    "gaussian.M": {
        "set5": [30.41, 0.9360],
        "set14": [26.68, 0.8498],
        "bsd100_half_a": [26.05, 0.8157],
    },
    "gaussian_untrained.M": {
        "set5": [20.46, 0.8087],
        "set14": [19.64, 0.7268],
        "bsd100_half_a": [20.07, 0.7016],
    },
    "learned.M": _OURS,
    "learned.dbpn": _OURS,
}
"""PSNR in dB and SSIM as printed, of all of BSD100; its SRCNN and VDSR stand behind nothing, and
its networks of other samplings are D-DBPN."""
NOISE_FREE: Final = "noise-free"

Record = dict[str, Any]


def record_of(rows: Iterable[Judged], found: Measured, trained: Mapping[str, Any]) -> Record:
    """Return everything that was measured.

    Args:
        rows: Those asked for.
        found: What was measured of them.
        trained: Training -> how it ended.
    """
    there = {row.key: row for row in rows if row.key not in found.rows_left_out}
    return {
        "pictures": dict(found.pictures),
        "photons": [level_name(level) for level in LEVELS],
        "rows": {key: _row(row, found, trained) for key, row in there.items()},
        "gains": {
            name: _gain(there[one], there[other], found)
            for name, (one, other) in GAINS.items()
            if one in there and other in there
        },
        "seeds_left_out": {
            key: missing
            for key, row in there.items()
            if (missing := [seed for seed in row.seeds if seed not in found.seeds[key]])
        },
        "rows_left_out": dict(found.rows_left_out),
        "sets_left_out": dict(found.sets_left_out),
    }


def level_name(photons: float | None) -> str:
    """Name a level of light."""
    if photons is None or math.isinf(photons):
        return NOISE_FREE
    return f"{photons:g}"


def _row(row: Judged, found: Measured, trained: Mapping[str, Any]) -> Record:
    runs = [] if row.trained is None else [row.trained.run(seed) for seed in row.seeds]
    return {
        "label": row.label,
        "sampling": row.sampling,
        "method": row.method,
        "light": "equal counts" if row.equal_counts else "its own",
        "mac_per_px": found.mac_per_px.get(row.key),
        "trained": {run: trained[run] for run in runs if run in trained},
        "thesis": THESIS.get(row.key),
        "scores": {
            level_name(level): {
                name: _scores([found.entries[key] for key in _keys(row, name, level, found)])
                for name in found.pictures
            }
            for level in LEVELS
        },
    }


def _keys(
    row: Judged, set_name: str, level: float, found: Measured
) -> list[tuple[str, str, float | None]]:
    photons = None if math.isinf(level) else level
    return [(row.run(seed), set_name, photons) for seed in found.seeds[row.key]]


def _scores(entries: Sequence[Entry]) -> Record:
    return {
        "psnr_db": _summary([statistics.fmean(entry.psnr_db) for entry in entries]),
        "ssim": _summary([statistics.fmean(entry.ssim) for entry in entries]),
        "cpu_s": statistics.fmean(entry.cpu_s for entry in entries),
    }


def _summary(of_seeds: Sequence[float]) -> Record:
    return {
        "mean": statistics.fmean(of_seeds),
        "spread": statistics.stdev(of_seeds) if len(of_seeds) > 1 else None,
        "seeds": list(of_seeds),
    }


def _gain(one: Judged, other: Judged, found: Measured) -> Record:
    return {
        level_name(level): {
            name: _gain_on(
                [found.entries[key] for key in _keys(one, name, level, found)],
                [found.entries[key] for key in _keys(other, name, level, found)],
            )
            for name in found.pictures
        }
        for level in LEVELS
    }


def _gain_on(one: Sequence[Entry], other: Sequence[Entry]) -> Record:
    of_seeds = [[statistics.fmean(entry.psnr_db) for entry in row] for row in (one, other)]
    pictures = [a - b for a, b in zip(_of_pictures(one), _of_pictures(other), strict=True)]
    variances = [statistics.variance(row) for row in of_seeds if len(row) > 1]
    return {
        "db": statistics.fmean(pictures),
        "spread": math.sqrt(sum(variances)) if variances else None,
        "se_of_pictures": (
            statistics.stdev(pictures) / math.sqrt(len(pictures)) if len(pictures) > 1 else None
        ),
    }


def _of_pictures(entries: Sequence[Entry]) -> list[float]:
    """Return the PSNR of every picture, mean over seeds."""
    return [statistics.fmean(of) for of in zip(*(e.psnr_db for e in entries), strict=True)]
