"""The stages joined: the same bits however rows are shared, left out where a plane stands in."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Color, Linearise, Network, Repair, Wiener
from camkit.errors import ContractError, MemoryCapError
from camkit.runtime.capture import Capture
from camkit.runtime.job import walker
from camkit.runtime.job.job import Job
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.job.walker import FIXED_BYTES, Walk
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import PLAIN
from camkit.runtime.rows import Rows
from camkit.runtime.signal.demosaic import apply_gains, demosaic
from camkit.runtime.signal.noise import repair_mosaic, repair_planes
from camkit.runtime.stage_finder import stage_module
from camkit.runtime.stages import network as network_stage
from tests.bundle_factory import PITCH_UM
from tests.job_factory import OWN_BALANCE, SHAPE, made_mosaic, made_planes, read_all, start
from tests.plan_factory import half_textured_mosaic, write_planned_bundle
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle
from tests.psf_factory import streak_kernel, uniform_psf


def _broken() -> Capture:
    """Give a capture with dead pixels and a light that clips."""
    samples = np.random.default_rng(0).integers(300, 500, SHAPE).astype(np.uint16)
    samples[9::20, 11::20] = 1000
    samples[30:40, 30:40] = 1023
    return made_mosaic(samples=samples, cfa="RGGB")


def _light(channels: int = 1, seed: int = 0) -> Capture:
    samples = np.random.default_rng(seed).random((channels, *SHAPE), dtype=np.float32)
    return made_planes(samples=0.1 + 0.5 * samples)


# ------------------------------------------------------------------------------- front and sharing


@pytest.mark.parametrize("method", ["fast", "quality"])
@pytest.mark.parametrize(("threads", "step"), [(1, 9), (2, 33), (2, 64)])
def test_the_front_in_bands_is_the_whole_and_counts_each_sample_once(
    bundle: Bundle, method: str, threads: int, step: int
) -> None:
    capture = _broken()
    mosaic, broken = repair_mosaic(capture.linear_rows(0, 64))
    apply_gains(mosaic, "RGGB", OWN_BALANCE)
    made = start(bundle, capture, demosaic=method, threads=threads)
    np.testing.assert_array_equal(
        read_all(made.rows_of("rgb"), step),
        demosaic(mosaic, "RGGB", method),  # type: ignore[arg-type]
    )
    assert made.warnings == (f"{np.count_nonzero(broken)} dead or invalid pixels were repaired",)
    assert made.clipped_fraction == capture.saturated_rows(0, 64).mean()


def _fanned(folder: Path) -> Bundle:
    """Give a camera whose light is taken by four stages, and one plane twice by one of them."""
    one = [Port(name="a", channels=1)]
    data = {
        "first": finer_network(1, 1, scale=1, seed=1),
        "second": finer_network(1, 1, scale=1, seed=2),
        "join": finer_network(5, 1, scale=1, seed=3),
    }
    inputs = {"first": one, "second": one, "join": [Port(name=n, channels=1) for n in "abcde"]}
    networks = {
        role: (facts_of(graph, inputs[role], one, f"{role}.onnx"), graph)
        for role, graph in data.items()
    }
    plain = {"transform": "none"}
    stages = (
        Linearise(gives=("light",)),
        Network(role="first", takes=("light",), gives=("one",), **plain),
        Network(role="second", takes=("light",), gives=("two",), **plain),
        Network(
            role="join", takes=("light", "one", "two", "two", "light"), gives=("all",), **plain
        ),
        Color(takes=("all",)),
    )
    return write_planes_bundle(
        folder, stages, sensor=planes_sensor(), networks=networks, products={"image": "picture"}
    )


@pytest.mark.parametrize("tile_px", [None, 16])
def test_planes_with_several_takers_give_each_the_same_bits(
    tmp_path: Path, tile_px: int | None
) -> None:
    camera, capture = _fanned(tmp_path), _light()
    made = start(camera, capture, tile_px=tile_px)

    def run(role: str, planes: FloatArray) -> FloatArray:
        engine = NetworkEngine(camera.network_bytes(role, "M"), threads=1)
        return engine.run(np.ascontiguousarray(planes)[None])[0]

    light = capture.samples
    one, two = run("first", light), run("second", light)
    wanted = run("join", np.concatenate([light, one, two, two, light]))
    np.testing.assert_array_equal(made.fill(), np.repeat(wanted, 3, axis=0))
    assert made.record["stages"].keys() == {
        *("linearise", "network first", "network second", "network join", "color")
    }
    assert {"linearise", "network first", "network second", "network join", "color"} <= set(
        made.seconds
    )


def test_light_that_is_repaired_and_taken_as_it_is_gives_the_same_bits(tmp_path: Path) -> None:
    """Rows that roll: the repair, its mask and the bank read what a network reads later."""
    data = finer_network(2, 1, scale=1)
    ports = [Port(name="a", channels=1), Port(name="b", channels=1)]
    stages = (
        Linearise(),
        Repair(),
        Wiener(
            takes=("sound", "unknown"),
            block_px=64,
            overlap_px=24,
            prior_scale=1e-3,
            prior_exponent=2.0,
            clip_iterations=2,
        ),
        Network(takes=("light", "restored"), gives=("clean",), transform="none"),
        Color(takes=("clean",)),
    )
    psf = replace(uniform_psf(streak_kernel(20.0)), pixel_pitch_um=PITCH_UM)
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(size_px=(96, 400)),
        psf=psf,
        networks={"restore": (facts_of(data, ports, ports[:1]), data)},
    )
    samples = np.random.default_rng(0).integers(300, 500, (1, 400, 96)).astype(np.uint16)
    samples[0, 9::20, 11::20] = 1000
    samples[0, 130:140, 30:40] = 1023
    capture = made_planes(samples=samples, black_level=np.full(1, 64, "f4"), white_level=1023.0)
    made = start(camera, capture, tile_px=64)
    picture = made.fill()
    light, restored = (read_all(made.rows_of(name)) for name in ("light", "restored"))
    engine = NetworkEngine(data, threads=1)
    wanted = engine.run(np.concatenate([light, restored])[None])[0]
    np.testing.assert_array_equal(picture, np.repeat(wanted, 3, axis=0))
    sound, broken = repair_planes(capture.linear_rows(0, 400))
    np.testing.assert_array_equal(read_all(made.rows_of("sound"), 37), sound)
    clipped = capture.saturated_rows(0, 400)
    np.testing.assert_array_equal(read_all(made.rows_of("unknown"), 37), clipped & ~broken)
    assert made.warnings == (f"{np.count_nonzero(broken)} dead or invalid pixels were repaired",)
    assert made.clipped_fraction == clipped.mean()


def test_memory_is_shared_among_networks_within_the_cap(tmp_path: Path) -> None:
    camera = _fanned(tmp_path)
    free, tight = (
        start(camera, _light(), max_mem_bytes=cap).explain() for cap in (None, 400_000_000)
    )
    assert free is not None
    assert tight is not None
    assert tight.peak_mb <= 400
    made = start(camera, _light())
    assert list(made.windows) == ["first", "second", "join"]
    assert made.record["tiles"].keys() == made.windows.keys()


def test_rows_beyond_the_cap_are_refused_before_any_work(tmp_path: Path) -> None:
    capture = made_planes(samples=np.zeros((1, 2000, 25_000), np.float32))
    stages = (Linearise(gives=("light",)), Color(takes=("light",)))
    camera = write_planes_bundle(tmp_path, stages, sensor=planes_sensor())
    with pytest.raises(ContractError, match=r"cap is 400 MB; raise max_mem_bytes"):
        start(camera, capture, max_mem_bytes=400_000_000, assume="scale")


def _refused(plan: Callable[[int], object], cap_bytes: int) -> str:
    """Return the refusal of a cap, once the cap that it names was found to be enough."""
    with pytest.raises(MemoryCapError) as refused:
        plan(cap_bytes)
    (named,) = re.findall(r"raise max_mem_bytes=([\d_]+)$", str(refused.value))
    assert int(named) == refused.value.need_bytes
    plan(int(named))
    return str(refused.value)


def test_the_cap_that_a_refusal_names_is_enough(tmp_path: Path) -> None:
    fanned, light = _fanned(tmp_path), made_planes(samples=np.zeros((1, 1100, 30_000), np.float32))
    _refused(
        lambda cap: start(fanned, light, max_mem_bytes=cap, assume="scale"), cap_bytes=400_000_000
    )
    mosaic = np.full((4000, 6000), 500, np.uint16)

    def plan(cap: int) -> object:
        return camkit.load("duet", size="S", threads=1, max_mem_bytes=cap).plan(mosaic)

    assert "this takes about" in _refused(plan, 400_000_000)
    assert "for one window" in _refused(plan, 440_000_000)


def _ran(monkeypatch: pytest.MonkeyPatch, *types: str) -> list[str]:
    """Note which stages run."""
    ran: list[str] = []
    for type_ in types:
        _change(
            monkeypatch,
            type_,
            lambda entry, _job, run: lambda t: (ran.append(entry.type), run(t))[1],
        )
    return ran


def _change(
    monkeypatch: pytest.MonkeyPatch,
    type_: str,
    change: Callable[[Any, Job, Callable[..., Any]], Callable[..., Any]],
) -> None:
    """Let the stages of a type run as `change(entry, job, run)` says."""
    module = stage_module(type_)
    prepare = module.prepare

    def prepared(entry: Any, job: Job) -> StageWork:
        work = prepare(entry, job)
        return replace(work, run=change(entry, job, work.run))

    monkeypatch.setattr(module, "prepare", prepared)


def test_only_the_stages_on_the_way_to_a_plane_run(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = _ran(monkeypatch, *(stage.type for stage in bundle.manifest.stages))
    made = start(bundle, _broken())
    assert ran == []
    made.rows_of("rgb")
    assert ran == ["linearise", "repair", "white_balance", "demosaic"]
    ran.clear()
    made.rows_of("capture")
    assert ran == []
    made.rows_of("clipped")
    assert ran == ["linearise"]


def test_for_a_branch_that_nobody_reads_nothing_is_kept(tmp_path: Path) -> None:
    """Of a network of two ports the plane that no product wants must not fill the memory."""
    data = finer_network(1, 2, scale=1)
    ports = [Port(name="a", channels=1), Port(name="b", channels=1)]
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("near", "far"), transform="none"),
        Color(takes=("near",)),
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(size_px=(96, 640)),
        networks={"restore": (facts_of(data, ports[:1], ports), data)},
        products={"image": "picture", "depth": "far"},
    )
    capture = made_planes(samples=np.ones((1, 640, 96), np.float32))
    rows = start(camera, capture, tile_px=32).rows_of("near")
    rows.read(0, 10)
    rows.read(600, 640)
    # metered, timed, channels, reader
    rolling = rows._source._source._source._rows  # type: ignore[attr-defined]
    assert sum(band.shape[1] for _, band in rolling._bands_read) < 200


# ------------------------------------------------------------------------------- kept planes


@pytest.mark.parametrize("plane", ["capture", "light", "rgb", "restored", "clean", "picture"])
def test_from_a_plane_that_is_kept_on_the_walk_gives_the_same_bits(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch, plane: str
) -> None:
    wanted = start(bundle, _broken()).fill()
    first = start(bundle, _broken())
    kept = first.keep(plane)
    ran = _ran(monkeypatch, *(stage.type for stage in bundle.manifest.stages))
    pipeline = Pipeline(bundle, Options(threads=2))
    again = pipeline.start(_broken(), known_planes={plane: kept})
    np.testing.assert_array_equal(again.fill(), wanted)
    types = [stage.type for stage in bundle.manifest.stages]
    giver = next((n for n, s in enumerate(bundle.manifest.stages) if plane in s.gives), -1)
    if plane in ("rgb", "clean", "picture"):  # nothing behind them takes an earlier plane
        masks = ["linearise", "repair"] if plane == "rgb" else []  # the bank takes the mask too
        assert ran == masks + types[giver + 1 :]
    assert read_all(first.rows_of(plane)).tobytes() == read_all(kept.rows()).tobytes()


def test_a_kept_plane_may_be_read_by_many_and_is_changed_by_none(bundle: Bundle) -> None:
    made = start(bundle, _broken())
    kept = read_all(made.keep("clean").rows()).copy()
    pictures = [made.fill() for _ in range(2)]
    np.testing.assert_array_equal(*pictures)
    np.testing.assert_array_equal(read_all(made.rows_of("clean")), kept)


def test_what_is_kept_for_a_plane_left_out_is_the_plane_that_stands_in(bundle: Bundle) -> None:
    made = start(bundle, _broken(), method="wiener")
    kept = made.keep("clean")
    np.testing.assert_array_equal(read_all(kept.rows()), read_all(made.rows_of("restored")))
    np.testing.assert_array_equal(made.fill(), start(bundle, _broken(), method="wiener").fill())


# ------------------------------------------------------------------------------- left out


def test_a_stage_left_out_is_replaced_by_the_plane_that_stands_for_it(bundle: Bundle) -> None:
    made = start(bundle, _broken(), undistort=False, vignetting=False)
    ways = {name: stage["way"] for name, stage in made.record["stages"].items()}
    assert (ways["undistort"], ways["illumination"]) == ("left out", "left out")
    rows = {name: read_all(made.rows_of(name)) for name in ("neutral", "even", "straight")}
    np.testing.assert_array_equal(rows["straight"], rows["neutral"])
    np.testing.assert_array_equal(rows["even"], rows["neutral"])
    whole = start(bundle, _broken())
    assert (read_all(whole.rows_of("even")) != rows["neutral"]).any()


@pytest.mark.parametrize("method", ["wiener", "develop"])
def test_a_network_left_out_gives_its_last_input(bundle: Bundle, method: str) -> None:
    made = start(bundle, _broken(), method=method)
    instead = {"wiener": "restored", "develop": "rgb"}[method]
    np.testing.assert_array_equal(read_all(made.rows_of("clean")), read_all(made.rows_of(instead)))
    if method == "wiener":
        assert (read_all(made.rows_of("clean")) != read_all(made.rows_of("rgb"))).any()


UNLIKE: dict[str, tuple[int, int, int, str]] = {
    "of twice the size": (1, 1, 2, "none"),
    "of another number of channels": (1, 2, 1, "none"),
}


def _enlarging(folder: Path, channels: int, outputs: int, scale: int, transform: Any) -> Bundle:
    data = finer_network(channels, outputs, scale=scale)
    ports = [Port(name="a", channels=channels)], [Port(name="b", channels=outputs, scale=scale)]
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("large",), transform=transform),
    )
    return write_planes_bundle(
        folder,
        stages,
        sensor=planes_sensor(),
        networks={"restore": (facts_of(data, *ports), data)},
        products={"image": "large"},
    )


@pytest.mark.parametrize("shape", UNLIKE.values(), ids=UNLIKE)
def test_a_stage_that_no_plane_stands_for_cannot_be_left_out(
    tmp_path: Path, shape: tuple[int, int, int, str]
) -> None:
    camera = _enlarging(tmp_path, *shape)
    with pytest.raises(ContractError, match="method must be one of net to bundle"):
        Pipeline(camera, Options(method="develop"))
    start(camera, _light()).fill()
    start(camera, _light(), method="net").fill()


def test_a_time_that_the_network_does_not_fit_leaves_it_in_where_it_must_stay(
    tmp_path: Path,
) -> None:
    camera = _enlarging(tmp_path, 1, 1, 2, "none")
    made = start(camera, _light(), max_seconds=1e-9)
    assert made.size == "M"
    assert any("even the least work" in note for note in made.job.log.notes)
    assert made.fill().shape == (1, 128, 192)


def test_a_fallback_that_cannot_be_is_refused_before_any_work(tmp_path: Path) -> None:
    data = finer_network(1, 1, scale=2)
    port = Port(name="a", channels=1)
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("large",), transform="none"),
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(),
        networks={
            "restore": (facts_of(data, [port], [port.model_copy(update={"scale": 2})]), data)
        },
        products={"image": "large"},
        envelope={"signal_level": {"low": 0.9, "high": 1.0}},
    )
    start(camera, _light()).fill()
    with pytest.raises(ContractError, match="nothing to fall back to"):
        start(camera, _light(), on_unsafe="fallback")


# ------------------------------------------------------------------------------- probes


class _Probed:
    """What a stage saw of planes before its first row, and the rows that it was given then."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, stage: str, planes: list[str], step: int = 64
    ) -> None:
        self.seen: dict[str, Rows] = {}
        self.given: list[Rows] = []
        self.jobs: list[Job] = []

        def change(_entry: Any, job: Job, run: Callable[..., Any]) -> Callable[..., Any]:
            def changed(taken: list[Stream]) -> tuple[Stream, ...]:
                self.jobs.append(job)
                first, *others = taken

                def bands() -> Iterator[Rows]:
                    for plane in planes:
                        self.seen[plane] = read_all(*job.probe(plane), step)
                    for band in first.bands():
                        self.given.append(band.copy())
                        yield band

                made: tuple[Stream, ...] = run([first.with_bands(bands()), *others])
                return made

            return changed

        _change(monkeypatch, stage, change)


