"""What is known of a capture before its first row: its place, its noise, what people are told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.plane import Grid
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Color, Linearise
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from tests.bundle_factory import tiny_sensor
from tests.job_factory import OWN_BALANCE, SHAPE, made_job, made_mosaic, made_planes, start
from tests.planes_bundle import planes_sensor, write_planes_bundle


def test_a_capture_that_states_everything_leaves_nothing_to_note(bundle: Bundle) -> None:
    assert start(bundle, made_mosaic()).job.log.notes == []


def test_notes_of_the_decode_come_first(bundle: Bundle) -> None:
    capture = made_mosaic(notes=("half of it is missing",), white_balance=None)
    notes = start(bundle, capture).job.log.notes
    assert notes[0] == "half of it is missing"
    assert len(notes) == 2


def test_planes_in_place_of_a_mosaic_are_noted(bundle: Bundle) -> None:
    notes = start(bundle, made_planes()).job.log.notes
    assert notes == ["the capture has full colour instead of a mosaic: demosaicking is skipped"]


@pytest.mark.parametrize("count", [1, 2, 4])
def test_planes_that_the_sensor_does_not_give_are_refused(bundle: Bundle, count: int) -> None:
    capture = made_planes(samples=np.zeros((count, *SHAPE), np.float32))
    with pytest.raises(ContractError, match="takes raw_bayer_v1 or linear_rgb_v1"):
        made_job(capture, bundle)
    with pytest.raises(ContractError, match=rf"without a bundle .* {count} channel"):
        made_job(capture)


def test_a_mosaic_is_refused_by_a_sensor_of_planes(tmp_path: Path) -> None:
    stages = (Linearise(gives=("light",)), Color(takes=("light",)))
    camera = write_planes_bundle(tmp_path, stages, sensor=planes_sensor())
    with pytest.raises(ContractError, match="takes linear_planes_v1, the capture is raw_bayer_v1"):
        made_job(made_mosaic(), camera)


def test_an_assumed_place_is_noted_and_a_wrong_size_is_refused(bundle: Bundle) -> None:
    small = made_mosaic(samples=np.full((32, 48), 500, np.uint16))
    centred = start(bundle, small, assume="centre").job
    assert centred.placement.window.origin_px == (24.0, 16.0)
    assert centred.log.notes == [centred.placement.note]
    with pytest.raises(ContractError, match="48x32 pixels, the bundle's sensor 96x64"):
        start(bundle, small)


def test_a_walk_that_nobody_hears_adds_no_section(bundle: Bundle) -> None:
    job = made_job(made_mosaic(), bundle)
    job.with_new_log().log.sections["hdr"] = {"regions": 1}
    assert job.log.sections == {}


def test_noise_is_the_files_before_the_bundles_before_a_measured_one(bundle: Bundle) -> None:
    stated = NoiseModel(shot=(1e-3,) * 3, read_variance=(1e-6,) * 3)
    captures = {
        "file": made_mosaic(noise=stated),
        "bundle": made_mosaic(),
        "measured": made_mosaic(iso=None),
    }
    for source, capture in captures.items():
        assert start(bundle, capture).record["noise"]["source"] == source
    job = start(bundle, captures["file"]).job
    assert job.log.record["noise"]["shot"] == stated.shot
    assert job.noise == stated, "before white balance, which is a stage"
    assert job.white_balance == OWN_BALANCE
    at_iso = start(bundle, replace(captures["bundle"], iso=400.0)).job.noise
    assert at_iso == tiny_sensor().noise_at(400)
    for capture in captures.values():
        said = start(bundle, capture, noise=(2e-4, 3e-7)).job
        assert said.log.record["noise"]["source"] == "stated"
        assert said.noise == NoiseModel(shot=(2e-4,) * 3, read_variance=(3e-7,) * 3)
        at_said_iso = start(bundle, capture, iso=400.0)
        assert at_said_iso.record["noise"]["source"] == "bundle"
        assert at_said_iso.job.noise == tiny_sensor().noise_at(400)
        assert at_said_iso.origin.metadata.iso == 400


def test_noise_below_that_of_rounding_to_codes_is_noted(bundle: Bundle) -> None:
    codes = np.random.default_rng(0).normal(120, 4.0, (3, *SHAPE)).round()
    levels = np.stack([np.arange(0.5, 255) / 255, np.full(255, 1 / 255**2 / 12)])
    smooth = np.broadcast_to(np.linspace(0.2, 0.8, SHAPE[1], dtype=np.float32), (3, *SHAPE))
    tiny = np.random.default_rng(1).normal(0, 1e-5, smooth.shape).astype(np.float32)
    for samples, is_noted in ((codes.astype(np.float32) / 255, False), (smooth + tiny, True)):
        for rounding in (levels, None):
            capture = made_planes(samples=samples, iso=None, rounding=rounding)
            notes = " ".join(start(bundle, capture).job.log.notes)
            assert ("blur and rounding hide" in notes) == (is_noted and rounding is not None)
            assert "hide" not in " ".join(start(bundle, capture, iso=100.0).job.log.notes)


def test_noise_is_known_for_every_channel_of_a_camera(tmp_path: Path) -> None:
    sensor = planes_sensor(tuple("ABCDE"))
    stages = (Linearise(gives=("light",)),)
    camera = write_planes_bundle(tmp_path, stages, sensor=sensor, products={"image": "light"})
    capture = made_planes(samples=np.random.default_rng(0).random((5, *SHAPE), np.float32))
    for known in (capture, replace(capture, iso=None)):
        assert len(made_job(known, camera).with_noise().noise.shot) == 5


def test_the_window_of_a_finer_plane_covers_the_same_place(bundle: Bundle) -> None:
    job = made_job(
        made_mosaic(
            samples=np.zeros((20, 32), np.uint16), origin_px=(10, 6), sensor_size_px=(96, 64)
        ),
        bundle,
    )
    plane = bundle.manifest.planes["clean"]
    assert job.window_of(plane) is job.placement.window
    for scale in (2, 3):
        finer = plane.model_copy(update={"grid": Grid().finer(scale)})
        window = job.window_of(finer)
        assert job.grid_px(finer) == (20 * scale, 32 * scale) == window.size_px[::-1]
        # the middle of the samples of one pixel is the middle of the pixel
        for coarse in (0, 7, 31):
            first = scale * coarse
            middle = np.mean([window.to_mm(first + i, 0.0)[0] for i in range(scale)])
            assert middle == pytest.approx(float(job.placement.window.to_mm(coarse, 0.0)[0]))
        assert window.corner_radius_mm == pytest.approx(
            job.placement.window.corner_radius_mm, abs=0.006
        )
        np.testing.assert_allclose(window.centre_mm, job.placement.window.centre_mm, atol=1e-12)


def test_a_capture_of_another_camera_is_refused_unless_it_is_forced(bundle: Bundle) -> None:
    capture = made_mosaic(bundle_name="trio")
    with pytest.raises(ContractError, match=r"names bundle trio, not tiny; .* force_bundle"):
        start(bundle, capture)
    forced = start(bundle, capture, force_bundle=True).job
    assert forced.log.notes == [
        "the capture names bundle trio, not tiny: "
        "the result is right only if both have the same lens"
    ]
    assert start(bundle, made_mosaic(bundle_name="tiny")).job.log.notes == []


def test_captures_of_the_same_optics_need_no_force_and_others_of_one_name_are_noted(
    bundle: Bundle,
) -> None:
    own = bundle.psf_sha256
    derived = made_mosaic(bundle_name="trio", psf_sha256=own)
    assert start(bundle, derived).job.log.notes == []
    (note,) = start(bundle, made_mosaic(bundle_name="tiny", psf_sha256="0" * 64)).job.log.notes
    assert note.startswith("the capture was made through other kernels than those of tiny")
    with pytest.raises(ContractError, match=r"names bundle trio, not tiny; .* force_bundle"):
        start(bundle, made_mosaic(bundle_name="trio", psf_sha256="0" * 64))


def test_a_foreign_camera_whose_place_is_assumed_is_warned_of(bundle: Bundle) -> None:
    small = np.full((32, 48), 500, np.uint16)
    foreign = made_mosaic(samples=small, camera="Nikon D850")
    notes = start(bundle, foreign, assume="centre").job.log.notes
    assert notes[0].startswith(
        "the capture is from the camera Nikon D850: the result is right only with the lens of"
    )
    nameless = made_mosaic(samples=small, sha256="0" * 64)
    notes = start(bundle, nameless, assume="centre").job.log.notes
    assert notes[0].startswith("the capture names no camera: the result is right only with")
    own = made_mosaic(samples=small, camera="camkit tiny", bundle_name="tiny")
    assert len(start(bundle, own, assume="centre").job.log.notes) == 1
