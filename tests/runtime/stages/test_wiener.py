"""The bank with the kernels, the noise and the place that belong to what it is given."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import Extent, PlanesSensor
from camkit.bundle.stages import Linearise, Mosaic, Network, Together, Wiener
from camkit.bundle.writer import write_bundle
from camkit.cfa import CfaPattern
from camkit.errors import BundleError
from camkit.noise import NoiseModel
from camkit.psf import FrozenPsf
from camkit.runtime.bank.baselines import restoration_bank
from camkit.runtime.bank.blocks import LocalPsf
from camkit.runtime.bank.kernels_by_distance import NearnessMap
from camkit.runtime.bank.psf import FieldKernels, color_kernels
from camkit.runtime.capture import Capture
from camkit.runtime.plan.decision import Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.stages import wiener
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from tests.bundle_factory import PITCH_UM
from tests.deep_bundle import write_deep_bundle
from tests.job_factory import (
    OWN_BALANCE,
    made_job,
    made_mosaic,
    made_planes,
    read_all,
    run_stage,
    start,
    stream_of,
)
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle
from tests.psf_factory import grid_psf, psnr_db, streak_kernel, texture, uniform_psf
from tests.together_factory import TOGETHER

BANK = {"block_px": 64, "overlap_px": 24, "prior_scale": 3e-4, "prior_exponent": 2.5}
METHODS = ("wiener", "rl", "admm-tv")


@pytest.mark.parametrize("method", METHODS)
def test_bands_are_those_of_the_bank_with_the_noise_behind_the_gains(
    bundle: Bundle, method: str
) -> None:
    entry = bundle.manifest.stage(Wiener)
    assert entry is not None
    light = texture(64, 96)
    made = start(bundle, made_mosaic(), method=method)
    taken = stream_of(light, gains=OWN_BALANCE), stream_of(light > 0.7, "mask")
    (sharp,) = run_stage(entry, made.job, *taken)
    sensor = bundle.manifest.sensor
    local = LocalPsf(
        kernels=color_kernels(bundle.psf, *sensor.response_arrays()),  # type: ignore[union-attr]
        window=made.job.placement.window,
    )
    noise = made.job.noise.with_gains(OWN_BALANCE)
    bank = restoration_bank(local, entry, noise, method=method)
    np.testing.assert_array_equal(
        read_all(sharp.rows(), 10), bank.restore_array(light, light > 0.7)
    )


@pytest.mark.parametrize(("cfa", "red"), [("RGGB", (0, 0)), ("GBRG", (1, 0)), (None, None)])
def test_the_bank_is_told_where_the_mosaic_of_the_capture_begins(
    bundle: Bundle, cfa: CfaPattern | None, red: tuple[int, int] | None
) -> None:
    entry = bundle.manifest.stage(Wiener)
    assert entry is not None
    near = {"together": TOGETHER, "mosaic": Mosaic(within_mm=9.0)}
    entry, light = entry.model_copy(update=near), texture(64, 96)
    capture = made_mosaic()
    if cfa is None:
        planes = np.zeros((3, *capture.samples.shape), np.uint16)
        capture = replace(capture, cfa=None, samples=planes, black_level=np.zeros(3, np.float32))
    else:
        capture = replace(capture, cfa=cfa)
    job = replace(start(bundle, made_mosaic()).job, capture=capture)
    taken = stream_of(light, gains=OWN_BALANCE), stream_of(light > 2, "mask")
    (sharp,) = run_stage(entry, job, *taken)
    local = LocalPsf(
        kernels=color_kernels(bundle.psf, *bundle.manifest.light_sensor.response_arrays()),
        window=job.placement.window,
    )
    bank = restoration_bank(local, entry, job.noise.with_gains(OWN_BALANCE), red=red)
    np.testing.assert_array_equal(read_all(sharp.rows(), 10), bank.restore_array(light))


@pytest.mark.parametrize("together", [TOGETHER, None], ids=["together", "alone"])
def test_colours_together_take_no_less_noise_than_the_sensor_has(
    bundle: Bundle, together: Together | None
) -> None:
    entry = bundle.manifest.stage(Wiener)
    assert entry is not None
    entry = entry.model_copy(update={"together": together})
    sensor, light = bundle.manifest.sensor, texture(64, 96)
    least = sensor.noise_at(sensor.noise[0].iso)  # type: ignore[union-attr]

    def sharp(noise: NoiseModel) -> FloatArray:
        job = start(bundle, made_mosaic(noise=noise)).job
        taken = stream_of(light, gains=OWN_BALANCE), stream_of(light > 2, "mask")
        (found,) = run_stage(entry, job, *taken)
        return read_all(found.rows(), 10)

    averaged, louder = sharp(least.raised((1 / 256,) * 3)), sharp(least.raised((4.0,) * 3))
    usual = sharp(least)
    assert np.array_equal(averaged, usual) == (together is not None)
    assert not np.array_equal(louder, usual)


@pytest.mark.parametrize(
    ("depth_m", "kernels"), [(None, "mean of 0.5 m, 1 m, 2 m"), (0.7, "0.7 m")]
)
def test_the_plan_says_whose_kernels_the_bank_has(
    depth_m: float | None, kernels: str, tmp_path: Path
) -> None:
    deep = write_deep_bundle(tmp_path)
    capture = made_mosaic(origin_px=(0, 0), sensor_size_px=(320, 240))
    assert start(deep, capture, depth_m=depth_m).record["depth"] == kernels


@pytest.fixture
def finding(tmp_path: Path) -> Bundle:
    """A bundle whose bank finds the distance."""
    deep = write_deep_bundle(tmp_path)
    entry = deep.manifest.stage(Wiener)
    assert entry is not None
    finds = entry.model_copy(update={"depth": "estimated"})
    stages = tuple(finds if stage == entry else stage for stage in deep.manifest.stages)
    return replace(deep, manifest=deep.manifest.model_copy(update={"stages": stages}))


def _seen(deep: Bundle) -> Capture:
    light = np.tile(texture(120, 160)[:1], (3, 2, 2))
    options = SimulationOptions(depth_mm=500.0, seed=1)
    seen = simulate(light, deep.manifest.sensor, deep.psf, options)  # type: ignore[arg-type]
    return made_mosaic(samples=seen.samples, origin_px=(0, 0), sensor_size_px=(320, 240))


def test_a_bank_that_finds_the_distance_has_its_kernels(
    finding: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = NearnessMap(values=np.full((1, 1), 1 / 500), first_px=(0, 0), step_px=(1, 1))
    monkeypatch.setattr(wiener, "find_nearness", lambda *_, **__: found)
    capture = _seen(finding)
    made = start(finding, capture, method="wiener")
    told = start(finding, capture, method="wiener", depth_m=0.5)
    np.testing.assert_array_equal(made.fill(), told.fill())
    assert made.record["depth"] == "estimated"
    assert made.sections["distance"]["median_m"] == pytest.approx(0.5)
    assert made.warnings[-1] == "object distance estimated from the capture: 0.5 m"
    assert "distance" not in told.sections


def test_a_bank_that_finds_no_distance_has_mean_kernels(
    finding: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = NearnessMap(values=np.full((1, 1), np.nan), first_px=(0, 0), step_px=(1, 1))
    monkeypatch.setattr(wiener, "find_nearness", lambda *_, **__: nothing)
    stages = tuple(
        stage.model_copy(update={"depth": "mean"}) if isinstance(stage, Wiener) else stage
        for stage in finding.manifest.stages
    )
    usual = replace(finding, manifest=finding.manifest.model_copy(update={"stages": stages}))
    capture = _seen(finding)
    untold, mean = (start(bundle, capture, method="wiener") for bundle in (finding, usual))
    np.testing.assert_allclose(untold.fill(), mean.fill(), rtol=1e-3, atol=1e-4)
    assert untold.sections["distance"] == {}
    assert "the object distance cannot be estimated" in untold.warnings[-1]


def test_the_distance_of_a_capture_is_found_and_said(finding: Bundle) -> None:
    made = start(finding, _seen(finding), method="wiener")
    assert not made.warnings
    made.fill()
    assert "distance" in made.sections
    assert "distance" in made.warnings[-1]


def test_kernels_of_all_distances_are_made_for_the_first_capture_alone(
    finding: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float | None] = []

    def counted(*arguments: Any, depth_mm: float | None, **options: Any) -> FieldKernels:
        asked.append(depth_mm)
        return color_kernels(*arguments, depth_mm=depth_mm, **options)

    monkeypatch.setattr(wiener, "color_kernels", counted)
    pictures = [start(finding, _seen(finding), method="wiener").fill() for _ in range(2)]
    assert asked == [500.0, 1000.0, 2000.0]
    np.testing.assert_array_equal(*pictures)


def test_the_plan_counts_the_search_and_the_kernels_of_all_distances(finding: Bundle) -> None:
    """A small capture pays for whole blocks, the first one for the kernels too."""
    speed = Speed(block_s=0.01, clipped_block_s=0.1, rest_s_per_mp=0.1, threads=1)
    subject = start(finding, _seen(finding), method="wiener").job.subject
    entry = finding.manifest.stage(Wiener)
    assert subject is not None
    assert entry is not None
    told = replace(subject, options=replace(subject.options, depth_m=0.5))
    wiener._kernels_by_distance.cache_clear()
    first = wiener.seconds(entry, subject, Work(), speed)
    start(finding, _seen(finding), method="wiener").fill()
    second = wiener.seconds(entry, subject, Work(), speed)
    samples = finding.psf.kernels.size
    assert first - second == pytest.approx(wiener.KERNELS_SHARE * samples / 1e6 * 0.1)
    least = wiener.seconds(entry, told, Work(), speed) + wiener.SEARCH_BLOCKS * speed.block_s
    assert second > least


def test_the_plan_counts_blocks_near_the_axis_as_those_of_the_mosaic(bundle: Bundle) -> None:
    speed = Speed(block_s=0.01, clipped_block_s=0.1, rest_s_per_mp=0.1, threads=1)
    subject = start(bundle, made_mosaic(), method="wiener").job.subject
    entry = bundle.manifest.stage(Wiener)
    assert subject is not None
    assert entry is not None

    def seconds(within_mm: float, side_px: int = 1) -> float:
        near = {"together": TOGETHER, "mosaic": Mosaic(within_mm=within_mm)}
        seen = replace(subject, side_px=side_px)
        return wiener.seconds(entry.model_copy(update=near), seen, Work(), speed)

    plain = wiener.seconds(entry, subject, Work(), speed)
    assert seconds(1e3) == pytest.approx(wiener.MOSAIC_BLOCKS * plain)
    assert seconds(1e-6) == plain
    assert seconds(1e3, side_px=2) == plain


def test_a_bank_that_finds_the_distance_needs_format_2_8(finding: Bundle, tmp_path: Path) -> None:
    older = finding.manifest.model_copy(update={"format_version": "2.7"})
    members = {name: finding.member(name) for name in finding.names}
    with pytest.raises(BundleError, match=r"finds the distance of the scene, which format 2.8"):
        write_bundle(tmp_path / "older.camkit", older, members)


def test_the_plan_of_one_depth_does_not_speak_of_it(bundle: Bundle) -> None:
    assert "depth" not in start(bundle, made_mosaic()).record


# ------------------------------------------------------------------------------- streaks


def _camera(folder: Path, psf: FrozenPsf, channels: tuple[str, ...] = ("Y",)) -> Bundle:
    extent = Extent(width_px=128, height_px=96, pixel_pitch_um=psf.pixel_pitch_um)
    stages = (Linearise(), Wiener(takes=("light", "clipped"), **BANK))  # type: ignore[arg-type]
    sensor = planes_sensor(channels, extent=extent, full_well_e=1e6)
    return write_planes_bundle(folder, stages, sensor=sensor, psf=psf)


def _photographed(camera: Bundle, scene: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give what the twin records, and the sharp truth."""
    sensor = camera.manifest.sensor
    assert isinstance(sensor, PlanesSensor)
    found = simulate(scene, sensor, camera.psf, SimulationOptions(iso=100, noise=False))
    return found.samples, found.clean


