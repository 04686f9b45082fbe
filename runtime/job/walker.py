"""The stages of a manifest walked in order: made ready, given their share of memory, joined.

    ways -> every stage made ready -> memory -> streams -> the rows of a product

Nothing is computed before the first row is asked for.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.chain import CAPTURE
from camkit.bundle.plane import Plane
from camkit.bundle.stages import StageEntry
from camkit.caller import option_text
from camkit.errors import ContractError, MemoryCapError
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES
from camkit.runtime.plan.ways import LEFT_OUT, stand_ins, ways_of
from camkit.runtime.rows import ArrayRows, RowSource
from camkit.runtime.stage_finder import module_of, stage_keys

FIXED_BYTES: Final = 240_000_000
"""Interpreter and libraries, and what they keep (measured, see docs/guides/performance.md)."""
USUAL_BYTES: Final = 16_000_000
"""Of a bundle, and of the weights of a network: so much is part of that."""
CAP_STEP_BYTES: Final = 1_000_000
"""By which a cap rises at least until everything fits."""


class Walk:
    """The stages of one capture.

    Attributes:
        stages: As the manifest lists them.
        keys: Their names for people and clocks.
        ways: The way each takes.
    """

    def __init__(self, job: Job) -> None:
        """Make every stage ready, and share the memory among those that run.

        Args:
            job: The capture, planned.

        Raises:
            MemoryCapError: If the memory does not do; it names a cap that does.
            ContractError: If a stage is left out that no plane stands in for.
        """
        self._job = job
        self.stages = job.setup.stages
        self.keys = stage_keys(self.stages)
        self.ways = ways_of(self.stages, job.work)
        self._planes = _planes_of(job)
        self._instead = stand_ins(self.stages, self.ways, self._planes)
        self._works: list[StageWork] = [
            module_of(stage).prepare(stage, job) for stage in self.stages
        ]
        self._share_memory()
        job.log.is_ready = True

    def _share_memory(self) -> None:
        cap = self._job.options.max_mem_bytes or DEFAULT_MAX_MEM_BYTES
        try:
            self._fit(cap)
        except MemoryCapError as error:
            if (need := self._enough_bytes(error.need_bytes)) == error.need_bytes:
                raise
            raise MemoryCapError(_refusal(need, cap), need) from error

    def _enough_bytes(self, cap: int) -> int:
        """Return the next cap by which everything fits."""
        while True:
            try:
                self._fit(cap)
            except MemoryCapError as error:
                cap = max(error.need_bytes, cap + CAP_STEP_BYTES)
            else:
                return cap

    def _fit(self, cap: int) -> None:
        """Plan the stages that run within a cap.

        Raises:
            MemoryCapError: If it is too small for one of them.
        """
        running = [work for work, way in zip(self._works, self.ways, strict=True) if way]
        flexible = [work for work in running if work.fit is not None]
        planned, first = self._fixed_bytes(running), self._first_bytes(running)
        if first > cap or (planned > cap and not flexible):
            need = max(planned, first)
            raise MemoryCapError(_refusal(need, cap), need)
        for number, work in enumerate(flexible):
            assert work.fit is not None
            share = max(cap - planned, 1) // (len(flexible) - number)
            work.fit(cap, planned if len(flexible) == 1 else cap - share)
            planned += work.planned_bytes()

    def needed_bytes(self) -> int:
        """Return the memory of the whole walk."""
        running = [work for work, way in zip(self._works, self.ways, strict=True) if way]
        planned = self._fixed_bytes(running) + sum(work.planned_bytes() for work in running)
        return max(planned, self._first_bytes(running))

    def _first_bytes(self, running: list[StageWork]) -> int:
        """Return the memory at the time when stages look at the capture before any row.

        Whatever becomes of rows, a JPEG say, takes nothing yet.
        """
        more = max((work.first_bytes - work.held_bytes for work in running), default=0)
        return self._fixed_bytes(running) - self._job.reserved_bytes + max(more, 0)

    def _fixed_bytes(self, running: list[StageWork]) -> int:
        held_bytes = sum(work.held_bytes for work in running)
        job = self._job
        stored = 0 if job.bundle is None else max(job.bundle.stored_bytes - USUAL_BYTES, 0)
        resident: int = job.capture.resident_bytes
        return FIXED_BYTES + stored + resident + job.reserved_bytes + held_bytes

    def warnings(self) -> tuple[str, ...]:
        """Return what the stages have to say once the last row is out."""
        return tuple(text for work in self._works for text in work.warnings())

    def stream(self, name: str) -> Stream:
        """Return the rows of a plane; every call walks anew.

        Args:
            name: Name of the plane.

        Raises:
            ContractError: If no stage gives it.
        """
        (stream,) = self.streams(name)
        return stream

    def streams(self, *names: str) -> tuple[Stream, ...]:
        """Return the rows of several planes by one walk, to be read band by band in turns.

        Args:
            names: Names of planes, no two alike.

        Raises:
            ContractError: If no stage gives one of them.
        """
        for name in names:
            _giver_of(name, self.stages)
        job, lasts = self._job, [self._instead.get(name, name) for name in names]
        numbers = self._stages_behind(lasts)
        takers = Counter(
            [*lasts, *(name for number in numbers for name in self._inputs_of(number))]
        )
        sources = {CAPTURE: _capture_stream(job, self._planes[CAPTURE]), **job.ready_planes}
        ready = {name: stream.shared(takers[name]) for name, stream in sources.items()}
        job.log.meter.expect([name for number in numbers for name in self.stages[number].gives])
        for number in numbers:
            inputs = [ready[name].pop() for name in self._inputs_of(number)]
            outputs = self._works[number].run(inputs)
            for name, output in zip(self.stages[number].gives, outputs, strict=True):
                if name not in job.ready_planes:
                    counted = output.timed(job.log.clock, self.keys[number]).metered(
                        job.log.meter, name
                    )
                    ready[name] = counted.shared(takers[name])
        return tuple(ready[last].pop() for last in lasts)

    def keep(self, name: str) -> Stream:
        """Read a plane whole; from now on it is known, and what gives it does not run again."""
        stream = self.stream(name)
        rows = stream.rows()
        whole = ArrayRows(rows.read(0, rows.shape[1]))
        whole_stream = replace(stream, source=whole, band_iterator=None, owned=False)
        self._job.ready_planes[self._instead.get(name, name)] = whole_stream
        return whole_stream

    def taken_by(self, number: int) -> list[Stream]:
        """Return the streams that a stage takes; every call walks anew."""
        return [self.stream(name) for name in self.stages[number].takes]

    def _stages_behind(self, names: Sequence[str]) -> list[int]:
        """Return the stages, in order, that make some planes from those that are ready."""
        planes, numbers, ready = set(names), [], self._job.ready_planes.keys()
        for number in range(len(self.stages) - 1, -1, -1):
            outputs = planes.intersection(self.stages[number].gives) - ready
            if outputs and self.ways[number] != LEFT_OUT:
                planes.update(self._inputs_of(number))
                numbers.append(number)
        return numbers[::-1]

    def _inputs_of(self, number: int) -> tuple[str, ...]:
        """Return the names of the planes that a stage takes; stand-ins for what is left out."""
        return tuple(self._instead.get(name, name) for name in self.stages[number].takes)


def _refusal(need_bytes: int, cap_bytes: int) -> str:
    return (
        f"this takes about {need_bytes // 10**6} MB, the cap is {cap_bytes // 10**6} MB; "
        f"raise {option_text('max_mem_bytes', need_bytes)}"
    )


def _giver_of(plane: str, stages: Sequence[StageEntry]) -> int:
    """Return the number of the stage that gives a plane; -1 for the sensor.

    Raises:
        ContractError: If none does.
    """
    if plane == CAPTURE:
        return -1
    for number, stage in enumerate(stages):
        if plane in stage.gives:
            return number
    there = ", ".join([CAPTURE, *(name for stage in stages for name in stage.gives)])
    raise ContractError(f"no stage gives the plane {plane!r}; there are {there}")


def probed(job: Job, planes: Sequence[str]) -> tuple[RowSource, ...]:
    """Return what `Job.probe` gives.

    Raises:
        ContractError: If a plane is made by a stage that asks, or behind it.
    """
    numbers = [_giver_of(plane, job.setup.stages) for plane in planes]
    for plane, number in zip(planes, numbers, strict=True):
        if job.probe_end is not None and number >= job.probe_end:
            raise ContractError(f"the plane {plane!r} is asked for by a stage that it is made from")
    walk = Walk(job.with_new_log(probe_end=max(numbers)))
    return tuple(stream.rows() for stream in walk.streams(*planes))


def _planes_of(job: Job) -> dict[str, Plane]:
    """Return the planes that are stated; without a bundle that of the capture alone."""
    if job.bundle is not None:
        return job.bundle.manifest.all_planes
    plane: Plane = job.capture.plane(None)
    return {CAPTURE: plane}


def _capture_stream(job: Job, sensor_plane: Plane) -> Stream:
    """Return the capture as it is."""
    capture = job.capture
    rows = capture.rows()
    return Stream(
        plane=capture.plane(sensor_plane),
        shape=rows.shape,
        gains=(1.0,) * capture.channels,
        source=rows,
        owned=capture.gives_own_rows,
    )
