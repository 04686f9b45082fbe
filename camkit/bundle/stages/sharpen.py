"""Times of photons to depth."""

from collections.abc import Sequence
from typing import ClassVar, Literal

from camkit.bundle.entry import NonNegative, Positive, Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import SpadSensor
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, need_count, need_domain


class Sharpen(StageEntry):
    """The time of flight of every pixel by the pulse that its gate sees (format 2.3).

    What is stated here serves captures that state no times of their own.

    Attributes:
        orientation: gate: bins are delays of a gate. histogram: they hold times of arrival.
        first_ps: Centre of bin 0; of a gate its first delay.
        gate_width_ps: Width of the gate; None for no gate.
        gate_rc_ps: Time constant of its edges.
        jitter_ps: Standard deviation of the time of one photon.
        laser_fwhm_ps: Full width of the pulse at half its height.
        laser_wavelength_nm: Of its light.
    """

    runtime: ClassVar[str] = "camkit.runtime.kinds.spad.stages.sharpen"
    type: Literal["sharpen"] = "sharpen"
    takes: tuple[Word, ...] = ("fine",)
    gives: tuple[Word, ...] = ("depth",)
    orientation: Literal["gate", "histogram"] = "gate"
    first_ps: float = 0.0
    gate_width_ps: Positive | None = None
    gate_rc_ps: Positive | None = None
    jitter_ps: NonNegative = 0.0
    laser_fwhm_ps: NonNegative = 0.0
    laser_wavelength_nm: Positive | None = None

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the depth."""
        need_count(planes, 1)
        need_domain(planes[0], "counts")
        if not isinstance(parts.sensor, SpadSensor) or planes[0].axes != "t y x":
            raise JoinError("it takes photons by time (t y x); the sensor states no time_bins")
        return (planes[0].model_copy(update={"axes": "y x", "domain": "depth"}),)
