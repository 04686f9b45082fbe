"""The haze found before the first row: the same bits by any bands; left out, or refused."""

import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Dehaze, Wiener
from camkit.bundle.writer import write_bundle
from camkit.errors import BundleError, ContractError
from camkit.runtime.bank.cell_means import cell_means
from camkit.runtime.bank.haze import few_of
from camkit.runtime.cancel import Cancelled
from camkit.runtime.capture import Capture
from camkit.runtime.files.doubts import NOTHING_DARK
from camkit.runtime.job import coarse_cells
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import PLAIN, Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.stages import haze
from tests.bundle_factory import tiny_sensor, write_tiny_bundle
from tests.haze_bundle import hazy_manifest, hazy_stages, write_hazy_bundle
from tests.haze_factory import tiny_haze
from tests.job_factory import made_mosaic, made_planes, read_all, start
from tests.plan_factory import half_textured_mosaic, write_planned_bundle

FLOAT32 = 1e-5


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_hazy_bundle(tmp_path_factory.mktemp("haze"))


def _capture(height: int = 64, width: int = 96, seed: int = 3) -> Capture:
    rng = np.random.default_rng(seed)
    samples = rng.integers(100, 1024, (height, width), dtype=np.uint16)
    samples[20:24, 30:34] = 1023
    return made_mosaic(samples=samples)


def _filled(bundle: Bundle, capture: Capture, **choices: Any) -> FloatArray:
    return start(bundle, capture, **choices).fill()


@pytest.mark.parametrize("choices", [{"threads": 2}, {"max_mem_bytes": 700_000_000}])
def test_threads_and_memory_do_not_change_a_bit(bundle: Bundle, choices: dict[str, Any]) -> None:
    usual = _filled(bundle, _capture(), threads=1)
    np.testing.assert_array_equal(_filled(bundle, _capture(), **choices), usual)
    assert np.isfinite(usual).all()


