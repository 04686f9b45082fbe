"""Tuning of the classical peers: the setting with the best mean PSNR per ISO."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.quality import inner_srgb, psnr
from tools.comparison.peers import PEERS, Setting
from tools.comparison.photograph import Photograph, finish_planes

Tuned = dict[str, dict[float, Setting]]
"""Peer -> ISO -> its parameters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One peer with one setting on one capture."""

    peer: str
    iso: float
    setting: Setting
    psnr_db: float


def try_peers(capture: Photograph, bundle: Bundle, peers: Sequence[str]) -> list[Trial]:
    """Try every setting of the peers on a capture."""
    trials = []
    for name in peers:
        for setting in PEERS[name].settings:
            planes = PEERS[name].restore(capture.local, setting)
            restored = finish_planes(planes, capture, bundle)
            # without SSIM, which takes nine tenths of the time of judging
            psnr_db = psnr(*inner_srgb(restored, capture.sharp))
            trials.append(
                Trial(peer=name, iso=capture.simulation.iso, setting=setting, psnr_db=psnr_db)
            )
    return trials


def choose(trials: Iterable[Trial]) -> tuple[Tuned, dict[str, dict[str, dict[str, float]]]]:
    """Return the best settings, and the mean PSNR of all: peer -> ISO -> setting as text -> dB."""
    groups: dict[tuple[str, float], dict[Setting, list[float]]] = {}
    for t in trials:
        groups.setdefault((t.peer, t.iso), {}).setdefault(t.setting, []).append(t.psnr_db)
    tuned: Tuned = {}
    curves: dict[str, dict[str, dict[str, float]]] = {}
    for (peer, iso), by_setting in sorted(groups.items()):
        means = {setting: float(np.mean(db)) for setting, db in sorted(by_setting.items())}
        tuned.setdefault(peer, {})[iso] = max(means, key=lambda setting: means[setting])
        curves.setdefault(peer, {})[f"{iso:g}"] = {
            PEERS[peer].describe(setting): round(mean, 3) for setting, mean in means.items()
        }
    return tuned, curves


def at_edge(peer: str, setting: Setting) -> list[str]:
    """Return the parameters whose chosen value is the first or last candidate."""
    parameters = zip(PEERS[peer].parameters, PEERS[peer].candidates, setting, strict=True)
    return [
        name for name, candidates, value in parameters if value in (candidates[0], candidates[-1])
    ]


def tuned_to_json(tuned: Tuned) -> dict[str, dict[str, dict[str, float]]]:
    """Return plain JSON values: peer -> ISO -> parameter -> value."""
    return {
        peer: {
            f"{iso:g}": dict(zip(PEERS[peer].parameters, setting, strict=True))
            for iso, setting in by_iso.items()
        }
        for peer, by_iso in tuned.items()
    }


def tuned_from_json(table: Mapping[str, Mapping[str, Any]]) -> Tuned:
    """Read what `tuned_to_json` gave.

    Raises:
        ContractError: If a peer or a parameter is not known or missing.
    """
    tuned: Tuned = {}
    for peer, by_iso in table.items():
        names = PEERS[peer].parameters if peer in PEERS else ()
        for iso, values in by_iso.items():
            if not names or not isinstance(values, Mapping) or set(values) != set(names):
                expected = ", ".join(names) or f"those of {', '.join(PEERS)}"
                raise ContractError(
                    f"tuned parameters of {peer} must be {expected}; got {values}; tune again"
                )
            tuned.setdefault(peer, {})[float(iso)] = tuple(float(values[n]) for n in names)
    return tuned
