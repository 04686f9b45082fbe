"""Tuning of the classical peers: the parameter with the best mean PSNR per ISO."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.report.peers import PEERS
from camkit.report.quality import Exposed, finish_planes, judge

Tuned = dict[str, dict[float, float]]
"""Peer -> ISO -> parameter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One peer with one parameter value on one capture."""

    peer: str
    iso: float
    value: float
    psnr_db: float


def try_peers(exposed: Exposed, bundle: Bundle, peers: Sequence[str]) -> list[Trial]:
    """Try every candidate of the peers on a capture."""
    found = []
    for name in peers:
        for candidate in PEERS[name].candidates:
            planes = PEERS[name].restore(exposed.local, candidate)
            score = judge(finish_planes(planes, exposed, bundle), exposed.sharp)
            found.append(
                Trial(peer=name, iso=exposed.simulation.iso, value=candidate, psnr_db=score.psnr_db)
            )
    return found


def choose(trials: Iterable[Trial]) -> tuple[Tuned, dict[str, dict[str, dict[str, float]]]]:
    """Give the best values, and the mean PSNR of every value: peer -> ISO -> value -> dB."""
    values: dict[tuple[str, float], dict[float, list[float]]] = {}
    for t in trials:
        values.setdefault((t.peer, t.iso), {}).setdefault(t.value, []).append(t.psnr_db)
    tuned: Tuned = {}
    curves: dict[str, dict[str, dict[str, float]]] = {}
    for (peer, iso), by_value in sorted(values.items()):
        means = {value: float(np.mean(db)) for value, db in sorted(by_value.items())}
        tuned.setdefault(peer, {})[iso] = max(means, key=lambda value: means[value])
        curves.setdefault(peer, {})[f"{iso:g}"] = {f"{v:g}": round(m, 3) for v, m in means.items()}
    return tuned, curves


def tuned_to_json(tuned: Tuned) -> dict[str, dict[str, float]]:
    """Give plain JSON values."""
    return {
        peer: {f"{iso:g}": value for iso, value in by_iso.items()} for peer, by_iso in tuned.items()
    }


def tuned_from_json(table: Mapping[str, Mapping[str, Any]]) -> Tuned:
    """Read what `tuned_to_json` gave."""
    return {
        peer: {float(iso): float(value) for iso, value in by_iso.items()}
        for peer, by_iso in table.items()
    }