def test_the_mosaic_is_summed_not_what_was_made_of_it(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    shapes = []

    def watched(samples: Any, *rest: Any) -> Any:
        shapes.append(samples.shape)
        return cell_means(samples, *rest)

    monkeypatch.setattr(coarse_cells, "cell_means", watched)
    _filled(bundle, _capture())
    _filled(bundle, made_planes())
    assert shapes == [(1, 64, 96), (3, 64, 96)]


def test_it_is_found_once_though_bank_and_rows_ask(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    found = haze.coarse_band

    def watched(*args: Any) -> Any:
        calls.append(args)
        return found(*args)

    monkeypatch.setattr(haze, "coarse_band", watched)
    _filled(bundle, _capture())
    assert len(calls) == 1


def test_what_follows_from_the_optics_is_computed_for_the_first_capture_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    weighed = haze.hazy_kernels

    def watched(*args: Any, **options: Any) -> Any:
        calls.append(args)
        return weighed(*args, **options)

    monkeypatch.setattr(haze, "hazy_kernels", watched)
    own = write_hazy_bundle(tmp_path)
    first = _filled(own, _capture())
    found = few_of.cache_info().misses
    np.testing.assert_array_equal(_filled(own, _capture()), first)
    assert len(calls) == 1
    assert few_of.cache_info().misses == found


def test_a_crop_knows_its_place(bundle: Bundle) -> None:
    samples = _capture().samples[:32, :48]
    pipeline = Pipeline(bundle, Options(threads=1))
    made = [
        pipeline.start(
            pipeline.capture_of(samples, iso=100, white_balance=None, origin_px=origin)
        ).fill()
        for origin in ((0, 0), (48, 32))
    ]
    assert np.abs(made[0] - made[1]).max() > FLOAT32


def test_a_larger_picture_of_the_same_frame_has_wider_kernels(bundle: Bundle) -> None:
    samples = np.random.default_rng(5).uniform(0, 1, (3, 96, 144)).astype(np.float32)
    picture = _filled(bundle, made_planes(samples=samples), assume="scale")
    assert picture.shape == (3, 96, 144)
    assert np.isfinite(picture).all()


def test_its_seconds_are_its_own(bundle: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = []
    found = haze.solve_coarse

    def watched(*args: Any, **options: Any) -> Any:
        inside.append(work.job.log.clock.running)
        return found(*args, **options)

    monkeypatch.setattr(haze, "solve_coarse", watched)
    work = start(bundle, _capture())
    work.fill()
    assert inside == ["haze"]


def test_methods_end_before_the_haze_behind_it_or_behind_the_bank(bundle: Bundle) -> None:
    ways = {}
    for method in ("develop", "haze", "wiener", "rl"):
        work = start(bundle, _capture(), method=method)
        picture = work.fill()
        assert np.isfinite(picture).all()
        ways[method] = picture
    assert np.abs(ways["develop"] - ways["haze"]).max() > FLOAT32
    assert np.abs(ways["haze"] - ways["wiener"]).max() > FLOAT32


def test_an_even_capture_stays_even(bundle: Bundle) -> None:
    flat = made_planes(samples=np.full((3, 64, 96), 0.3, np.float32))
    hazed = _filled(bundle, flat, method="haze")
    np.testing.assert_allclose(hazed, _filled(bundle, flat, method="develop"), atol=5e-3)


def test_the_plan_leaves_plain_cells_at_the_coarse_picture(tmp_path: Path) -> None:
    """Cleared of haze as every cell is, and filtered by no block."""
    planned = write_planned_bundle(tmp_path)
    optics = FrozenOptics(psf=planned.psf, haze=tiny_haze(planned.psf))
    stages = tuple(
        stage.model_copy(update={"block_px": 128, "overlap_px": 32})
        if isinstance(stage, Wiener)
        else stage
        for stage in hazy_stages(network=True)
    )
    stated = planned.manifest
    manifest = hazy_manifest(
        sensor=stated.sensor,
        stages=stages,
        networks=stated.networks,
        plan=stated.plan,
        optics=optics.entry(np.inf),
    )
    members = {name: planned.member(name) for name in planned.names} | optics.members
    write_bundle(tmp_path / "hazy.camkit", manifest, members)
    camera = open_bundle(tmp_path / "hazy.camkit")
    capture = Pipeline(camera, Options()).capture_of(
        half_textured_mosaic(), iso=100, white_balance=(1.5, 1.0, 1.3), origin_px=None
    )
    made = start(camera, capture, quality="adaptive")
    assert made.labels is not None
    assert (made.labels[:, 0] == PLAIN).all()
    planes = {stage.type: stage.gives[0] for stage in stages}
    clear, filtered, hazy = (
        read_all(made.rows_of(planes[name]))[:, :, :128] for name in ("haze", "wiener", "demosaic")
    )
    np.testing.assert_allclose(filtered, clear, rtol=0, atol=FLOAT32)
    assert np.abs(clear - hazy).max() > 0.01


def test_the_noise_of_the_bank_is_raised(bundle: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    from camkit.runtime.stages import wiener

    told = []
    bank = wiener.restoration_bank

    def watched(psf: Any, settings: Any, noise: Any, **rest: Any) -> Any:
        told.append(noise)
        return bank(psf, settings, noise, **rest)

    monkeypatch.setattr(wiener, "restoration_bank", watched)
    work = start(bundle, _capture())
    work.fill()
    (noise,) = told
    plain = bundle.manifest.sensor.noise_at(100.0)  # type: ignore[union-attr]
    gains = (2.0, 1.0, 1.5)
    rises = [got / (known * g) for got, known, g in zip(noise.shot, plain.shot, gains, strict=True)]
    assert all(2 < rise < 9 for rise in rises)


def test_it_may_be_cancelled(bundle: Bundle) -> None:
    pipeline = Pipeline(bundle, Options(threads=1))
    work = pipeline.start(_capture(), cancel=lambda: True)
    with pytest.raises(Cancelled):
        work.fill()


@pytest.mark.slow
def test_a_wish_to_stop_is_asked_about_once_a_second_over_a_whole_frame() -> None:
    pipeline = camkit.load("thin-plate", method="haze", threads=1)
    samples = np.random.default_rng(0).integers(300, 3000, (4000, 6000), np.uint16)
    asked: list[float] = []

    def wish() -> bool:
        asked.append(time.process_time())  # of this process: other programs do not count
        return False

    wish()
    pipeline.process_array(samples, iso=100, cancel=wish)
    gap_s = max(after - before for before, after in pairwise(asked))
    print(f"{len(asked)} asks in {asked[-1] - asked[0]:.1f} s, at most {gap_s:.2f} s apart")
    assert gap_s < 1.0


def test_too_little_memory_is_said_before_any_row(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(haze, "solving_bytes", lambda *_: 10**9)
    with pytest.raises(ContractError, match="raise max_mem_bytes"):
        start(bundle, _capture(), max_mem_bytes=700_000_000).fill()


def _manifest(**changes: Any) -> Manifest:
    return hazy_manifest(stages=hazy_stages(**changes))


def test_what_takes_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    fine = Dehaze(shrink=4, terms=128, rounds=16)
    haze.check(fine, _manifest(), 0)
    monkeypatch.setenv("CAMKIT_MAX_BANK_WORK", "400")
    haze.check(Dehaze(shrink=8), _manifest(), 0)
    with pytest.raises(BundleError, match="the haze of tiny"):
        haze.check(fine, _manifest(), 0)


def test_more_cells_than_a_golden_case_holds_are_refused() -> None:
    wide = hazy_manifest(sensor=tiny_sensor(4200, 64))
    with pytest.raises(BundleError, match="more than 1024 cells of 4 px along a side"):
        haze.check(Dehaze(shrink=4), wide, 0)
    haze.check(Dehaze(shrink=8), wide, 0)


def test_a_second_one_is_refused() -> None:
    stages = list(hazy_stages())
    at = next(n for n, stage in enumerate(stages) if isinstance(stage, Dehaze))
    again = stages[at].model_copy(update={"takes": ("clear", "unknown"), "gives": ("clearer",)})
    stages.insert(at + 1, again)
    stages[at + 2] = stages[at + 2].model_copy(update={"takes": ("clearer", "unknown")})
    parts = hazy_manifest().parts
    twice = hazy_manifest(stages=tuple(stages), planes=planes_of(tuple(stages), parts))
    with pytest.raises(BundleError, match="one stage haze at most; tiny has 2"):
        haze.check(Dehaze(), twice, 0)


def test_larger_captures_take_longer(bundle: Bundle) -> None:
    speed = Speed(block_s=1e-3, clipped_block_s=1e-2, rest_s_per_mp=0.1, threads=1)
    placement = start(bundle, _capture()).job.placement
    small, large = (
        Subject(
            bundle=bundle, options=Options(), height_px=side, width_px=side, placement=placement
        )
        for side in (64, 4000)
    )
    taken = [haze.seconds(Dehaze(), subject, Work(), speed) for subject in (small, large)]
    assert 0 < taken[0] < taken[1]
    # the first capture of a process waits for the few kernels
    few_of.cache_clear()
    first = haze.seconds(Dehaze(), small, Work(), speed)
    _filled(bundle, _capture())
    assert haze.seconds(Dehaze(), small, Work(), speed) == taken[0] < first


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 40), (40, 1), (2, 2), (3, 65)])
def test_captures_of_any_size_are_cleared(bundle: Bundle, height: int, width: int) -> None:
    samples = np.random.default_rng(5).integers(100, 900, (height, width), dtype=np.uint16)
    found = _filled(bundle, made_mosaic(samples=samples), assume="centre")
    assert found.shape[1:] == (height, width)
    assert np.isfinite(found).all()


def test_a_bundle_opens_from_disk(tmp_path: Path) -> None:
    assert write_hazy_bundle(tmp_path).manifest.stage(Dehaze) is not None


def test_a_capture_that_its_haze_lifts_is_not_noted_as_fog(bundle: Bundle, tmp_path: Path) -> None:
    doubt = f"{NOTHING_DARK} 12% of the range above black 64"
    noted = replace(_capture(), notes=(doubt, "another"))
    few = noted.samples.astype(np.float64)
    assert np.quantile(few, 1e-3) - 64 < 0.5 * (few.mean() - 64)
    assert "another" in start(bundle, noted).job.log.notes
    assert doubt not in start(bundle, noted).job.log.notes
    clear = open_bundle(write_tiny_bundle(tmp_path))
    assert doubt in start(clear, noted).job.log.notes
