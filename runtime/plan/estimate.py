"""Seconds and peak memory of a piece of work, before it is done: the sum of what the stages say."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from camkit.bundle.stages import Network
from camkit.runtime.plan.counted import STRIP_RATIO, counted_window_mp
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.plan.tiers import TierWork
from camkit.runtime.plan.ways import LEFT_OUT, ways_of
from camkit.runtime.stage_finder import module_of

NETWORK_REST: Final = 0.8
"""Of a network outside its windows, in everything but bank and network (measured: 0.11 CPU-seconds
per megapixel, docs/results/plan.md)."""
FILE_SHARE: Final = 0.15
"""Share of reading and writing files in everything but bank and network."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The predicted seconds and memory of a piece of work.

    Attributes:
        seconds: From reading the file to its picture.
        peak_mb: Peak memory of the process.
    """

    seconds: float
    peak_mb: float

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {"seconds": round(self.seconds, 4), "peak_mb": round(self.peak_mb, 1)}

    def compare(self, seconds: float, peak_mb: float) -> dict[str, Any]:
        """Return the estimate with what really was and the ratio real / estimated."""
        return {
            **self.to_json(),
            "real_seconds": round(seconds, 4),
            "real_peak_mb": round(peak_mb, 1),
            "seconds_ratio": round(seconds / max(self.seconds, 1e-9), 3),
            "peak_ratio": round(peak_mb / max(self.peak_mb, 1e-9), 3),
        }


def estimate_seconds(
    subject: Subject,
    work: Work,
    speed: Speed,
    window_mp: Mapping[str, Mapping[str, float]] | None = None,
) -> float:
    """Return the seconds of a piece of work; see `stage_seconds`."""
    files = FILE_SHARE * speed.rest_s_per_mp * subject.megapixels
    return files + sum(stage_seconds(subject, work, speed, window_mp))


def stage_seconds(
    subject: Subject,
    work: Work,
    speed: Speed,
    window_mp: Mapping[str, Mapping[str, float]] | None = None,
) -> tuple[float, ...]:
    """Return the seconds of every stage of a piece of work, 0 for what is left out.

    Args:
        subject: The capture.
        work: What will be done.
        speed: How fast the machine is.
        window_mp: Role -> size -> megapixels that its windows compute, once they are planned.
    """
    stages = subject.bundle.manifest.stages
    seconds: list[float] = []
    for stage, way in zip(stages, ways_of(stages, work), strict=True):
        windows = None
        if isinstance(stage, Network) and window_mp is not None:
            windows = window_mp.get(stage.role)
        if way == LEFT_OUT:
            seconds.append(0.0)
        elif isinstance(stage, Network) and windows is not None:
            seconds.append(network_seconds(stage.role, windows, speed, subject.megapixels))
        else:
            estimate = getattr(module_of(stage), "seconds", None)
            seconds.append(0.0 if estimate is None else estimate(stage, subject, work, speed))
    return tuple(seconds)


def network_seconds(
    role: str, window_mp: Mapping[str, float], speed: Speed, megapixels: float
) -> float:
    """Return the seconds of the windows of a role, and of what is done around them everywhere.

    Args:
        role: Of the network.
        window_mp: Size -> megapixels that its windows compute.
        speed: How fast the machine is.
        megapixels: Of the picture.
    """
    windows_s = sum(speed.network_s_per_mp[role, size] * mp for size, mp in window_mp.items())
    return NETWORK_REST * speed.rest_s_per_mp * megapixels + windows_s


def role_window_mp(role: str, subject: Subject, work: Work) -> dict[str, float]:
    """Return size -> megapixels computed by the network of a role, on the grid of what it takes."""
    if subject.role is not None:
        return counted_window_mp(subject, work)
    manifest = subject.bundle.manifest
    stage = next(s for s in manifest.stages_of(Network) if s.role == role)
    plane = manifest.planes.get(stage.takes[0])
    finer = 1.0 if plane is None else plane.grid.pitch_ratio**-2
    return {work.size: subject.megapixels * STRIP_RATIO * finer}


def tier_work_of(subject: Subject, work: Work) -> TierWork:
    """Return the costs of the tiers of a piece of work, from the bundle's facts."""
    full = subject.facts(work.size)
    small = None if work.small is None else subject.facts(work.small)
    return TierWork(
        full_mac=full.mac_per_pixel,
        full_halo_px=subject.reach_px(work.size),
        small_mac=None if small is None else small.mac_per_pixel,
        small_halo_px=0 if work.small is None else subject.reach_px(work.small),
    )