def _restored(camera: Bundle, samples: FloatArray) -> FloatArray:
    black = np.full(len(samples), 64, np.float32)
    capture = made_planes(samples=samples, black_level=black, white_level=1023.0)
    return start(camera, capture).fill()


def _streaks(turn_deg: float) -> dict[str, FrozenPsf]:
    """Give uniform and grid PSFs of one-sided streaks, at the pitch of the sensor."""
    at_mm = np.array([-0.2, 0.2])
    turned = [streak_kernel(turn_deg + step) for step in (0, 25, 50, 75)]
    return {
        "uniform": uniform_psf(streak_kernel(turn_deg)),
        "grid": grid_psf(np.stack(turned).reshape(2, 2, 21, 21), at_mm, at_mm),
    }


def _mirrored(psf: FrozenPsf) -> FrozenPsf:
    """Give streaks to the other side."""
    return replace(psf, kernels=np.ascontiguousarray(psf.kernels[..., ::-1, ::-1]))


@pytest.mark.parametrize("turn_deg", [0.0, 30.0, 200.0])
@pytest.mark.parametrize("symmetry", ["uniform", "grid"])
def test_what_the_twin_blurs_by_streaks_the_bank_makes_sharp(
    tmp_path: Path, symmetry: str, turn_deg: float
) -> None:
    """Through simulation and pipeline: with the mirror image of the kernel it stays blurred."""
    psf = _streaks(turn_deg)[symmetry]
    camera = _camera(tmp_path, psf)
    mirrored = _camera(tmp_path, _mirrored(psf))
    samples, clean = _photographed(camera, texture(96, 128, seed=5))
    blurred_db = psnr_db((samples - 64.0) / (1023 - 64), clean, 16)
    right_db, wrong_db = (
        psnr_db(_restored(bundle, samples), clean, 16) for bundle in (camera, mirrored)
    )
    assert right_db > blurred_db + 2
    assert right_db > wrong_db + 5


