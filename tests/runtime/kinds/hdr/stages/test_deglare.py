"""Glare found before the first row: files of any kind and size, the same bits by any bands."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.chain import capture_plane
from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Color, Deglare, Demosaic, JoinError, Linearise, Parts
from camkit.bundle.stages.entry import StageEntry
from camkit.errors import BundleError
from camkit.runtime.cancel import Cancelled
from camkit.runtime.capture import Capture
from camkit.runtime.development import make_file
from camkit.runtime.kinds.hdr.deglare.removal import GlareSettings, find_glare
from camkit.runtime.kinds.hdr.stages import deglare
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.write_options import WriteOptions
from tests.job_factory import start
from tools.hdr.glare_bundle import build, mosaic_of
from tools.hdr.glare_twin import exposed_scene, photographed, two_point_star

SHAPE = (192, 256)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    path = tmp_path_factory.mktemp("glare") / "deglare.camkit"
    build(path, Deglare())
    return open_bundle(path)


@pytest.fixture(scope="module")
def seen() -> FloatArray:
    scene = exposed_scene("night:6", *SHAPE)
    return photographed(scene, two_point_star(math.radians(-5)), 3).picture


def _capture(pipeline: Pipeline, samples: NDArray[Any]) -> Capture:
    return pipeline.capture_of(samples, iso=100, white_balance=None, origin_px=None)


def test_the_bundle_proves_itself_and_may_be_built_in(bundle: Bundle) -> None:
    assert check_bundle(bundle.path, run=case_work).passed
    assert bundle.path.stat().st_size < 2_000_000
    assert [case.name for case in bundle.manifest.golden] == ["streaks", "planes"]


def test_planes_come_out_as_the_core_says(bundle: Bundle, seen: FloatArray) -> None:
    entry = bundle.manifest.stages_of(Deglare)[0]
    settings = GlareSettings(
        least_rad=math.radians(entry.least_angle_deg),
        most_rad=math.radians(entry.most_angle_deg),
        reach=entry.reach,
        level=entry.level,
    )
    glare = find_glare(lambda: lambda a, b: seen[:, a:b], *SHAPE, settings)
    wanted = seen.copy()
    glare.paint(wanted, 0, (1.0, 1.0, 1.0))
    pipeline = Pipeline(bundle, Options(threads=2))
    work = pipeline.start(_capture(pipeline, seen))
    np.testing.assert_allclose(work.fill(), wanted, atol=1e-6)
    assert work.sections["glare"] == glare.to_json()
    assert work.sections["glare"]["angle_deg"] == pytest.approx(-5, abs=0.2)


def test_threads_and_memory_change_no_bit_of_a_mosaic(bundle: Bundle, seen: FloatArray) -> None:
    mosaic = mosaic_of(seen)
    made = []
    for options in (Options(threads=1), Options(threads=3, max_mem_bytes=400_000_000)):
        pipeline = Pipeline(bundle, options)
        made.append(pipeline.start(_capture(pipeline, mosaic)).fill())
    np.testing.assert_array_equal(*made)


def test_what_is_left_out_takes_nothing_away(bundle: Bundle, seen: FloatArray) -> None:
    pipeline = Pipeline(bundle, Options(method="develop"))
    developed = pipeline.start(_capture(pipeline, seen)).fill()
    np.testing.assert_allclose(developed, seen, atol=1e-6)


def test_files_of_any_size_are_taken_and_the_sidecar_says_the_angle(
    bundle: Bundle, seen: FloatArray, tmp_path: Path
) -> None:
    path = tmp_path / "night.tif"
    cut = seen[:, :-5, 3:]
    tifffile.imwrite(
        path, np.round(cut * 65535).astype(np.uint16).transpose(1, 2, 0), photometric="rgb"
    )
    target = tmp_path / "night.exr"
    result = make_file(path, target, Pipeline(bundle, Options()), WriteOptions())
    assert result.status == "ok"
    record = json.loads((tmp_path / "night.camkit.json").read_text(encoding="utf-8"))
    assert record["glare"]["angle_deg"] == pytest.approx(-5, abs=0.2)
    assert "glare" not in record["plan"]


def test_samples_that_are_no_numbers_spoil_nothing_else(bundle: Bundle, seen: FloatArray) -> None:
    broken = seen.copy()
    broken[1, 100, 40] = np.nan
    pipeline = Pipeline(bundle, Options())
    work = pipeline.start(_capture(pipeline, broken))
    out = work.fill()
    assert np.isnan(out).sum() <= 3
    assert work.sections["glare"]["angle_deg"] == pytest.approx(-5, abs=0.2)


def test_a_picture_without_light_is_unchanged_and_says_so(bundle: Bundle) -> None:
    dark = np.full((3, 31, 45), 0.25, np.float32)
    pipeline = Pipeline(bundle, Options())
    work = pipeline.start(_capture(pipeline, dark))
    np.testing.assert_allclose(work.fill(), dark, atol=1e-6)
    assert any("removed: no light reaches the white level" in text for text in work.warnings)


def test_a_capture_that_names_a_camera_is_taken_all_the_same(
    bundle: Bundle, seen: FloatArray
) -> None:
    capture = replace(_capture(Pipeline(bundle, Options()), seen), bundle_name="duet")
    assert start(bundle, capture).shape == seen.shape


def test_work_is_stopped_when_wished(bundle: Bundle, seen: FloatArray) -> None:
    pipeline = Pipeline(bundle, Options())
    work = pipeline.start(_capture(pipeline, seen), cancel=lambda: True)
    with pytest.raises(Cancelled):
        work.fill()


def _wired(*stages: StageEntry, bundle: Bundle) -> Manifest:
    manifest = bundle.manifest
    parts = Parts(sensor=manifest.sensor, optics=None, networks={})
    return Manifest.model_validate(
        {
            **dict(manifest),
            "stages": stages,
            "planes": planes_of(stages, parts),  # type: ignore[arg-type]
            "products": {"image": stages[-1].gives[0]},
            "golden": (),
            "members": {},
        }
    )


def test_two_of_them_are_refused(bundle: Bundle) -> None:
    manifest = _wired(
        Linearise(gives=("light",)),
        Demosaic(takes=("light",)),
        Deglare(),
        Deglare(takes=("clear",), gives=("clearer",)),
        Color(takes=("clearer",)),
        bundle=bundle,
    )
    with pytest.raises(BundleError, match="one stage deglare at most; deglare has 2"):
        deglare.check(manifest.stages_of(Deglare)[0], manifest, 10**9)
    deglare.check(bundle.manifest.stages_of(Deglare)[0], bundle.manifest, 10**9)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"least_angle_deg": 8.0}, "least_angle_deg 8 must lie below most_angle_deg 8"),
        ({"most_angle_deg": 41.0}, "less than or equal to 40"),
        ({"reach": 0.0}, "greater than 0"),
        ({"level": 1.5}, "less than or equal to 1"),
    ],
)
def test_an_entry_that_means_nothing_is_refused(changes: dict[str, float], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        Deglare(**changes)  # type: ignore[arg-type]


def test_a_mosaic_does_not_join(bundle: Bundle) -> None:
    plane = capture_plane(bundle.manifest.sensor).model_copy(update={"domain": "linear"})
    with pytest.raises(JoinError, match="it takes red, green and blue"):
        Deglare().join([plane], bundle.manifest.parts)


def test_seconds_grow_with_the_picture(bundle: Bundle) -> None:
    entry = bundle.manifest.stages_of(Deglare)[0]
    pipeline = Pipeline(bundle, Options())
    speed = pipeline.speed(())
    taken = [
        deglare.seconds(entry, _subject(bundle, side), Work(), speed) for side in (200, 2000, 4000)
    ]
    assert 0 < taken[0] < taken[1] < taken[2]
    assert isinstance(speed, Speed)


def _subject(bundle: Bundle, side: int) -> Subject:
    job = start(bundle, _capture(Pipeline(bundle, Options()), np.zeros((3, 9, 9), np.float32))).job
    return Subject(
        bundle=bundle,
        options=Options(),
        height_px=side,
        width_px=side,
        placement=job.placement,
        content=None,
    )


def test_what_was_found_is_told_in_python_too(
    bundle: Bundle, seen: FloatArray, tmp_path: Path
) -> None:
    file = tmp_path / "windshield.tif"
    tifffile.imwrite(file, seen.transpose(1, 2, 0), photometric="rgb")
    pipeline = Pipeline(bundle, Options())
    picture = pipeline.process(file)
    assert picture.sections["glare"]["angle_deg"] == pytest.approx(-5, abs=0.2)
    assert pipeline.stream(file, lambda _top, _band: None).sections == picture.sections
