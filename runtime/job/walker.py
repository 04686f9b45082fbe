"""The stages of a manifest walked in order: made ready, given their share of memory, joined.

    prepare every stage -> plan -> ways -> memory -> streams -> the rows of a product

Nothing is computed before the first row is asked for.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.chain import CAPTURE
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.errors import ContractError
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES
from camkit.runtime.plan.ways import LEFT_OUT, stand_in, ways_of
from camkit.runtime.rows import ArrayRows, Rows, RowSource
from camkit.runtime.stage_finder import stage_keys, stage_module

FIXED_BYTES: Final = 260_000_000
"""Interpreter and libraries, and what they keep (measured, see docs/performance.md)."""


class Walk:
    """The stages of one capture.

    Attributes:
        stages: As the manifest lists them.
        keys: Their names for people and clocks.
        ways: The way each takes; set by `settle`.
    """

    def __init__(self, job: Job) -> None:
        """Make every stage ready; what was not planned yet is done by `settle`."""
        self._job = job
        self.stages = job.setup.stages
        self.keys = stage_keys(self.stages)
        self.ways: tuple[str, ...] = ()
        job.probe = self._probe
        self._works: list[StageWork] = [
            stage_module(stage.type).prepare(stage, job) for stage in self.stages
        ]

    def settle(self) -> None:
        """Choose the ways by the job's plan, and share the memory among the stages that run.

        Raises:
            ContractError: If the memory does not do.
        """
        job = self._job
        self.ways = ways_of(self.stages, job.work)
        job.record["stages"] = {
            key: {"way": way or "left out"} for key, way in zip(self.keys, self.ways, strict=True)
        }
        running = [work for work, way in zip(self._works, self.ways, strict=True) if way]
        flexible = [work for work in running if work.fit is not None]
        cap = job.options.max_mem_bytes or DEFAULT_MAX_MEM_BYTES
        spent = self._fixed_bytes(running)
        for number, work in enumerate(flexible):
            assert work.fit is not None
            share = max(cap - spent, 1) // (len(flexible) - number)
            work.fit(cap, spent if len(flexible) == 1 else cap - share)
            spent += work.planned_bytes()

    def needed_bytes(self) -> int:
        """Give the memory of the whole walk."""
        running = [work for work, way in zip(self._works, self.ways, strict=True) if way]
        return self._fixed_bytes(running) + sum(work.planned_bytes() for work in running)

    def _fixed_bytes(self, running: list[StageWork]) -> int:
        held = sum(work.held_bytes for work in running)
        return FIXED_BYTES + self._job.capture.resident_bytes + held

    def warnings(self) -> tuple[str, ...]:
        """Give what the stages have to say once the last row is out."""
        return tuple(text for work in self._works for text in work.warnings())

    def stream(self, wanted: str) -> Stream:
        """Give the rows of a plane; every call walks anew.

        Args:
            wanted: Name of the plane.

        Raises:
            ContractError: If a stage is left out that no plane stands in for.
        """
        job = self._job
        alias = self._alias()
        last = alias.get(wanted, wanted)
        on_the_way = self._on_the_way(alias, last)
        takers = self._takers(on_the_way, alias, last)
        ready: dict[str, list[Stream]] = {}
        self._offer(ready, takers, CAPTURE, _capture_stream(job, self._planes()[CAPTURE]))
        for name, known in job.known.items():
            self._offer(ready, takers, name, known)
        for number in on_the_way:
            stage, work, key = self.stages[number], self._works[number], self.keys[number]
            taken = [ready[alias.get(name, name)].pop() for name in stage.takes]
            for name, given in zip(stage.gives, work.run(taken), strict=True):
                if name not in job.known:
                    self._offer(ready, takers, name, given.timed(job.clock, key))
        if last not in ready:
            names = ", ".join(name for stage in self.stages for name in stage.gives)
            raise ContractError(f"no stage gives the plane {wanted!r}; there are {names}")
        return ready[last].pop()

    def keep(self, wanted: str) -> Stream:
        """Read a plane whole; from now on it is known, and what gives it does not run again."""
        stream = self.stream(wanted)
        rows = stream.rows()
        whole = ArrayRows(rows.read(0, rows.shape[1]))
        kept = replace(stream, source=whole, made=None, owned=False)
        self._job.known[self._alias().get(wanted, wanted)] = kept
        return kept

    def _alias(self) -> dict[str, str]:
        """Give the planes that stages which are left out would give -> those that stand for them.

        Raises:
            ContractError: If no plane stands in for what a stage gives.
        """
        planes = self._planes()
        alias: dict[str, str] = {}
        for stage, way in zip(self.stages, self.ways, strict=True):
            if way == LEFT_OUT:
                instead = stand_in(stage, planes)
                alias[stage.gives[0]] = alias.get(instead, instead)
        return alias

    def _on_the_way(self, alias: Mapping[str, str], wanted: str) -> list[int]:
        """Number the stages, in order, whose planes the wanted one is made of and are not known."""
        needed, found = {wanted}, []
        for number in reversed(range(len(self.stages))):
            stage = self.stages[number]
            made = needed.intersection(stage.gives) - self._job.known.keys()
            if made and self.ways[number] != LEFT_OUT:
                found.append(number)
                needed |= {alias.get(name, name) for name in stage.takes}
        return found[::-1]

    def taken_by(self, number: int) -> list[Stream]:
        """Give the streams that a stage takes; every call walks anew."""
        return [self.stream(name) for name in self.stages[number].takes]

    def _takers(
        self, on_the_way: Sequence[int], alias: Mapping[str, str], wanted: str
    ) -> dict[str, int]:
        """Count who takes each plane, on the way to the wanted one."""
        takers = {wanted: 1}
        for number in on_the_way:
            for name in self.stages[number].takes:
                taken = alias.get(name, name)
                takers[taken] = takers.get(taken, 0) + 1
        return takers

    @staticmethod
    def _offer(
        ready: dict[str, list[Stream]], takers: Mapping[str, int], name: str, stream: Stream
    ) -> None:
        count = takers.get(name, 0)
        if count:
            ready[name] = stream.shared(count)

    def _planes(self) -> dict[str, Plane]:
        bundle = self._job.bundle
        if bundle is None:
            return {CAPTURE: _plain_plane(self._job)}
        return bundle.manifest.all_planes

    def _probe(self, plane: str) -> RowSource:
        """Give rows of a plane that are made for one stage alone, before its first row."""
        job = Job(self._job.setup, self._job.capture, cancel=self._job.cancel)
        job.work = self._job.work
        walk = Walk(job)
        walk.settle()
        return walk.stream(plane).rows()


def _plain_plane(job: Job) -> Plane:
    """Give the plane of a capture without a bundle."""
    channels = MOSAIC if job.capture.cfa is not None else RGB
    return Plane(type="uint16", channels=channels, domain="dn")


def _capture_stream(job: Job, plane: Plane) -> Stream:
    """Give the capture as it is; planes that come in place of a mosaic have their own channels."""
    capture = job.capture
    if capture.cfa is None and plane.channels == MOSAIC:
        plane = plane.model_copy(update={"channels": RGB})
    return Stream(
        plane=plane,
        shape=capture.plane_shape,
        gains=(1.0,) * capture.channels,
        source=_Samples(job),
        owned=False,
    )


class _Samples:
    """The samples of a capture as the file holds them."""

    def __init__(self, job: Job) -> None:
        self._capture = job.capture

    @property
    def shape(self) -> tuple[int, int, int]:
        """Give (channel, h, w); a mosaic is one channel."""
        return self._capture.plane_shape

    def read(self, top: int, bottom: int) -> Rows:
        """Give rows top..bottom."""
        rows: Rows = self._capture.samples[..., top:bottom, :]
        return rows if rows.ndim == 3 else rows[None]
