"""The log of one capture: what is found while it is worked on, and the seconds of it."""

from dataclasses import dataclass, field
from typing import Any

from camkit.runtime.clock import StageClock
from camkit.runtime.job.meter import Meter
from camkit.runtime.network.windows import NetworkWindows


@dataclass(slots=True, kw_only=True, eq=False)
class Log:
    """The notes, clocks and records of one capture; nothing that is computed depends on them.

    Attributes:
        meter: How far the capture is.
        clock: Seconds per stage.
        notes: What the user should know, in the order it was found.
        record: The plan as the sidecar keeps it.
        sections: What stages found, as the sidecar keeps it: each under a name of its own.
        windows: Role -> the windows of its network, once they are planned.
        clipped_fraction: Share of clipped samples in the rows read so far; None where samples have
            no white level.
        is_ready: Whether all stages are made ready.
    """

    meter: Meter
    clock: StageClock = field(default_factory=StageClock)
    notes: list[str] = field(default_factory=list)
    record: dict[str, Any] = field(default_factory=dict)
    sections: dict[str, Any] = field(default_factory=dict)
    windows: dict[str, NetworkWindows] = field(default_factory=dict)
    clipped_fraction: float | None = None
    is_ready: bool = False