def test_every_channel_has_the_kernel_of_its_own_response(tmp_path: Path) -> None:
    """Five channels, each restored as if it were alone."""
    turned = np.stack([streak_kernel(turn) for turn in (0.0, 120.0)])
    psf = replace(
        uniform_psf(turned[0], (0.45, 0.65), channels=5),
        kernels=np.ascontiguousarray(turned[None, None]),
    )
    camera = _camera(tmp_path, psf, tuple("abcde"))
    samples, _ = _photographed(camera, texture(96, 128, seed=2))
    together = _restored(camera, samples)
    kernels = color_kernels(psf, *camera.manifest.sensor.response_arrays()).kernels[0]  # type: ignore[union-attr]
    for channel, kernel in enumerate(kernels):
        one = _camera(tmp_path, uniform_psf(kernel))
        alone = _restored(one, samples[channel : channel + 1])
        np.testing.assert_allclose(together[channel], alone[0], atol=1e-5)


def test_the_optical_centre_moves_the_kernels(tmp_path: Path) -> None:
    """Kernels of a grid belong to places from the axis: a moved axis moves them with it."""
    left, right = streak_kernel(90.0), streak_kernel(270.0)
    at_mm = np.array([-0.005, 0.005])
    psf = grid_psf(np.stack([left, right, left, right]).reshape(2, 2, 21, 21), at_mm, at_mm)
    extent = {"width_px": 128, "height_px": 96, "pixel_pitch_um": psf.pixel_pitch_um}
    samples = (64 + 900 * texture(96, 128, seed=4)[:1]).astype(np.uint16)
    made = {}
    for name, camera in {
        "axis": psf,
        "left": uniform_psf(left),
        "right": uniform_psf(right),
    }.items():
        for centre in (None, (-500.0, 47.5), (600.0, 47.5)):
            sensor = planes_sensor(
                extent=Extent.model_validate(extent | {"optical_centre_px": centre})
            )
            stages = (Linearise(), Wiener(takes=("light", "clipped"), **BANK))  # type: ignore[arg-type]
            made[name, centre] = _restored(
                write_planes_bundle(tmp_path, stages, sensor=sensor, psf=camera), samples
            )
    np.testing.assert_array_equal(made["left", None], made["left", (600.0, 47.5)])
    np.testing.assert_array_equal(made["axis", (600.0, 47.5)], made["left", None])
    np.testing.assert_array_equal(made["axis", (-500.0, 47.5)], made["right", None])
    assert (made["axis", None] != made["left", None]).any()


