"""One capture on its way to its products: planned, then walked; rows are pulled, times kept.

    capture -> job (what is known) -> walk (the stages of the manifest) -> bands of a product

Nothing is computed before the first band is asked for; a `Reconstruction` serves one thread, once.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from camkit.bundle.golden import IMAGE
from camkit.bundle.stages import Network
from camkit.caller import option_text
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.cancel import Cancel, cancellable
from camkit.runtime.capture import Capture
from camkit.runtime.clock import StageClock
from camkit.runtime.color import ColorStage
from camkit.runtime.content import Content, light_squares, measure_content
from camkit.runtime.job.job import Job
from camkit.runtime.job.setup import DEVELOPMENT, Setup
from camkit.runtime.job.stream import Stream
from camkit.runtime.job.walker import Walk
from camkit.runtime.network.tiling import Progress
from camkit.runtime.network.windows import NetworkWindows
from camkit.runtime.output.origin import Origin
from camkit.runtime.plan.decision import DEVELOP, Labels, Subject, Work
from camkit.runtime.plan.estimate import Estimate, estimate_seconds, stage_seconds
from camkit.runtime.plan.planner import Plan, make_plan, needs_content
from camkit.runtime.plan.rules.lights import needs_lights
from camkit.runtime.plan.speed import Speed
from camkit.runtime.plan.ways import without_networks
from camkit.runtime.rows import Rows, RowSource
from camkit.runtime.stage_finder import stage_module

BEFORE_STAGES: Final = ("noise", "envelope", "scene")


class Reconstruction:
    """The work on one capture.

    Attributes:
        capture: What is reconstructed.
        job: What is known of it.
        plan: What was decided; None without a bundle.
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
        """Plan everything that is known before the first row.

        Raises:
            ContractError: If capture, bundle and options do not fit each other.
        """
        self.capture = capture
        self._setup = setup
        self.job = Job(
            setup,
            capture,
            progress=progress,
            cancel=cancel,
            known=known,
            reserved_bytes=reserved_bytes,
        )
        self._walk = Walk(self.job)
        self.plan = self._decide()
        self._walk.settle()

    @property
    def products(self) -> dict[str, str]:
        """Return the products that can be had: name -> plane."""
        bundle = self._setup.bundle
        if bundle is None:
            return {IMAGE: DEVELOPMENT[-1].gives[0]}
        return dict(bundle.manifest.products)

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
        if bundle is None:
            return 3, self.capture.height, self.capture.width
        stated = bundle.manifest.planes[plane]
        return len(stated.channels), *self.job.grid_px(stated)

    def _plane_of(self, product: str) -> str:
        if product not in self.products:
            raise ContractError(
                f"there is no product {product!r}; there are {', '.join(self.products)}"
            )
        return self.products[product]

    @property
    def record(self) -> dict[str, Any]:
        """Return what was decided, for the sidecar."""
        return self.job.record

    @property
    def sections(self) -> dict[str, Any]:
        """Return what stages found, for the sidecar: name of a section -> what it holds.

        Complete once all rows are out.
        """
        return self.job.sections

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
        sizes = self.job.work.sizes() if self.job.windows else ()
        return sizes[0] if sizes else None

    @property
    def labels(self) -> Labels | None:
        """Return the tier of every lattice cell; None where all get the network."""
        return self.job.work.labels

    @property
    def windows(self) -> dict[str, NetworkWindows]:
        """Return role -> the planned windows of its network; empty if none runs."""
        return self.job.windows

    def measured_speed(self, sizes: Sequence[str]) -> Speed:
        """Return how fast this machine is with the networks of some sizes."""
        return self._setup.speed(sizes)

    @property
    def seconds(self) -> dict[str, float]:
        """Return the seconds per stage so far, in the order of the data."""
        spent = self.clock.seconds
        order = (*BEFORE_STAGES, *self._walk.keys)
        return {name: spent[name] for name in sorted(spent, key=order.index)}

    @property
    def clock(self) -> StageClock:
        """Return the clock of the stages, for profiles."""
        return self.job.clock

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what the user should know; complete once the last band is out."""
        return (*self.job.notes, *self._walk.warnings())

    @property
    def clipped_fraction(self) -> float:
        """Return the share of clipped samples seen so far."""
        return self.job.clipped_fraction

    def bands(self, product: str = IMAGE) -> Iterator[Rows]:
        """Yield finished bands (c, rows, w) of a product, from top to bottom.

        Raises:
            ContractError: If there is no such product.
        """
        return self._metered(self._walk.stream(self._plane_of(product)).bands())

    def _metered(self, bands: Iterator[Rows]) -> Iterator[Rows]:
        while True:
            with cancellable(self.job.cancel):
                band = next(bands, None)
            if band is None:
                break
            yield band
            del band  # not held while the next one is made
        self.job.meter.finish()

    def rows_of(self, plane: str) -> RowSource:
        """Return the rows of any plane of the manifest, for export, reports and tests."""
        return self._walk.stream(plane).rows()

    def keep(self, plane: str) -> Stream:
        """Read a plane of the manifest whole and make it known.

        What gives it does not run again, neither here nor in another reconstruction of the same
        capture that is told of it (`known` of `Pipeline.start`).
        """
        return self._walk.keep(plane)

    def network_input(self, role: str) -> FloatArray:
        """Return what the network of a role is given for the whole capture, (c, h, w).

        Raises:
            ContractError: If no stage has the role.
        """
        for number, stage in enumerate(self._setup.stages):
            if isinstance(stage, Network) and stage.role == role:
                taken = [s for s in self._walk.taken_by(number) if s.plane.domain != "mask"]
                rows = stage_module(stage.type).given_rows(stage, self.job, taken)
                made: FloatArray = rows.read(0, rows.shape[1])
                return made
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
        if np.may_share_memory(out, self.capture.samples):
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
        made = self.plan
        if made is None:
            return None
        if made.subject.content is None:
            made = replace(made, subject=replace(made.subject, content=self._measure_content()))
        speed = self._setup.speed(made.sizes())
        self.record["decisions"] = [decision.to_json() for decision in made.decisions(speed)]
        window_mp = {role: windows.window_mp() for role, windows in self.windows.items()}
        taken = stage_seconds(made.subject, made.work, speed, window_mp or None)
        for stage, expected_s in zip(self.record["stages"].values(), taken, strict=True):
            stage["expected_s"] = round(expected_s, 4)
        estimate = Estimate(
            seconds=estimate_seconds(made.subject, made.work, speed, window_mp or None),
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

    def _decide(self) -> Plan | None:
        """Plan no more than the capture needs; without a bundle there is nothing to plan."""
        job, bundle = self.job, self._setup.bundle
        if bundle is None:
            job.work = Work(method=DEVELOP, networks=False)
            return None
        options = job.options
        if job.falls_back:
            below = without_networks(bundle.manifest, Work())
            if below is None:
                raise ContractError(
                    f"bundle {bundle.manifest.name} has nothing to fall back to: its networks "
                    f"cannot be left out; use {option_text('on_unsafe', 'warn')}"
                )
            options = replace(options, method=below.method)
        content = self._measure_content() if needs_content(options) else None
        lights = None
        if needs_lights(bundle):
            lights = light_squares(self.capture) if content is None else content.lights
        subject = Subject(
            bundle=bundle,
            options=options,
            height_px=self.capture.height,
            width_px=self.capture.width,
            placement=job.placement,
            content=content,
            lights=lights,
        )
        plan = make_plan(subject, lambda: self._setup.speed(bundle.manifest.sizes))
        if plan.note:
            job.notes.append(plan.note)
        job.subject, job.work = plan.subject, plan.work
        self.record["quality"] = options.quality
        self.record["decisions"] = [decision.to_json() for decision in plan.decisions()]
        return plan

    def _measure_content(self) -> Content:
        job = self.job
        noise = job.noise.with_gains(job.white_balance)
        with job.clock.stage("scene"):
            content = measure_content(self.capture, noise, job.white_balance, job.placement.window)
        self.record["scene"] = content.to_json()
        return content


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
