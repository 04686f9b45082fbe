"""What the bundle says is what runs: the stages it lists, in that order, and nothing else."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camkit.arrays import FloatArray
from camkit.bundle.chain import CAPTURE, capture_plane
from camkit.bundle.frozen_optics import FrozenOptics, psf_of_streaks
from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.optics import PSF
from camkit.bundle.plane import Plane
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.sensor import RGB
from camkit.bundle.stages import (
    Color,
    Deglare,
    Dehaze,
    Demosaic,
    Highlights,
    Illumination,
    JoinError,
    Linearise,
    Network,
    Parts,
    RaiseClipped,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
    Wiener,
)
from camkit.bundle.writer import write_bundle
from camkit.colorimetry import rec709_from_camera
from camkit.runtime.bank.baselines import restoration_bank
from camkit.runtime.bank.blocks import LocalPsf
from camkit.runtime.bank.cell_means import cell_means
from camkit.runtime.bank.haze import CoarseBand, hazy_kernels, solve_coarse
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.capture import Capture
from camkit.runtime.color import color_stage, recover_highlights, to_output
from camkit.runtime.geometry.illumination import divide_illumination
from camkit.runtime.geometry.placement import place
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.kinds.hdr.deglare.removal import GlareSettings, find_glare
from camkit.runtime.kinds.hdr.streaks.cells import cells_of, sample_sites
from camkit.runtime.kinds.hdr.streaks.kernels import streak_kernels
from camkit.runtime.kinds.hdr.streaks.painting import Painter
from camkit.runtime.kinds.hdr.streaks.recovery import recover
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.rows import ArrayRows
from camkit.runtime.signal.demosaic import apply_gains, demosaic
from camkit.runtime.signal.noise import repair_mosaic
from camkit.runtime.signal.stabilise import stabilise, unstabilise
from camkit.runtime.stage_finder import stage_module
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_psf, tiny_stages
from tests.haze_bundle import hazy_optics, hazy_stages
from tests.haze_factory import CELL_PX
from tests.streak_factory import small_streaks

GAINS = (1.7, 1.0, 1.4)
ISO = 100.0
BANK = {"block_px": 32, "overlap_px": 8, "prior_scale": 1e-3, "prior_exponent": 2.0}
POOL: tuple[Callable[..., Stage], ...] = (
    Repair,
    WhiteBalance,
    Demosaic,
    lambda **wiring: Wiener(**BANK, **wiring),
    lambda **wiring: Dehaze(shrink=CELL_PX, terms=8, rounds=2, **wiring),
    Highlights,
    Deglare,
    Network,
    RaiseClipped,
    Illumination,
    Undistort,
)


def _tiny(optics: FrozenOptics) -> Manifest:
    """Give a manifest of all stages before some optics."""
    stages = hazy_stages(network=True) if optics.haze is not None else tiny_stages()
    return tiny_manifest(optics=optics.entry(np.inf), stages=stages)


class _Drawn:
    """A list of stages that joins, grown stage by stage."""

    def __init__(self, optics: FrozenOptics) -> None:
        manifest = _tiny(optics)
        self.parts: Parts = manifest.parts
        self.stages: list[Stage] = []
        self.planes: dict[str, Plane] = {CAPTURE: capture_plane(manifest.sensor)}
        self.main, self.mask, self.before = CAPTURE, "", ""
        self.add(Linearise)

    def tried(self, make: Callable[..., Stage]) -> Stage | None:
        """Give the stage wired to what there is, None if it does not join."""
        kind = make(takes=("x",), gives=("y",))
        for once in (Deglare, Dehaze):
            if isinstance(kind, once) and any(isinstance(s, once) for s in self.stages):
                return None  # a runtime takes one: each reads twice what lies before it
        hazy = self.parts.optics is not None and self.parts.optics.type == "hazy_psf"
        if (
            isinstance(kind, Wiener)
            and hazy
            and not any(isinstance(s, Dehaze) for s in self.stages)
        ):
            return None  # a bundle is refused whose bank leaves the haze
        number = len(self.stages)
        takes = [self.main]
        gives = [f"p{number}"]
        if isinstance(kind, Network):
            takes = [self.before or self.main, self.main]
        elif isinstance(kind, Linearise):
            gives.append(f"m{number}")
        elif isinstance(kind, Repair | Wiener | Dehaze) and self.mask:
            takes.append(self.mask)
            if isinstance(kind, Repair):
                gives.append(f"m{number}")
        stage = make(takes=tuple(takes), gives=tuple(gives))
        try:
            stage.join([self.planes[name] for name in takes], self.parts)
        except JoinError:
            return None
        return stage

    def add(self, make: Callable[..., Stage]) -> bool:
        stage = self.tried(make)
        if stage is None:
            return False
        made = stage.join([self.planes[name] for name in stage.takes], self.parts)
        self.planes |= dict(zip(stage.gives, made, strict=True))
        if isinstance(stage, Wiener):
            self.before = self.main
        elif self.before and not isinstance(stage, Network):
            self.before = ""
        if len(stage.gives) > 1:
            self.mask = stage.gives[1]
        if made[0].channels == RGB and isinstance(stage, Demosaic):
            self.before = ""
        self.main = stage.gives[0]
        self.stages.append(stage)
        return True


@st.composite
def lists(draw: st.DrawFn, optics: FrozenOptics) -> tuple[Stage, ...]:
    drawn = _Drawn(optics)
    for _ in range(draw(st.integers(0, 9))):
        can = [make for make in POOL if drawn.tried(make) is not None]
        if not can:
            break
        drawn.add(draw(st.sampled_from(can)))
    if drawn.planes[drawn.main].channels != RGB:
        drawn.add(Demosaic)
    drawn.add(Color)
    return tuple(drawn.stages)


def _bundle(stages: tuple[Stage, ...], optics: FrozenOptics, folder: Path) -> Bundle:
    tiny, members = _tiny(optics), tiny_members()
    del members[PSF]
    members |= optics.members
    has_network = any(isinstance(stage, Network) for stage in stages)
    networks = tiny.networks if has_network else {}
    if not has_network:
        members.pop("network_m.onnx")
    members.pop("golden.safetensors")
    parts = Parts(sensor=tiny.sensor, optics=tiny.optics, networks=networks)
    manifest = Manifest.model_validate(
        {
            **dict(tiny),
            "format_version": "2.7",
            "stages": stages,
            "planes": planes_of(stages, parts),
            "products": {"image": stages[-1].gives[0]},
            "networks": networks,
            "golden": (),
        }
    )
    path = folder / "drawn.camkit"
    write_bundle(path, manifest, members)
    return open_bundle(path)


def _slowly(  # noqa: C901, PLR0912 - one arm for each stage
    stages: tuple[Stage, ...], bundle: Bundle, capture: Capture
) -> FloatArray:
    """Apply the stages to whole pictures, one after the other, in plain sight."""
    sensor, psf = bundle.manifest.sensor, bundle.psf
    assert sensor.type == "bayer"
    window = place(capture, sensor.extent, None).window
    matrix = np.array(sensor.color_matrix)
    noise = sensor.noise_at(ISO)
    held: dict[str, np.ndarray] = {}
    gains: dict[str, tuple[float, float, float]] = {CAPTURE: (1.0, 1.0, 1.0)}
    rises: dict[str, tuple[float, ...]] = {}
    looked_at: list[np.ndarray] = []  # the samples before any gain, mended where they are
    for stage in stages:
        taken = [held[name] for name in stage.takes if name != CAPTURE]
        gain = gains[stage.takes[-1] if isinstance(stage, Network) else stage.takes[0]]
        match stage:
            case Linearise():
                made = [capture.linear_rows(0, capture.height)]
                made.append(capture.saturated_rows(0, capture.height))
            case Repair():
                sound, broken = repair_mosaic(taken[0]) if taken[0].ndim == 2 else (taken[0], None)
                assert broken is not None
                made = [sound, *(mask & ~broken for mask in taken[1:])]
            case WhiteBalance():
                planes = taken[0].copy()
                if planes.ndim == 2:
                    apply_gains(planes, sensor.cfa, GAINS)
                else:
                    planes *= np.array(GAINS, dtype=np.float32)[:, None, None]
                made, gain = [planes], GAINS
            case Demosaic():
                made = [demosaic(taken[0], sensor.cfa, stage.method)]
            case Wiener():
                hazy = any(isinstance(before, Dehaze) for before in stages)
                cores = bundle.haze.core_share if hazy else None
                local = LocalPsf(
                    kernels=color_kernels(psf, *sensor.response_arrays(), share=cores),
                    window=window,
                )
                raised = noise.with_gains(gain)
                if stage.takes[0] in rises:
                    raised = raised.raised(rises[stage.takes[0]])
                bank = restoration_bank(local, stage, raised)
                made = [bank.restore_array(taken[0], *taken[1:])]
            case Network():
                both = [
                    stabilise(planes, noise.with_gains(gains[name]), scale=stage.scale)
                    for planes, name in zip(taken, stage.takes, strict=True)
                ]
                engine = NetworkEngine(bundle.network_bytes("restore", "M"), threads=1)
                stable = engine.run(np.concatenate(both)[None])[0]
                made = [unstabilise(stable, noise.with_gains(gain), scale=stage.scale)]
            case Dehaze():
                summed = _summed(stage, stages)
                mask = held[stage.takes[1]] if len(stage.takes) > 1 else None
                band = _coarse(held[summed], mask, bundle, window, stage)
                made = [taken[0].copy()]
                band.clear(made[0], 0)
                rises |= dict.fromkeys(stage.gives, band.noise_rise)
            case Highlights():
                made = [_lit(taken[0], gain, looked_at, bundle)]
            case Deglare():
                made = [_cleared(taken[0], gain, stage)]
            case RaiseClipped():
                made = [recover_highlights(taken[0], gain)]
            case Illumination():
                made = [divide_illumination(taken[0], 0, psf, window)]
            case Undistort():
                bands = undistort_bands(ArrayRows(taken[0]), psf.distortion, window)
                made = [np.concatenate(list(bands), axis=1)]
            case Color():
                made = [to_output(taken[0], color_stage(matrix))]
        if len(made) == 2 and gain == gains[CAPTURE]:
            looked_at = made
        if stage.takes[0] in rises and not isinstance(stage, Wiener | Network):
            rises |= dict.fromkeys(stage.gives, rises[stage.takes[0]])
        held |= dict(zip(stage.gives, made, strict=True))
        gains |= dict.fromkeys(stage.gives, gain)
    return held[stages[-1].gives[0]]


def _summed(stage: Dehaze, stages: tuple[Stage, ...]) -> str:
    """Name the plane that cells are summed of: the mosaic, where it was demosaicked alone."""
    (giver,) = [before for before in stages if stage.takes[0] in before.gives]
    return giver.takes[0] if isinstance(giver, Demosaic) else stage.takes[0]


def _coarse(
    seen: np.ndarray,
    mask: np.ndarray | None,
    bundle: Bundle,
    window: SensorWindow,
    stage: Dehaze,
) -> CoarseBand:
    """Find the scene in cells of a whole picture."""
    sensor = bundle.manifest.sensor
    assert sensor.type == "bayer"
    rows, over = (
        None if planes is None else ArrayRows(planes if planes.ndim == 3 else planes[None])
        for planes in (seen, mask)
    )
    assert rows is not None
    cfa = sensor.cfa if seen.ndim == 2 else None
    cells, clipped = cell_means(rows, over, cfa, stage.shrink)
    kernels = hazy_kernels(bundle.psf, bundle.haze, *sensor.response_arrays())
    chosen = {"terms": stage.terms, "rounds": stage.rounds}
    return solve_coarse(cells, clipped, kernels, window, **chosen)


def _lit(
    planes: FloatArray, gain: tuple[float, float, float], seen: list[np.ndarray], bundle: Bundle
) -> FloatArray:
    """Put lights into a whole picture, found in what the sensor saw and where it clipped."""
    sensor = bundle.manifest.sensor
    assert sensor.type == "bayer"
    sites = sample_sites(sensor.cfa)
    kernels = streak_kernels(
        color_kernels(bundle.psf, *sensor.response_arrays()).at(0, 0),
        sites,
        bundle.streaks.reach_px,
    )
    light, clipped = (plane[None] for plane in seen)
    lit = planes.copy()
    to_rec709 = rec709_from_camera(np.array(sensor.color_matrix))
    Painter(recover(cells_of(light, clipped, sites), kernels), to_rec709).paint(lit, 0, gain)
    return lit


def _cleared(planes: FloatArray, gain: tuple[float, float, float], stage: Deglare) -> FloatArray:
    """Take the streaks out of a whole picture."""
    seen = planes / np.array(gain, np.float32)[:, None, None]
    least, most = math.radians(stage.least_angle_deg), math.radians(stage.most_angle_deg)
    settings = GlareSettings(least_rad=least, most_rad=most, reach=stage.reach, level=stage.level)
    glare = find_glare(lambda: lambda a, b: seen[:, a:b], *seen.shape[1:], settings)
    cleared = planes.copy()
    glare.paint(cleared, 0, gain)
    return cleared


OPTICS = {
    "kernels": FrozenOptics(psf=tiny_psf()),
    "haze": hazy_optics(),
    "streaks": FrozenOptics(psf=psf_of_streaks(small_streaks(), 3), streaks=small_streaks()),
}


@pytest.mark.parametrize("optics", OPTICS.values(), ids=OPTICS.keys())
@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data(), seed=st.integers(0, 99))
def test_the_listed_stages_run_in_their_order_and_nothing_else_does(
    optics: FrozenOptics,
    data: st.DataObject,
    seed: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stages = data.draw(lists(optics))
    bundle = _bundle(stages, optics, tmp_path)
    rng = np.random.default_rng(seed)
    mosaic = rng.integers(64, 1024, (64, 96), dtype=np.uint16)
    mosaic[20:24, 30:34] = 1023
    pipeline = Pipeline(bundle, Options(threads=2))
    ran: list[str] = []
    with monkeypatch.context() as patch:
        for name in {stage.type for stage in stages}:
            patch.setattr(stage_module(name), "prepare", _watched(stage_module(name), ran))
        work = pipeline.start(
            pipeline.capture_of(mosaic, iso=ISO, white_balance=GAINS, origin_px=None)
        )
        got = work.fill()
    # optics of streaks distort nothing, and a warp that moves nothing is left out
    idle = Undistort if optics.streaks is not None else ()
    wanted = [stage.type for stage in stages if not isinstance(stage, idle)]
    assert ran[: len(wanted)] == wanted
    # haze, highlights and deglare look at what lies before them
    looked_at: set[str] = set()
    for number, stage in enumerate(stages):
        if isinstance(stage, Highlights | Deglare | Dehaze):
            looked_at |= {before.type for before in stages[:number]}
    assert set(ran[len(wanted) :]) <= looked_at
    expected = _slowly(stages, bundle, work.capture)
    np.testing.assert_array_equal(got, expected)


def _watched(module: object, ran: list[str]) -> Callable[..., object]:
    from dataclasses import replace

    prepare = module.prepare  # type: ignore[attr-defined]

    def watched(entry: Stage, job: object) -> object:
        work = prepare(entry, job)

        def run(taken: object) -> object:
            ran.append(entry.type)
            return work.run(taken)

        return replace(work, run=run)

    return watched
