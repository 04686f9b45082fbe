"""The facts of one capture, made once and never changed; what is found on the way is its log.

    capture, bundle, options -> place on the sensor, noise, gains, colour, plan -> stages

A stage that looks at the capture before the plan is made returns a job that knows more (`look` of
its module, see `camkit.runtime.stage_finder`); from the plan on nothing changes.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.plane import Plane
from camkit.bundle.reader import Bundle
from camkit.caller import option_text
from camkit.colorimetry import Matrix
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.cancel import Cancel
from camkit.runtime.color import ColorStage
from camkit.runtime.geometry.placement import Placement
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.job.log import Log
from camkit.runtime.job.meter import Meter
from camkit.runtime.job.setup import Setup
from camkit.runtime.job.stream import Stream
from camkit.runtime.options import Options
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.planner import Plan
from camkit.runtime.rows import RowSource
from camkit.runtime.signal.noise import measure_noise, over_rounding

Gains = tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Job:
    """The facts of one capture.

    Attributes:
        setup: What it shares with others.
        capture: The capture, as its kind reads it.
        log: What is found on the way.
        prober: Makes rows of planes by another walk; see `probe`.
        cancel: The caller's wish to stop.
        ready_planes: Planes of this capture that were made before; what gives them does not run.
        cache: What stages found of the capture and need not seek again in another walk over it, by
            a key of theirs.
        reserved_bytes: Of the memory cap, what somebody else needs for what becomes of the bands.
        probe_end: Number of a stage; planes that it and those behind it give cannot be probed. None
            for all planes.
        sensor_place: Where the capture lies on the sensor; None for captures that have no place.
        measured_noise: Noise of the raw signal; None where no stage needs it.
        white_balance: Gains in use; ones where the stages balance nothing.
        color: From the colour of the stages to that asked for; None where no stage makes one.
        enlarged_px: (height, width) that the picture gets back at the end; None where it keeps that
            of the capture.
        falls_back: The capture lies outside what the bundle was shown to help with, and the caller
            wants no network then.
        work: What is to be done.
        plan: Why; None for captures of which nothing is planned.
    """

    setup: Setup
    capture: Any
    log: Log
    prober: "Callable[[Job, Sequence[str]], tuple[RowSource, ...]]"
    cancel: Cancel | None = None
    ready_planes: dict[str, Stream] = field(default_factory=dict)
    cache: dict[Hashable, Any] = field(default_factory=dict)
    reserved_bytes: int = 0
    probe_end: int | None = None
    sensor_place: Placement | None = None
    measured_noise: NoiseModel | None = None
    white_balance: Gains = ()
    color: ColorStage | None = None
    enlarged_px: tuple[int, int] | None = None
    falls_back: bool = False
    work: Work = field(default_factory=Work)
    plan: Plan | None = None

    @property
    def bundle(self) -> Bundle | None:
        """Return the camera."""
        return self.setup.bundle

    @property
    def known_bundle(self) -> Bundle:
        """Return the camera, which a stage that needs one always has."""
        return self.setup.known_bundle

    @property
    def options(self) -> Options:
        """Return what the caller chose."""
        return self.setup.options

    @property
    def threads(self) -> int:
        """Return the threads to compute with."""
        return self.setup.threads

    @property
    def color_matrix(self) -> Matrix | None:
        """Return XYZ (D65) to camera, of the file before that of the bundle; None if not known."""
        sensor = None if self.bundle is None else self.bundle.manifest.sensor
        if self.capture.color_matrix is not None or not self.capture.is_of_mosaic:
            file_matrix: Matrix | None = self.capture.color_matrix
            return file_matrix
        if sensor is None or sensor.type != "bayer":
            return None
        return np.array(sensor.color_matrix)

    @property
    def subject(self) -> Subject | None:
        """Return what was planned for."""
        return None if self.plan is None else self.plan.subject

    @property
    def placement(self) -> Placement:
        """Return where the capture lies on the bundle's sensor.

        Raises:
            ContractError: If captures of its kind have no place.
        """
        if self.sensor_place is None:
            raise ContractError("captures of this kind have no place on a sensor")
        return self.sensor_place

    @property
    def noise(self) -> NoiseModel:
        """Return the noise of the raw signal, which a stage that needs it has looked for.

        Raises:
            ContractError: If none has.
        """
        if self.measured_noise is None:
            raise ContractError("no stage has looked for the noise of this capture")
        return self.measured_noise

    def with_noise(self) -> "Job":
        """Return the job with the noise: stated, the file's, the bundle's at its ISO, measured."""
        if self.measured_noise is not None:
            return self
        manifest = self.known_bundle.manifest
        if self.options.noise is not None:
            shot, read_variance = ((value,) * self.capture.channels for value in self.options.noise)
            source, noise = "stated", NoiseModel(shot=shot, read_variance=read_variance)
        elif self.capture.noise is not None:
            source, noise = "file", self.capture.noise
        elif self.capture.iso is not None:
            source, noise = "bundle", manifest.light_sensor.noise_at(self.capture.iso)
            if self.capture.binning is not None:
                noise = noise.raised(self.capture.binning.noise_factors)
        else:
            with self.log.clock.stage("noise"):
                source, noise = "measured", measure_noise(self.capture)
            self.log.notes += _doubts(noise, self.capture.rounding)
        self.log.record["noise"] = {
            "source": source,
            "shot": noise.shot,
            "read_variance": noise.read_variance,
        }
        return replace(self, measured_noise=noise)

    def window_of(self, plane: Plane) -> SensorWindow:
        """Return where the samples of a plane lie on the sensor, in pixels of its own grid."""
        window, ratio = self.placement.window, plane.grid.pitch_ratio
        if ratio == 1:
            return window
        height, width = self.grid_px(plane)
        return window.resampled(ratio, (width, height))

    def grid_px(self, plane: Plane) -> tuple[int, int]:
        """Return (height, width) of a plane of this capture.

        Of cells there is one more than would do, since they begin with red (`stages.pack`).
        """
        ratio = plane.grid.pitch_ratio
        if ratio > 1:
            return int(self.capture.height // ratio) + 1, int(self.capture.width // ratio) + 1
        return round(self.capture.height / ratio), round(self.capture.width / ratio)

    def probe(self, *planes: str) -> tuple[RowSource, ...]:
        """Return rows of planes that are made for the asking stage alone, before its first row.

        They equal those that it will be given. To be called when the first row is asked for.
        Several planes are made by one walk: read the same rows of each before the next ones, from
        top to bottom.

        Raises:
            ContractError: If it is called earlier, or a plane does not lie before that stage.
        """
        if not self.log.is_ready:
            names = ", ".join(map(repr, planes))
            raise ContractError(
                f"the plane {names} is asked for too early: stages look at planes when their "
                "first row is asked for, not while they are made ready"
            )
        return self.prober(self, planes)

    def with_new_log(self, probe_end: int | None = None) -> "Job":
        """Return the same job for a walk whose counts and notes nobody hears."""
        return replace(self, log=Log(meter=Meter(None, self.cancel)), probe_end=probe_end)


def _doubts(noise: NoiseModel, rounding: FloatArray | None) -> list[str]:
    """Return a note where noise that was measured lies below that of rounding to codes."""
    if rounding is None:
        return []
    share = over_rounding(noise, rounding)
    if share >= 1:
        return []
    return [
        f"the noise measured is {share:.2f} of what rounding to 8 bits alone leaves: blur and "
        f"rounding hide the camera's; state it by {option_text('noise')} or {option_text('iso')}"
    ]
