"""Undistortion is skipped where it would move nothing by half a pixel."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Undistort
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.placement import place
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import Warp
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.rules import undistortion
from camkit.runtime.plan.rules.undistortion import NOTHING_PX, decide, largest_shift_px
from tests.plan_factory import RADIUS_MM, made_content, write_planned_bundle


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Give a bundle whose distortion is that of the tiny lens."""
    return write_planned_bundle(tmp_path_factory.mktemp("planned"))


def _subject(bundle: Bundle, side_px: int) -> Subject:
    pipeline = Pipeline(bundle, Options(method="wiener"))
    origin = (1024 - side_px) // 4 * 2, (768 - side_px) // 4 * 2
    capture = pipeline.capture_of(
        np.zeros((side_px, side_px), np.uint16), iso=100, white_balance=None, origin_px=origin
    )
    cells = side_px // 256
    placement = place(capture, bundle.manifest.sensor.extent, None)
    return Subject(
        bundle=bundle,
        options=Options(quality="adaptive"),
        height_px=side_px,
        width_px=side_px,
        placement=placement,
        content=made_content(np.full((cells, cells), 1e-3)),
    )


def test_shift_is_that_of_the_radial_model(bundle: Bundle) -> None:
    subject = _subject(bundle, 768)
    corner_mm = np.hypot(383.5, 383.5) * 6e-3
    closed = corner_mm * 0.01 * (corner_mm / RADIUS_MM) ** 2 / 6e-3
    assert largest_shift_px(subject) == pytest.approx(closed, rel=0.05)


def test_a_small_crop_in_the_middle_is_not_warped(bundle: Bundle) -> None:
    small, large = _subject(bundle, 256), _subject(bundle, 768)
    assert largest_shift_px(small) < 0.5 < largest_shift_px(large)
    work, decision = decide(small, Work())
    assert work.left_out == {"undistort"}
    assert decision is not None
    assert decision.choice == "skipped"
    assert not decide(large, Work())[0].left_out


def test_exact_skips_nothing_and_no_undistortion_stays_none(bundle: Bundle) -> None:
    small = _subject(bundle, 256)
    assert not decide(replace(small, content=None), Work())[0].left_out
    assert decide(small, Work(left_out=frozenset({"undistort"})))[1] is None


@pytest.mark.parametrize(("shift_px", "left_out"), [(1e-9, {"undistort"}), (2e-3, set())])
def test_exact_leaves_out_what_only_rounding_would_move(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch, shift_px: float, left_out: set[str]
) -> None:
    monkeypatch.setattr(undistortion, "largest_shift_px", lambda _: shift_px)
    work, decision = decide(replace(_subject(bundle, 768), content=None), Work())
    assert work.left_out == left_out
    assert decision is not None


def test_a_warp_without_distortion_moves_a_whole_sensor_by_less_than_that(bundle: Bundle) -> None:
    straight = RadialDistortion(coefficients=np.tile([[1.0, 0, 0, 0]], (3, 1)), radius_mm=1.0)
    window = SensorWindow(
        size_px=(6000, 4000), origin_px=(0, 0), sensor_size_px=(6000, 4000), pitch_um=5.96
    )
    warp = Warp(straight, window, to_sensor=False)
    x, y = np.meshgrid(np.linspace(0, 5999, 33), np.linspace(0, 3999, 33))
    moved = np.abs(warp.positions(0, x, y) - np.stack([x, y], -1)).max()
    assert 0 < moved < NOTHING_PX
    whole, fraction = warp.maps(0, 0, 16)
    np.testing.assert_array_equal(whole[..., 0], np.tile(np.arange(6000), (16, 1)))
    assert not np.any(fraction)


def test_cubic_interpolation_is_told_with_its_cost(bundle: Bundle) -> None:
    stages = tuple(
        stage.model_copy(update={"interpolation": "cubic"})
        if isinstance(stage, Undistort)
        else stage
        for stage in bundle.manifest.stages
    )
    cubic = replace(bundle, manifest=bundle.manifest.model_copy(update={"stages": stages}))
    subject = _subject(bundle, 768)
    for given, is_told in ((bundle, False), (cubic, True)):
        decision = decide(replace(subject, bundle=given), Work())[1]
        assert decision is not None
        assert ("cubic" in decision.reason) == is_told