PROBED = ["capture", "light", "clipped", "sound", "unknown", "rgb", "restored", "clean"]


def _told(made: Reconstruction) -> tuple[Any, ...]:
    return (
        made.warnings,
        made.clipped_fraction,
        made.record,
        made.white_balance,
        [windows.to_json() for windows in made.windows.values()],
    )


@pytest.mark.parametrize("step", [64, 10])
def test_a_probe_before_the_first_row_equals_the_rows_later(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch, step: int
) -> None:
    untouched = start(bundle, _broken(), tile_px=32)
    picture = untouched.fill()
    with monkeypatch.context() as patch:
        probed = _Probed(patch, "raise_clipped", PROBED, step)
        made = start(bundle, _broken(), tile_px=32)
        assert probed.seen == {}, "nothing is computed before the first row"
        np.testing.assert_array_equal(made.fill(), picture)
    assert set(probed.seen) == set(PROBED)
    for plane, seen in probed.seen.items():
        np.testing.assert_array_equal(seen, read_all(untouched.rows_of(plane), 64))
    np.testing.assert_array_equal(np.concatenate(probed.given, axis=1), probed.seen["clean"])
    assert _told(made) == _told(untouched)
    assert set(made.seconds) == set(untouched.seconds)


def test_a_probe_may_begin_anywhere_in_planes_that_are_sources(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    window: dict[str, Rows] = {}

    def change(_entry: Any, job: Job, run: Callable[..., Any]) -> Callable[..., Any]:
        def changed(taken: list[Stream]) -> tuple[Stream, ...]:
            window["rgb"] = job.probe("rgb")[0].read(37, 50)
            made: tuple[Stream, ...] = run(taken)
            return made

        return changed

    _change(monkeypatch, "wiener", change)
    made = start(bundle, _broken())
    made.fill()
    np.testing.assert_array_equal(window["rgb"], read_all(made.rows_of("rgb"))[:, 37:50])


def test_planes_probed_together_are_made_by_one_walk(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    together: dict[str, Rows] = {}
    mended: list[int] = []

    def counted(mosaic: Rows) -> tuple[Rows, Rows]:
        mended.append(mosaic.shape[0])
        return repair_mosaic(mosaic)

    def change(_entry: Any, job: Job, run: Callable[..., Any]) -> Callable[..., Any]:
        def changed(taken: list[Stream]) -> tuple[Stream, ...]:
            sources = job.probe("sound", "unknown")
            height = sources[0].shape[1]
            parts = [
                [source.read(top, min(top + 32, height)).copy() for source in sources]
                for top in range(0, height, 32)
            ]
            for plane, rows in zip(("sound", "unknown"), zip(*parts, strict=True), strict=True):
                together[plane] = np.concatenate(rows, axis=1)
            mended.append(0)
            made: tuple[Stream, ...] = run(taken)
            return made

        return changed

    monkeypatch.setattr("camkit.runtime.stages.repair.repair_mosaic", counted)
    _change(monkeypatch, "wiener", change)
    made = start(bundle, _broken(), threads=1)
    made.fill()
    for plane, rows in together.items():
        np.testing.assert_array_equal(rows, read_all(made.rows_of(plane)))
    assert mended.index(0) == -(-made.capture.height // 32), "each band is mended once"


def test_a_probe_sees_the_plan_of_the_capture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks that only plain cells read stay as they are, for the probe too."""
    camera = write_planned_bundle(tmp_path)
    capture = Pipeline(camera, Options()).capture_of(
        half_textured_mosaic(), iso=100, white_balance=(1.5, 1.0, 1.3), origin_px=None
    )
    probed = _Probed(monkeypatch, "raise_clipped", ["restored", "clean"], 256)
    made = start(camera, capture, quality="adaptive")
    assert made.labels is not None
    assert (made.labels == PLAIN).any()
    made.fill()
    np.testing.assert_array_equal(np.concatenate(probed.given, axis=1), probed.seen["clean"])


def test_a_probe_measures_and_tells_nothing_again(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    from camkit.runtime.job import job as job_module

    measured: list[Capture] = []
    real = job_module.measure_noise
    monkeypatch.setattr(job_module, "measure_noise", lambda c: (measured.append(c), real(c))[1])
    _Probed(monkeypatch, "color", ["clean"])
    made = start(bundle, replace(_broken(), iso=None, white_balance=None))
    made.fill()
    assert len(measured) == 1
    told = [text for text in made.warnings if "differ in brightness" not in text]
    assert len(told) == 2


def test_probes_may_follow_one_another_upwards(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stage that is probed may itself look at what lies before it."""
    first = _Probed(monkeypatch, "demosaic", ["sound"])
    second = _Probed(monkeypatch, "raise_clipped", ["restored"])
    made = start(bundle, _broken())
    picture = made.fill()
    monkeypatch.undo()
    untouched = start(bundle, _broken())
    np.testing.assert_array_equal(picture, untouched.fill())
    np.testing.assert_array_equal(first.seen["sound"], read_all(untouched.rows_of("sound")))
    np.testing.assert_array_equal(second.seen["restored"], read_all(untouched.rows_of("restored")))


@pytest.mark.parametrize("plane", ["neutral", "even", "picture"])
def test_a_stage_cannot_look_at_what_is_made_from_it(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch, plane: str
) -> None:
    _Probed(monkeypatch, "raise_clipped", [plane])
    with pytest.raises(ContractError, match=f"'{plane}' is asked for by a stage that it is made"):
        start(bundle, _broken()).fill()


def test_planes_are_not_to_be_seen_while_stages_are_made_ready(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = stage_module("illumination")
    prepare = module.prepare

    def early(entry: Any, job: Job) -> StageWork:
        job.probe("rgb")
        work: StageWork = prepare(entry, job)
        return work

    monkeypatch.setattr(module, "prepare", early)
    with pytest.raises(ContractError, match="asked for too early"):
        start(bundle, _broken())


# ------------------------------------------------------------------------------- without a bundle


def test_without_a_bundle_the_development_is_walked() -> None:
    capture = _broken()
    mosaic = capture.linear_rows(0, 64)
    apply_gains(mosaic, "RGGB", OWN_BALANCE)
    made = start(None, capture)
    np.testing.assert_array_equal(read_all(made.rows_of("rgb")), demosaic(mosaic, "RGGB", "fast"))
    assert list(made.record["stages"]) == [
        *("linearise", "white_balance", "demosaic", "raise_clipped", "color")
    ]


def test_memory_of_the_walk_is_that_of_its_running_stages(bundle: Bundle) -> None:
    job = start(bundle, _broken()).job
    walk = Walk(job)
    with_network = walk.needed_bytes()
    walk = Walk(replace(job, work=replace(job.work, method="develop", networks=False)))
    assert walk.needed_bytes() < with_network
    assert walk.needed_bytes() >= FIXED_BYTES + job.capture.resident_bytes


def test_memory_holds_what_weights_and_bundle_take_beyond_the_usual(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = start(bundle, _broken()).job

    def needed() -> int:
        return Walk(job).needed_bytes()

    small = needed()
    assert bundle.stored_bytes == bundle.path.stat().st_size
    monkeypatch.setattr(walker, "USUAL_BYTES", 0)
    assert needed() == small + bundle.stored_bytes
    monkeypatch.setattr(network_stage, "USUAL_BYTES", 0)
    (facts,) = (bundle.network_facts("restore", size) for size in job.work.sizes())
    weights = int(network_stage.WEIGHT_BYTES * facts.parameters)
    assert needed() == small + bundle.stored_bytes + weights > small + bundle.stored_bytes
