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
from camkit.errors import ContractError
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES
from camkit.runtime.plan.ways import LEFT_OUT, stand_ins, ways_of
from camkit.runtime.rows import ArrayRows, RowSource
from camkit.runtime.stage_finder import module_of, stage_keys

FIXED_BYTES: Final = 240_000_000
"""Interpreter and libraries, and what they keep (measured, see docs/performance.md)."""
USUAL_BYTES: Final = 16_000_000
"""Of a bundle, and of the weights of a network: so much is part of that."""


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
            ContractError: If the memory does not do, or a stage is left out that no plane stands in
                for.
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
        job = self._job
        running = [work for work, way in zip(self._works, self.ways, strict=True) if way]
        flexible = [work for work in running if work.fit is not None]
        cap = job.options.max_mem_bytes or DEFAULT_MAX_MEM_BYTES
        spent, first = self._fixed_bytes(running), self._first_bytes(running)
        if first > cap or (spent > cap and not flexible):
            raise ContractError(
                f"this takes about {max(spent, first) // 10**6} MB, the cap is "
                f"{cap // 10**6} MB; raise {option_text('max_mem_bytes')}"
            )
        for number, work in enumerate(flexible):
            assert work.fit is not None
            share = max(cap - spent, 1) // (len(flexible) - number)
            work.fit(cap, spent if len(flexible) == 1 else cap - share)
            spent += work.planned_bytes()

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
        held = sum(work.held_bytes for work in running)
        job = self._job
        stored = 0 if job.bundle is None else max(job.bundle.stored_bytes - USUAL_BYTES, 0)
        resident: int = job.capture.resident_bytes
        return FIXED_BYTES + stored + resident + job.reserved_bytes + held

    def warnings(self) -> tuple[str, ...]:
        """Return what the stages have to say once the last row is out."""
        return tuple(text for work in self._works for text in work.warnings())

    def stream(self, wanted: str) -> Stream:
        """Return the rows of a plane; every call walks anew.

        Args:
            wanted: Name of the plane.

        Raises:
            ContractError: If no stage gives it.
        """
        (made,) = self.streams(wanted)
        return made

    def streams(self, *wanted: str) -> tuple[Stream, ...]:
        """Return the rows of several planes by one walk, to be read band by band in turns.

        Args:
            wanted: Names of planes, no two alike.

        Raises:
            ContractError: If no stage gives one of them.
        """
        for name in wanted:
            _giver_of(name, self.stages)
        job, lasts = self._job, [self._instead.get(name, name) for name in wanted]
        needed = self._needed(lasts)
        takers = Counter([*lasts, *(name for number in needed for name in self._taken(number))])
        there = {CAPTURE: _capture_stream(job, self._planes[CAPTURE]), **job.known}
        ready = {name: stream.shared(takers[name]) for name, stream in there.items()}
        job.log.meter.expect([name for number in needed for name in self.stages[number].gives])
        for number in needed:
            taken = [ready[name].pop() for name in self._taken(number)]
            made = self._works[number].run(taken)
            for name, given in zip(self.stages[number].gives, made, strict=True):
                if name not in job.known:
                    counted = given.timed(job.log.clock, self.keys[number]).metered(
                        job.log.meter, name
                    )
                    ready[name] = counted.shared(takers[name])
        return tuple(ready[last].pop() for last in lasts)

    def keep(self, wanted: str) -> Stream:
        """Read a plane whole; from now on it is known, and what gives it does not run again."""
        stream = self.stream(wanted)
        rows = stream.rows()
        whole = ArrayRows(rows.read(0, rows.shape[1]))
        kept = replace(stream, source=whole, made=None, owned=False)
        self._job.known[self._instead.get(wanted, wanted)] = kept
        return kept

    def taken_by(self, number: int) -> list[Stream]:
        """Return the streams that a stage takes; every call walks anew."""
        return [self.stream(name) for name in self.stages[number].takes]

    def _needed(self, wanted: Sequence[str]) -> list[int]:
        """Return the stages, in order, whose planes the wanted are made of and are not known."""
        planes, needed, known = set(wanted), [], self._job.known.keys()
        for number in range(len(self.stages) - 1, -1, -1):
            made = planes.intersection(self.stages[number].gives) - known
            if made and self.ways[number] != LEFT_OUT:
                planes.update(self._taken(number))
                needed.append(number)
        return needed[::-1]

    def _taken(self, number: int) -> tuple[str, ...]:
        """Return the names of the planes that a stage takes; stand-ins for what is left out."""
        return tuple(self._instead.get(name, name) for name in self.stages[number].takes)


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
        if job.before is not None and number >= job.before:
            raise ContractError(f"the plane {plane!r} is asked for by a stage that it is made from")
    walk = Walk(job.unheard(before=max(numbers)))
    return tuple(stream.rows() for stream in walk.streams(*planes))


def _planes_of(job: Job) -> dict[str, Plane]:
    """Return the planes that are stated; without a bundle that of the capture alone."""
    if job.bundle is not None:
        return job.bundle.manifest.all_planes
    plane: Plane = job.capture.plane(None)
    return {CAPTURE: plane}


def _capture_stream(job: Job, stated: Plane) -> Stream:
    """Return the capture as it is."""
    capture = job.capture
    rows = capture.rows()
    return Stream(
        plane=capture.plane(stated),
        shape=rows.shape,
        gains=(1.0,) * capture.channels,
        source=rows,
        owned=capture.gives_own_rows,
    )
