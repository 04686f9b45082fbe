"""One capture on its way to its products: planned, then walked; rows are pulled, times kept.

    capture -> job (what is known) -> walk (the stages of the manifest) -> bands of a product

Nothing is computed before the first band is asked for; a `Reconstruction` serves one thread, once.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE
from camkit.errors import ContractError
from camkit.runtime.cancel import Cancel, cancellable
from camkit.runtime.clock import StageClock
from camkit.runtime.color import ColorStage
from camkit.runtime.geometry.enlarging import enlarged_bands
from camkit.runtime.job.job import Job
from camkit.runtime.job.kind_capture import KindCapture
from camkit.runtime.job.log import Log
from camkit.runtime.job.meter import Meter
from camkit.runtime.job.photograph import BINNING, content_of, know_photograph
from camkit.runtime.job.setup import Setup
from camkit.runtime.job.stream import Stream
from camkit.runtime.job.walker import Walk, probed
from camkit.runtime.network.tiling import Progress
from camkit.runtime.network.windows import NetworkWindows
from camkit.runtime.output.origin import Origin
from camkit.runtime.plan.decision import Labels
from camkit.runtime.plan.estimate import Estimate, estimate_seconds, stage_seconds
from camkit.runtime.plan.planner import Plan
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows, RowSource
from camkit.runtime.stage_finder import module_of

BEFORE_STAGES: Final = (BINNING, "noise", "envelope", "scene")
ENLARGING: Final = "enlarging"
"""Name of the clock behind the stages."""


class Reconstruction:
    """The work on one capture.

    Attributes:
        capture: What is reconstructed.
        job: What is known of it.
    """

    def __init__(
        self,
        setup: Setup,
        capture: KindCapture,
        *,
        know: Callable[[Job], Job] = know_photograph,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
        ready_planes: Mapping[str, Stream] | None = None,
        reserved_bytes: int = 0,
    ) -> None:
        """Plan everything that is known before the first row.

        Args:
            setup: What the captures of a pipeline share.
            capture: As its kind reads it.
            know: How its kind completes what is known of it, and plans.
            progress: Called with (work done, work in all).
            cancel: Asked ten times a second; true raises `Cancelled`.
            ready_planes: Planes of this capture that another reconstruction kept, by name.
            reserved_bytes: Of the memory cap, what the caller needs for what becomes of the bands.

        Raises:
            ContractError: If capture, bundle and options do not fit each other.
        """
        self.capture: Any = capture
        self._setup = setup
        self.job = know(
            Job(
                setup=setup,
                capture=capture,
                log=Log(meter=Meter(progress, cancel)),
                prober=probed,
                cancel=cancel,
                ready_planes=dict(ready_planes or {}),
                reserved_bytes=reserved_bytes,
            )
        )
        self.capture = self.job.capture
        self._walk = Walk(self.job)

    @property
    def plan(self) -> Plan | None:
        """Return what was decided; None where nothing is."""
        return self.job.plan

    @property
    def products(self) -> dict[str, str]:
        """Return the products that can be had of this capture: name -> plane."""
        products, bundle = self._setup.products, self._setup.bundle
        if bundle is None:
            return products
        planes = bundle.manifest.all_planes
        return {name: p for name, p in products.items() if self.capture.gives(planes[p])}

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (c, h, w) of the image."""
        return self.shape_of(IMAGE)

    def shape_of(self, product: str) -> tuple[int, int, int]:
        """Return (c, h, w) of a product.

        Raises:
            ContractError: If there is none of the name.
        """
        plane = self._plane_of(product)
        bundle = self._setup.bundle
        listed_plane = None if bundle is None else bundle.manifest.all_planes[plane]
        if (
            listed_plane is None or "t" in listed_plane.axes
        ):  # its samples of time are the capture's
            shape = self._walk.stream(plane).shape
        else:
            shape = len(listed_plane.channels), *self.job.grid_px(listed_plane)
        return shape if self.job.enlarged_px is None else (shape[0], *self.job.enlarged_px)

    def _plane_of(self, product: str) -> str:
        if product not in self.products:
            raise ContractError(
                f"there is no product {product!r}; there are {', '.join(self.products)}"
            )
        return self.products[product]

    @property
    def record(self) -> dict[str, Any]:
        """Return what was decided, for the sidecar."""
        return self.job.log.record

    @property
    def sections(self) -> dict[str, Any]:
        """Return what stages found, for the sidecar: name of a section -> what it holds.

        Complete once all rows are out.
        """
        return self.job.log.sections

    @property
    def white_balance(self) -> tuple[float, ...]:
        """Return the gains in use."""
        return self.job.white_balance

    @property
    def color(self) -> ColorStage:
        """Return the way from camera colour to the colour asked for.

        Raises:
            ContractError: If no stage gives a picture in colour.
        """
        if self.job.color is None:
            raise ContractError("no stage of this camera gives a picture in colour")
        return self.job.color

    @property
    def origin(self) -> Origin:
        """Return what every writer should know of where the products come from."""
        capture, bundle = self.capture, self._setup.bundle
        return Origin(
            camera=capture.camera,
            metadata=capture.metadata.completed(
                iso=capture.iso, exposure_time_s=capture.exposure_time_s
            ),
            orientation=capture.orientation,
            white_balance=self.white_balance,
            color_matrix=capture.color_matrix,
            bundle=None if bundle is None else bundle.manifest.name,
            bundle_sha256=None if bundle is None else bundle.sha256,
            unit=self._setup.options.unit,
            window=capture.window,
        )

    @property
    def size(self) -> str | None:
        """Return the size of network in use; None if none runs."""
        sizes = self.job.work.sizes() if self.windows else ()
        return sizes[0] if sizes else None

    @property
    def labels(self) -> Labels | None:
        """Return the tier of every lattice cell; None where all get the network."""
        return self.job.work.labels

    @property
    def windows(self) -> dict[str, NetworkWindows]:
        """Return role -> the planned windows of its network; empty if none runs."""
        return self.job.log.windows

    def measured_speed(self, sizes: Sequence[str]) -> Speed:
        """Return how fast this machine is with the networks of some sizes."""
        return self._setup.speed(sizes)

    @property
    def seconds(self) -> dict[str, float]:
        """Return the seconds per stage so far, in the order of the data."""
        clock_seconds = self.clock.seconds
        order = (*BEFORE_STAGES, *self._walk.keys, ENLARGING)
        return {name: clock_seconds[name] for name in sorted(clock_seconds, key=order.index)}

    @property
    def clock(self) -> StageClock:
        """Return the clock of the stages, for profiles."""
        return self.job.log.clock

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what the user should know; complete once the last band is out."""
        return (*self.job.log.notes, *self._walk.warnings())

    @property
    def clipped_fraction(self) -> float | None:
        """Return the share of clipped samples seen so far; None where none can be clipped."""
        return self.job.log.clipped_fraction

    def bands(self, product: str = IMAGE) -> Iterator[Rows]:
        """Yield finished bands (c, rows, w) of a product, from top to bottom.

        Raises:
            ContractError: If there is no such product.
        """
        return self.metered(self.stream_of(product).bands())

    def stream_of(self, product: str) -> Stream:
        """Return the rows of a product, with what is known besides.

        Raises:
            ContractError: If there is no such product.
        """
        stream, size_px = self._walk.stream(self._plane_of(product)), self.job.enlarged_px
        binning = self.capture.binning if size_px is not None else None
        if size_px is None or binning is None:
            return stream
        bands = enlarged_bands(stream.rows(), binning.side_px, size_px)
        larger = replace(stream.with_bands(bands), shape=(stream.shape[0], *size_px))
        return larger.timed(self.clock, ENLARGING)

    def metered(self, bands: Iterator[Rows]) -> Iterator[Rows]:
        """Yield bands of a product; what makes them hears of the caller's wish to stop."""
        while True:
            with cancellable(self.job.cancel):
                band = next(bands, None)
            if band is None:
                break
            yield band
            del band  # not held while the next one is made
        self.job.log.meter.finish()

    def rows_of(self, plane: str) -> RowSource:
        """Return the rows of any plane of the manifest, for export, reports and tests."""
        return self._walk.stream(plane).rows()

    def keep(self, plane: str) -> Stream:
        """Read a plane of the manifest whole and make it known.

        What gives it does not run again, neither here nor in another reconstruction of the same
        capture that is told of it (`known_planes` of `Pipeline.start`).
        """
        return self._walk.keep(plane)

    def network_input(self, role: str) -> FloatArray:
        """Return what the network of a role is given for the whole capture, (c, h, w).

        Raises:
            ContractError: If no stage has the role.
        """
        for number, stage in enumerate(self._setup.stages):
            if getattr(stage, "role", None) == role:
                streams = [s for s in self._walk.taken_by(number) if s.plane.domain != "mask"]
                rows = module_of(stage).given_rows(stage, self.job, streams)
                samples: FloatArray = rows.read(0, rows.shape[1])
                return samples
        raise ContractError(f"no stage has a network of the role {role!r}")

    def fill(self, out: FloatArray | None = None, product: str = IMAGE) -> FloatArray:
        """Collect all bands of a product in one (c, h, w) array.

        Raises:
            ContractError: If `out` has another shape or type, cannot be written, or shares memory
                with the capture.
        """
        shape = self.shape_of(product)
        if out is None:
            out = np.empty(shape, dtype=np.float32)
        check_out(out)
        if out.shape != shape:
            raise ContractError(f"out must be float32 {shape}; got {out.dtype} {out.shape}")
        if self.capture.shares_memory(out):
            raise ContractError("out shares memory with the capture, which is read while it fills")
        top = 0
        for band in self.bands(product):
            out[:, top : top + band.shape[1]] = band
            top += band.shape[1]
        return out

    def explain(self) -> Estimate | None:
        """Complete the plan by the savings of every decision, and return the cost of the work.

        Times the machine for a moment when first asked. None without a bundle.
        """
        plan = self.plan
        if plan is None:
            return None
        if plan.subject.content is None:
            content = content_of(self.job.with_noise())
            plan = replace(plan, subject=replace(plan.subject, content=content))
        speed = self._setup.speed(plan.sizes())
        self.record["decisions"] = [decision.to_json() for decision in plan.decisions(speed)]
        window_mp = {role: windows.window_mp() for role, windows in self.windows.items()}
        expected = stage_seconds(plan.subject, plan.work, speed, window_mp or None)
        for stage, expected_s in zip(self.record["stages"].values(), expected, strict=True):
            stage["expected_s"] = round(expected_s, 4)
        estimate = Estimate(
            seconds=estimate_seconds(plan.subject, plan.work, speed, window_mp or None),
            peak_mb=self._walk.needed_bytes() / 1e6,
        )
        self.record["estimate"] = estimate.to_json()
        return estimate

    def planned(self) -> dict[str, Any]:
        """Return what would be done, for people and programs, as plain JSON values."""
        self.explain()
        details = dict(self.record)
        return {
            "size": self.size,
            "decisions": details.pop("decisions", []),
            "estimate": details.pop("estimate", None),
            "plan": details,
            "warnings": list(self.warnings),
        }


def check_out(out: FloatArray | None) -> None:
    """Refuse an array that cannot be filled, as far as that is known before any capture.

    Raises:
        ContractError: If it is no writable float32 array of three axes.
    """
    if out is None:
        return
    if not isinstance(out, np.ndarray) or out.ndim != 3 or out.dtype != np.float32:
        got = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
        raise ContractError(f"out must be float32 (c, h, w); got {got}")
    if not out.flags.writeable:
        raise ContractError("out is read-only: give an array that can be written, or None")
