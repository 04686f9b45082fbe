"""Means over scenes and seeds, and the scenes that end below their input."""

import statistics
from collections.abc import Iterable, Mapping
from typing import Any, Final

from tools.hdr.table.measuring import ALIGNED, COLUMNS, OF_BARE, Entry, Measured
from tools.hdr.table.rows import LDR, Row
from tools.hdr.table.scenes import EASY, GROUPS, LDR_LIMIT_DB, SATURATED

TIE_DB: Final = 0.5
GOOD_DB: Final = 65.0
MAIN: Final = "hdr_psnr_db"
GAIN: Final = "gain_db"
OVER_BARE: Final = "unclipped_over_bare_db"

Record = dict[str, Any]


def record_of(rows: Iterable[Row], found: Measured, trained: Mapping[str, Any]) -> Record:
    """Return everything that was measured as plain values.

    Args:
        rows: Those asked for.
        found: What was measured of them.
        trained: Run -> how its training ended.
    """
    there = [row for row in rows if row.key not in found.rows_left_out]
    return {
        "saturated": SATURATED,
        "ldr_limit_db": LDR_LIMIT_DB,
        "groups": {name: found.groups[name] for name in GROUPS if name in found.groups},
        "rows": {row.key: _row(row, found, trained) for row in there},
        "rows_left_out": dict(found.rows_left_out),
        "scenes_left_out": dict(found.scenes_left_out),
    }


def _row(row: Row, found: Measured, trained: Mapping[str, Any]) -> Record:
    names = [run.name for run in row.runs]
    return {
        "label": row.label,
        "trained": {name: trained[name] for name in names if name in trained},
        "groups": {
            name: _means([[found.entries[run, s] for s in scenes] for run in names], found)
            for name, scenes in found.groups.items()
        },
        "below_input": below_input(names, found),
        "scenes": {
            scene: [found.entries[run, scene].scores[MAIN] for run in names]
            for scenes in found.groups.values()
            for scene in scenes
        },
    }


def below_input(runs: Iterable[str], found: Measured) -> list[str]:
    """Return scenes of LDR > 45 dB that end below the lesser of LDR - 0.5 and 65 dB, any seed."""
    easy = [scene for group in EASY for scene in found.groups.get(group, ())]
    wanted = {scene: min(found.ldr_db(scene) - TIE_DB, GOOD_DB) for scene in easy}
    return [
        scene
        for scene in easy
        if min(found.entries[run, scene].scores[MAIN] for run in runs) < wanted[scene]
    ]


def _means(by_seed: list[list[Entry]], found: Measured) -> Record:
    """Return mean and spread of every column: over scenes, then over seeds."""
    made: Record = {}
    for name in (*COLUMNS, *ALIGNED):
        known = [[e.scores[name] for e in seed if name in e.scores] for seed in by_seed]
        if all(known):
            made[name] = _summary(known)
    gains = [[e.scores[MAIN] - found.ldr_db(e.scene) for e in seed] for seed in by_seed]
    made[GAIN] = _summary(gains)
    pairs = [[e.scores for e in seed if OF_BARE in e.scores] for seed in by_seed]
    over = [[s["unclipped_psnr_db"] - s[OF_BARE] for s in scores] for scores in pairs]
    if all(over):
        made[OVER_BARE] = _summary(over)
    made["cpu_s"] = _summary([[e.cpu_s for e in seed] for seed in by_seed])
    return made


def _summary(by_seed: list[list[float]]) -> Record:
    """Return the mean, its spread over seeds and that over scenes (n - 1); None for one alone."""
    means = [statistics.fmean(values) for values in by_seed]
    of_scenes = [statistics.fmean(values) for values in zip(*by_seed, strict=True)]
    return {
        "mean": statistics.fmean(means),
        "std_of_seeds": statistics.stdev(means) if len(means) > 1 else None,
        "std_of_scenes": statistics.stdev(of_scenes) if len(of_scenes) > 1 else None,
    }


def is_input(key: str) -> bool:
    """Return whether a row is the bare lens itself."""
    return key == LDR.key
