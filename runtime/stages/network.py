"""A network in windows: its planes taken to equal noise, tiled exactly, guarded, taken back."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.light_bound import BRIGHT
from camkit.bundle.light_bound import CELL_PX as LIGHT_CELL_PX
from camkit.bundle.stages import Network
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.color import rec709_of_planes
from camkit.runtime.content import CELL_PX
from camkit.runtime.envelope import findings, observe, verdict
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.job.walker import USUAL_BYTES
from camkit.runtime.machine.memory import trim_heap
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.guard import Bound, TileGuard, light_bound, plain_bound
from camkit.runtime.network.light_bound import LARGE_CHANGE, KeptRows
from camkit.runtime.network.light_keeper import LightKeeper
from camkit.runtime.network.tiling import Run
from camkit.runtime.network.white_keeper import white_keeper
from camkit.runtime.network.windows import (
    NetworkWindows,
    SizedNetwork,
    WindowLimits,
    lay_network,
)
from camkit.runtime.plan.bounded_networks import broken_laws, front_end
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.estimate import network_seconds, role_window_mp
from camkit.runtime.plan.speed import Speed
from camkit.runtime.plan.ways import planned
from camkit.runtime.rows import RowSource, changed_bands
from camkit.runtime.signal.coding import CodedRows, PlaneCoding
from camkit.runtime.signal.stabilise import (
    StackedRows,
    familiar_noise,
    stabilised_level,
    unstabilise,
)

METHODS: Final = ("net",)
TRIM_SHARE: Final = 0.7
"""Of the cap; above it freed memory is given back before every window."""
STRIP_TRIM_SHARE: Final = 0.8
"""Likewise before every strip, which takes less."""
WEIGHT_BYTES: Final = 8.8
"""Memory of a session for each weight: the number, and its place in a block (measured)."""
OPTIONS: Final = (
    *("size", "quality", "max_seconds", "max_error_db", "mode", "on_unsafe", "tile_px"),
    *("dtype", "provider", "laws", "strength", "noise", "iso"),
)
NOTED_FRACTION: Final = 0.01
"""Of the picture; a network that moves much light in more of it is worth a note."""


_USUAL: Final = "This is usual in dark or deeply coloured areas"
_OTHER_CAUSES: Final = (
    "; elsewhere the capture may be of another camera or distance, or its black level or white "
    "balance may be wrong"
)


def look(entry: Network, job: Job) -> Job:
    """Check the capture against the envelope, unless another network did."""
    if entry.transform == "stabilise" or entry.takes_noise:
        job = job.with_noise()
    return job if "envelope" in job.log.record else _compared(job)


def prepare(entry: Network, job: Job) -> StageWork:
    """Make ready; the windows are planned when the memory is known."""
    stage = _NetworkStage(entry, job)
    return StageWork(
        run=stage.run,
        fit=stage.fit,
        planned_bytes=stage.planned_bytes,
        warnings=stage.warnings,
    )


def _compared(job: Job) -> Job:
    """Return the job that knows whether the capture lies too far outside the bundle's envelope."""
    bundle, options = job.known_bundle, job.options
    plan = planned(bundle.manifest.stages, Work(method=options.method))
    if bundle.manifest.envelope is None or not plan.networks:
        return job
    job = job.with_noise()
    with job.log.clock.stage("envelope"):
        conditions = observe(job.capture, job.noise)
    outside = findings(bundle.manifest.envelope, conditions)
    warning = verdict(outside, bundle.manifest.name, options.on_unsafe)
    falls_back = warning is not None and options.on_unsafe == "fallback"
    job.log.record["envelope"] = {"seen": conditions, "outside": outside, "fallback": falls_back}
    if warning is not None:
        job.log.notes.append(warning)
    return replace(job, falls_back=falls_back)