# ------------------------------------------------------------------------------- other grids


def test_a_bank_behind_a_network_that_doubles_the_size_works_on_the_finer_grid(
    tmp_path: Path,
) -> None:
    data = finer_network(1, 1, scale=2)
    ports = [Port(name="a", channels=1)], [Port(name="b", channels=1, scale=2)]
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("large",), transform="none"),
        Wiener(takes=("large",), **BANK),  # type: ignore[arg-type]
    )
    at_mm = np.array([-0.15, 0.15])
    kernels = np.stack([streak_kernel(turn) for turn in (0, 90, 180, 270)]).reshape(2, 2, 21, 21)
    psf = replace(grid_psf(kernels, at_mm, at_mm), pixel_pitch_um=PITCH_UM / 2)
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(),
        psf=psf,
        networks={"restore": (facts_of(data, *ports), data)},
    )
    light = np.random.default_rng(0).random((1, 64, 96), dtype=np.float32)
    made = start(camera, made_planes(samples=light))
    large = read_all(made.rows_of("large"))
    entry = camera.manifest.stage(Wiener)
    assert entry is not None
    local = LocalPsf(
        kernels=color_kernels(psf, *camera.manifest.sensor.response_arrays()),  # type: ignore[union-attr]
        window=made.job.window_of(camera.manifest.planes["large"]),
    )
    wanted = restoration_bank(local, entry, made.job.noise).restore_array(large)
    np.testing.assert_array_equal(made.fill(), wanted)


def test_an_assumed_scale_scales_the_kernels(bundle: Bundle) -> None:
    half = made_mosaic(samples=np.full((32, 48), 500, np.uint16))
    job = made_job(half, bundle, assume="scale")
    assert job.placement.kernel_scale == 0.5
    made = start(bundle, half, assume="scale", method="wiener", color="camera", vignetting=False)
    np.testing.assert_allclose(made.fill()[1, 8:-8, 8:-8], (500 - 64) / (1023 - 64), rtol=0.01)
