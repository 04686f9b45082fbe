"""One capture on its way through a bundle: what is known of it before any row, found when asked.

    capture, bundle, options -> place on the sensor, noise, notes for people, record for programs

Stages read it and add to it; each fact is found once, whoever asks first.
"""

from collections.abc import Callable, Hashable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from camkit.bundle.plane import Plane
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor
from camkit.caller import option_text
from camkit.colorimetry import Matrix
from camkit.contracts import CfaPattern, NoiseModel, shifted_cfa
from camkit.errors import ContractError
from camkit.runtime.cancel import Cancel
from camkit.runtime.capture import COLOURS, Capture
from camkit.runtime.clock import StageClock
from camkit.runtime.color import ColorStage
from camkit.runtime.files.doubts import notes_behind
from camkit.runtime.geometry.placement import Placement, place
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.job.meter import Meter
from camkit.runtime.job.setup import Setup
from camkit.runtime.job.stream import Stream
from camkit.runtime.network.tiling import Progress
from camkit.runtime.network.windows import NetworkWindows
from camkit.runtime.options import Options
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.rows import RowSource
from camkit.runtime.signal.noise import measure_noise

Gains = tuple[float, ...]


class Job:
    """The facts of one capture.

    Attributes:
        setup: What it shares with others.
        capture: The capture.
        clock: Seconds per stage.
        cancel: The caller's wish to stop.
        meter: How far it is.
        notes: What the user should know, in the order it was found.
        record: The plan as the sidecar keeps it.
        sections: What stages found, as the sidecar keeps it: each under a name of its own.
        white_balance: Gains in use; ones where the stages balance nothing.
        color: From the colour of the stages to that asked for; None until a stage says so.
        falls_back: The capture lies outside what the bundle was shown to help with, and the caller
            wants no network then.
        work: What was planned; set before any stage runs.
        subject: What was planned for; None before, and without a bundle.
        windows: Role -> the windows of its network, once they are planned.
        prober: What `probe` asks; set by the walker.
        known: Planes of this capture that were made before; what gives them does not run.
        kept: What stages found of the capture and need not seek again in another walk over it, by
            a key of theirs; shared with `unheard` ones.
        reserved_bytes: Of the memory cap, what somebody else needs for what becomes of the bands.
        clipped_fraction: Share of clipped samples in the rows read so far.
    """

    def __init__(
        self,
        setup: Setup,
        capture: Capture,
        *,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
        known: Mapping[str, Stream] | None = None,
        reserved_bytes: int = 0,
    ) -> None:
        self.setup = setup
        self.capture = capture
        self.cancel = cancel
        self.meter = Meter(progress, cancel)
        self.clock = StageClock()
        self.notes = list(capture.notes)
        if setup.bundle is not None and setup.bundle.manifest.has_haze:
            self.notes = notes_behind(capture, setup.bundle.haze)
        self.record: dict[str, Any] = {}
        self.sections: dict[str, Any] = {}
        self.white_balance: Gains = (1.0,) * capture.channels
        self.color: ColorStage | None = None
        self.falls_back = False
        self.work = Work()
        self.subject: Subject | None = None
        self.windows: dict[str, NetworkWindows] = {}
        self.prober: Callable[[Job, tuple[str, ...]], tuple[RowSource, ...]] | None = None
        self.known = dict(known or {})
        self.kept: dict[Hashable, Any] = {}
        self.reserved_bytes = reserved_bytes
        self.clipped_fraction = 0.0
        self._check_input()

    @property
    def bundle(self) -> Bundle | None:
        """Return the camera."""
        return self.setup.bundle

    @property
    def known_bundle(self) -> Bundle:
        """Return the camera, which a stage that needs one always has."""
        return self.setup.known_bundle

    @property
    def color_matrix(self) -> Matrix | None:
        """Return XYZ (D65) to camera, of the file before that of the bundle; None if not known."""
        sensor = None if self.bundle is None else self.bundle.manifest.sensor
        if self.capture.color_matrix is not None or self.capture.cfa is None:
            return self.capture.color_matrix
        if sensor is None or sensor.type != "bayer":
            return None
        return np.array(sensor.color_matrix)

    @property
    def options(self) -> Options:
        """Return what the caller chose."""
        return self.setup.options

    @property
    def threads(self) -> int:
        """Return the threads to compute with."""
        return self.setup.threads

    def probe(self, *planes: str) -> tuple[RowSource, ...]:
        """Return rows of planes that are made for the asking stage alone, before its first row.

        They equal those that it will be given. To be called when the first row is asked for.
        Several planes are made by one walk: read the same rows of each before the next ones, from
        top to bottom.

        Raises:
            ContractError: If it is called earlier, or a plane does not lie before that stage.
        """
        if self.prober is None:
            named = ", ".join(map(repr, planes))
            raise ContractError(
                f"the plane {named} is asked for too early: stages look at planes when their "
                "first row is asked for, not while they are made ready"
            )
        return self.prober(self, planes)

    def unheard(self) -> "Job":
        """Return the same job for a walk whose counts and notes nobody hears."""
        other = Job(self.setup, self.capture, cancel=self.cancel, known=self.known)
        other.record, other.kept = dict(self.record), self.kept
        other.work, other.subject, other.falls_back = self.work, self.subject, self.falls_back
        for name in ("placement", "noise"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    def _check_input(self) -> None:
        """Refuse a capture that the sensor does not give."""
        bundle = self.bundle
        if bundle is None:
            if self.capture.channels != COLOURS:
                raise ContractError(
                    f"without a bundle only captures of {COLOURS} colours are developed; this one "
                    f"has {self.capture.channels} channel(s)"
                )
            return
        self._check_camera(bundle.manifest.name)
        wanted = bundle.manifest.sensor.inputs
        if self.capture.contract not in wanted:
            raise ContractError(
                f"bundle {bundle.manifest.name} takes {' or '.join(wanted)}, the capture is "
                f"{self.capture.contract}; use another bundle or {option_text('bundle', 'none')}"
            )
        if isinstance(bundle.manifest.sensor, BayerSensor):
            self._check_cfa(bundle.manifest.sensor.cfa)
        if self.capture.contract != wanted[0]:
            self.notes.append(
                "the capture has full colour instead of a mosaic: demosaicking is skipped"
            )

    def _check_camera(self, name: str) -> None:
        """Refuse a capture of another camera; warn where that can only be feared.

        A bundle without optics that takes pictures of any size is for every camera.
        """
        capture, options = self.capture, self.options
        manifest = self.known_bundle.manifest
        if manifest.optics is None and manifest.sensor.extent is None:
            return
        if capture.bundle_name not in (None, name):
            told = f"the capture names bundle {capture.bundle_name}, not {name}"
            if not options.force_bundle:
                raise ContractError(
                    f"{told}; leave {option_text('bundle')} out, or add "
                    f"{option_text('force_bundle')}"
                )
            self.notes.append(f"{told}: the result is right only if both have the same lens")
        is_file = capture.sha256 is not None
        if capture.bundle_name is None and manifest.has_kernels and (capture.camera or is_file):
            camera = capture.camera
            source = f"is from the camera {camera}" if camera else "names no camera"
            self.notes.append(
                f"the capture {source}: the result is right only with the lens of bundle {name}"
            )

    def _check_cfa(self, cfa: CfaPattern) -> None:
        """Refuse a mosaic that does not begin as the sensor does at the place of the capture."""
        found, origin = self.capture.cfa, self.capture.origin_px
        if found is None or origin is None or self.options.assume is not None:
            return
        expected = shifted_cfa(cfa, origin)
        if found != expected:
            raise ContractError(
                f"the mosaic begins with {found}, the sensor (CFA {cfa}) has {expected} at "
                f"{origin}: the place of the crop ({option_text('origin_px')}) or the "
                "pattern is wrong"
            )

    @cached_property
    def placement(self) -> Placement:
        """Return where the capture lies on the bundle's sensor.

        Raises:
            ContractError: If it does not fit and nothing was assumed.
        """
        extent = None if self.bundle is None else self.bundle.manifest.sensor.extent
        placement = place(self.capture, extent, self.options.assume)
        if placement.note:
            self.notes.append(placement.note)
        return placement

    def window_of(self, plane: Plane) -> SensorWindow:
        """Return where the samples of a plane lie on the sensor, in pixels of its own grid."""
        window, ratio = self.placement.window, plane.grid.pitch_ratio
        if ratio == 1:
            return window
        height, width = self.grid_px(plane)
        return window.resampled(ratio, (width, height))

    def grid_px(self, plane: Plane) -> tuple[int, int]:
        """Return (height, width) of a plane of this capture."""
        ratio = plane.grid.pitch_ratio
        return round(self.capture.height / ratio), round(self.capture.width / ratio)

    @cached_property
    def noise(self) -> NoiseModel:
        """Return the noise of the raw signal: the file's, the bundle's at its ISO, or measured."""
        sensor = self.known_bundle.manifest.sensor
        if self.capture.noise is not None:
            source, noise = "file", self.capture.noise
        elif self.capture.iso is not None and sensor.type != "spad":
            source, noise = "bundle", sensor.noise_at(self.capture.iso)
        else:
            with self.clock.stage("noise"):
                source, noise = "measured", measure_noise(self.capture)
        self.record["noise"] = {
            "source": source,
            "shot": noise.shot,
            "read_variance": noise.read_variance,
        }
        return noise