def seconds(entry: Network, subject: Subject, work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    window_mp = role_window_mp(entry.role, subject, work)
    return network_seconds(entry.role, window_mp, speed, subject.megapixels)


def given_rows(entry: Network, job: Job, streams: Sequence[Stream]) -> RowSource:
    """Return the rows that the network of a stage is given: its planes stacked and stabilised.

    Behind them come those that say where it is kept, if the stage takes a mask.
    """
    planes, masks = _parted(streams)
    coding = coding_of(entry, job)
    if coding is not None:
        pieced = [stream.pieced() for stream in planes]
        noise = _sample_noise(job, planes[-1]) if entry.takes_noise else None
        return CodedRows(pieced, coding, noise=noise, threads=job.threads)
    noises = None
    if entry.transform == "stabilise":
        noises = [_familiar_noise(job, stream) for stream in planes]
    return StackedRows(
        [stream.pieced() for stream in planes],
        noises,
        scale=entry.scale,
        threads=job.threads,
        masks=[KeptRows(mask.rows()) for mask in masks],
    )


def coding_of(entry: Network, job: Job, *, output: bool = False) -> PlaneCoding | None:
    """Return the numbers that a network takes, or gives; None where they are the stages' own."""
    coding, space = entry.coding, entry.space
    if coding is None or space is None:
        return None
    return PlaneCoding(
        space=coding.output if output else space,
        matrix=rec709_of_planes(job.color_matrix),
        exposure=coding.exposure,
        gain=coding.output_gain if output else coding.gain,
        offset=coding.output_offset if output else coding.offset,
    )


def _sample_noise(job: Job, stream: Stream) -> NoiseModel:
    """Return the noise of the samples of a stream; those of a mosaic count as the mean colour."""
    noise, channels = job.noise.with_gains(stream.gains), stream.plane.channels
    colours = job.known_bundle.manifest.sensor.channels
    places = [colours.index(name[0]) for name in channels if name[0] in colours]
    if len(places) == len(channels):
        shots, reads = ([part[i] for i in places] for part in (noise.shot, noise.read_variance))
        return NoiseModel(shot=tuple(shots), read_variance=tuple(reads))
    shot, read = (float(np.mean(part)) for part in (noise.shot, noise.read_variance))
    return NoiseModel(shot=(shot,) * len(channels), read_variance=(read,) * len(channels))


def _parted(streams: Sequence[Stream]) -> tuple[list[Stream], list[Stream]]:
    """Return the streams of the inputs of a network, and the masks behind them."""
    planes = [stream for stream in streams if stream.plane.domain != "mask"]
    return planes, [stream for stream in streams if stream.plane.domain == "mask"]


def _familiar_noise(job: Job, stream: Stream) -> NoiseModel:
    """Return the noise by which a stream is stabilised."""
    noise = job.noise.with_gains(stream.gains)
    sensor = job.known_bundle.manifest.light_sensor
    return familiar_noise(noise, [entry.read_noise_e for entry in sensor.noise])


class _NetworkStage:
    """The network of one capture."""

    def __init__(self, entry: Network, job: Job) -> None:
        self._entry = entry
        self._job = job
        self._windows: NetworkWindows | None = None
        self._weight_bytes = 0
        self._guard: TileGuard | None = None
        self._keeper: LightKeeper | None = None
        planes = job.known_bundle.manifest.all_planes
        self._masks = sum(planes[name].domain == "mask" for name in entry.takes)

    def fit(self, max_bytes: int, spent_bytes: int) -> None:
        """Plan the windows: `max_bytes` in all, of which others take `spent_bytes`."""
        job, entry, work = self._job, self._entry, self._job.work
        bundle = job.known_bundle
        facts = [bundle.network_facts(entry.role, size) for size in work.sizes()]
        weights = int(WEIGHT_BYTES * sum(one.parameters for one in facts))
        self._weight_bytes = max(weights - USUAL_BYTES, 0)
        limits = WindowLimits(
            cap_bytes=max_bytes,
            spent_bytes=spent_bytes + self._weight_bytes,
            mode=work.mode,
            cell_px=CELL_PX,
            tile_px=job.options.tile_px,
        )
        # its activations are the peak: what other stages have freed must not lie beside them
        trim, trim_late = (
            partial(trim_heap, int(share * max_bytes)) for share in (TRIM_SHARE, STRIP_TRIM_SHARE)
        )
        engines = [job.setup.networks(entry.role, size) for size in work.sizes()]
        networks = [
            SizedNetwork(
                size=size,
                run=self._run(engine, trim),
                facts=one,
                block_bytes=engine.block_bytes or 0.0,
                masks=self._masks,
                extra_reach_px=entry.extra_reach_px,
                lattice_px=1 if entry.light is None else LIGHT_CELL_PX,
                segments=engine.segments,
                trim=trim_late,
            )
            for size, one, engine in zip(work.sizes(), facts, engines, strict=True)
        ]
        input_plane = bundle.manifest.planes[entry.takes[0]]
        self._windows = lay_network(
            job.grid_px(input_plane), networks, limits, work.network_labels()
        )
        log = job.log
        log.windows[entry.role] = self._windows
        log.notes.extend(self._windows.notes())
        tiles = {role: windows.to_json() for role, windows in log.windows.items()}
        one = len(bundle.manifest.networks) == 1
        log.record["tiles"] = tiles[entry.role] if one else tiles
        log.record["network"] = {"provider": job.options.provider, "dtype": job.options.dtype}
        proofs = {size: proof for size in work.sizes() if (proof := job.setup.proof(size))}
        if proofs:
            log.record["network"]["proof"] = proofs
            notes = {proof["note"] for proof in proofs.values()} - {None, *log.notes}
            log.notes.extend(sorted(notes))

    def _run(self, engine: NetworkEngine, trim: Callable[[], None]) -> Run:
        """Return the run of a network on windows of which it takes the first channels."""
        cancel = self._job.cancel  # not by the job, which holds the windows
        inputs = engine.channels

        def run(window: FloatArray) -> FloatArray:
            trim()
            return engine.run(window[:, :inputs], cancel=cancel)

        return run

    def planned_bytes(self) -> int:
        """Return the memory of weights and windows."""
        return 0 if self._windows is None else self._weight_bytes + self._windows.needed_bytes()

    def warnings(self) -> tuple[str, ...]:
        """Return warnings about rejected tiles, and about light that the network moved."""
        replaced = () if self._guard is None else self._guard.replaced
        tiles = tuple(
            f"the network's result was rejected and its input used in {tile}" for tile in replaced
        )
        return (*tiles, *self._moved_light(), *self._broken_laws())

    def _broken_laws(self) -> tuple[str, ...]:
        bundle = self._job.known_bundle
        broken = broken_laws(bundle.manifest, self._job.work.sizes())
        if not broken:
            return ()
        return (
            f"bundle {bundle.manifest.name} exceeds its stated limits ({', '.join(broken)}): "
            "`camkit info` lists by how much",
        )

    def _moved_light(self) -> tuple[str, ...]:
        keeper = self._keeper
        if keeper is None or not keeper.measured or keeper.large_fraction <= NOTED_FRACTION:
            return ()
        text = (
            f"in {keeper.large_fraction:.1%} of the picture the network and the filter differ in "
            f"brightness by more than {LARGE_CHANGE:.0%}"
        )
        if keeper.bound is not None:
            text += "; the brightness of the filter was kept there"
        else:
            text += f" ({option_text('laws', 'enforce')} keeps that of the filter)"
        is_own = self._job.capture.bundle_name == self._job.known_bundle.manifest.name
        return (f"{text}. {_USUAL}{'' if is_own else _OTHER_CAUSES}",)

    def run(self, streams: Sequence[Stream]) -> tuple[Stream, ...]:
        """Return the outputs of the network."""
        if self._windows is None:
            raise ContractError("the windows of a network are planned before it runs")
        job, entry = self._job, self._entry
        facts = self._facts()
        planes, masks = _parted(streams)
        stand_in = self._stand_in(planes)
        noise = self._noise(planes[-1], len(facts.outputs))
        self._keeper = self._light_keeper(stand_in, masked=bool(masks), noise=noise)
        self._guard = TileGuard(
            fallback=job.options.on_unsafe == "fallback",
            stand_in=stand_in,
            inputs=facts.input_channels,
            bound=self._bound(noise),
        )
        bands = self._windows.bands(
            given_rows(entry, job, streams),
            progress=lambda count, total: job.log.meter.reach(entry.gives[0], count / total),
            cancel=job.cancel,
            guard=self._guard,
            stand_in=stand_in,
            finish=self._keeper,
        )
        if self._keeper is not None and self._keeper.measured:
            bands = self._counted(bands, self._keeper)
        coding = coding_of(entry, job, output=True)
        if noise is not None:
            bands = self._linear(bands, noise)
        elif coding is not None:
            bands = changed_bands(bands, lambda rows, _: coding.decode(rows), threads=job.threads)
        return self._split(bands, planes[-1], [port.channels for port in facts.outputs])

    def _bound(self, noise: NoiseModel | None) -> Bound:
        """Return what is believed of the output of a tile."""
        entry, job = self._entry, self._job
        if noise is not None:
            return light_bound(entry.most_light, noise, scale=entry.scale)
        numbers_in, numbers_out = (coding_of(entry, job, output=output) for output in (False, True))
        if numbers_in is None or numbers_out is None:
            return plain_bound(entry.most_light)
        plain = plain_bound(entry.most_light)

        def bound(largest: float) -> tuple[float, float]:
            most = numbers_out.largest_number(plain(numbers_in.largest_light(largest))[1])
            return -most, most

        return bound

    def _light_keeper(
        self, stand_in: slice | None, *, masked: bool, noise: NoiseModel | None
    ) -> LightKeeper | None:
        """Return the stage behind the network; None for none.

        Raises:
            ContractError: If its output cannot be mixed with what it improves on.
        """
        entry, strength = self._entry, self._job.options.strength * self._job.work.strength
        if stand_in is None:
            if strength != 1:
                raise ContractError(
                    f"strength mixes what a network makes with the picture in front of it, and the "
                    f"one of the role {entry.role} makes something else; leave it out"
                )
            return None
        behind_bank = front_end(entry, self._job.setup.stages) is not None
        measured = entry.transform == "stabilise" and behind_bank
        white = bright = None
        if noise is not None and entry.keeps_white:
            white = white_keeper(noise, entry.scale, rec709_of_planes(self._job.color_matrix))
        if noise is not None and entry.light is not None and entry.light.keeps_bright:
            bright = stabilised_level(BRIGHT, noise, scale=entry.scale)[:, 0, 0]
        if not measured and strength == 1 and white is None:
            return None
        return LightKeeper(
            front=stand_in,
            kept_channel=self._facts().input_channels if masked else None,
            bound=entry.light,
            measured=measured,
            strength=strength,
            scale=entry.scale,
            bright=bright,
            white=white,
        )

    def _counted(self, bands: Iterator[FloatArray], keeper: LightKeeper) -> Iterator[FloatArray]:
        """Write down with every band in how much of the picture so far light was moved."""
        for band in bands:
            self._job.log.sections["laws"] = {
                "enforced": keeper.bound is not None,
                "fallback_fraction": round(keeper.fallback_fraction, 6),
            }
            yield band
            del band

    def _noise(self, last: Stream, ports: int) -> NoiseModel | None:
        """Return noise by which outputs are taken back: every port by that of the last input."""
        if self._entry.transform != "stabilise":
            return None
        one = _familiar_noise(self._job, last)
        return NoiseModel(shot=one.shot * ports, read_variance=one.read_variance * ports)

    def _linear(self, bands: Iterator[FloatArray], noise: NoiseModel) -> Iterator[FloatArray]:
        """Convert stabilised bands to light, in place."""
        scale = self._entry.scale

        def undo(rows: FloatArray, _: int) -> None:
            unstabilise(rows, noise, scale=scale, out=rows)

        return changed_bands(bands, undo, threads=self._job.threads)

    def _stand_in(self, streams: Sequence[Stream]) -> slice | None:
        """Return the channels of the input that stand for the output where it is not had."""
        planes = self._job.known_bundle.manifest.planes
        entry = self._entry
        if len(entry.gives) != 1 or not entry.is_one_coding:
            return None
        output_plane = planes[self._entry.gives[0]]
        ends = np.cumsum([stream.shape[0] for stream in streams])
        for end, stream in zip(ends[::-1], reversed(streams), strict=True):
            if stream.plane.stands_for(output_plane):
                return slice(int(end) - stream.shape[0], int(end))
        return None

    def _split(
        self, bands: Iterator[FloatArray], last: Stream, channels: Sequence[int]
    ) -> tuple[Stream, ...]:
        """Split the channels of the bands into the planes that the stage gives."""
        entry, planes = self._entry, self._job.known_bundle.manifest.planes
        height, width = (side * self._scale() for side in last.shape[1:])
        shape = sum(channels), height, width
        joined = replace(last.with_bands(bands), shape=shape, noise_rise=None)
        if len(channels) == 1:
            return (replace(joined, plane=planes[entry.gives[0]]),)
        starts = np.cumsum([0, *channels])
        streams = joined.shared(len(channels))
        return tuple(
            replace(
                stream,
                plane=planes[name],
                source=_Channels(stream.rows(), int(start), count),
                shape=(count, height, width),
            )
            for stream, name, start, count in zip(
                streams, entry.gives, starts[:-1], channels, strict=True
            )
        )

    def _scale(self) -> int:
        return self._facts().output_scale

    def _facts(self) -> NetworkFacts:
        """Return the facts of the network; also where all cells of a picture go without it."""
        return self._job.known_bundle.network_facts(self._entry.role, self._job.work.size)


class _Channels:
    """Some of the channels of a source."""

    def __init__(self, source: RowSource, start: int, count: int) -> None:
        self._source = source
        self._channels = slice(start, start + count)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w)."""
        _, height, width = self._source.shape
        return self._channels.stop - self._channels.start, height, width

    def read(self, top: int, bottom: int) -> FloatArray:
        """Return rows top..bottom."""
        return self._source.read(top, bottom)[self._channels]
