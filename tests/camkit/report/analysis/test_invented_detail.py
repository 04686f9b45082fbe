"""Hallucination: the true scene is explained, planted detail is found, ranges are kept."""

import json

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.analysis.hallucination_page import (
    crop_png,
    draw_histograms,
    hallucination_html,
)
from camkit.report.analysis.invented_detail import (
    PLANTED,
    TRUTH,
    Options,
    Report,
    analyse,
    to_json,
    to_text,
)
from camkit.report.analysis.patches import MEASURES, corners_of, overshoot_of, summary
from camkit.report.analysis.planted import plant
from camkit.report.stress.rig import INPUT, Restored, Rig
from camkit.report.stress.scene import stress_scenes
from tests.bundle_factory import tiny_sensor
from tests.haze_bundle import write_hazy_bundle
from tests.wide_bundle import write_wide_bundle

SIDE_PX = 32


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("hallucination"))


@pytest.fixture(scope="module")
def report(bundle: Bundle) -> Report:
    return analyse(bundle, stress_scenes(bundle, 2), Options(side_px=SIDE_PX))


@pytest.fixture(scope="module")
def by_filter(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """A hazy camera without a network."""
    camera = write_hazy_bundle(tmp_path_factory.mktemp("hazy"), sensor=tiny_sensor(192, 160))
    return analyse(camera, stress_scenes(camera, 2), Options(side_px=SIDE_PX))


def test_the_true_scene_explains_its_capture(report: Report) -> None:
    """Of n samples the mean of chi^2 varies by the root of 2 / n."""
    chi2 = report.method(TRUTH).values("chi2")
    samples = SIDE_PX**2
    assert np.nanmean(chi2) == pytest.approx(1, abs=4 * np.sqrt(2 / samples / chi2.size))
    assert np.nanmax(np.abs(chi2 - 1)) < 6 * np.sqrt(2 / samples)


def test_the_true_scene_of_a_hazy_camera_explains_its_capture(by_filter: Report) -> None:
    chi2 = by_filter.method(TRUTH).values("chi2")
    assert np.nanmean(chi2) == pytest.approx(1, abs=4 * np.sqrt(2 / SIDE_PX**2 / chi2.size))


def test_a_method_that_gives_nothing_is_one_line(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = Restored(planes={}, pictures={}, faults={"M": "not to be believed"})
    monkeypatch.setattr(Rig, "restore", lambda *_: nothing)
    with pytest.raises(ContractError, match="M gives no picture: not to be believed"):
        analyse(bundle, stress_scenes(bundle, 1), Options(side_px=SIDE_PX))


def test_the_worst_of_the_filter_are_those_with_most_left_unexplained(report: Report) -> None:
    filtered = report.method("wiener")
    worst = [crop.patch.values["detail"] for crop in filtered.worst]
    everything = sorted(filtered.values("detail").tolist(), reverse=True)
    assert worst == everything[: len(worst)]


def test_the_capture_taken_for_the_scene_is_denied(report: Report) -> None:
    """Blurred once more it misses the edges of its own capture."""
    assert np.nanmedian(report.method(INPUT).values("chi2")) > 1.2


def test_what_was_planted_is_found(by_filter: Report) -> None:
    control = by_filter.control
    assert control.method == "wiener"
    assert control.planted == 8
    assert control.detected == control.planted
    assert control.first == control.planted
    assert control.rise > 1
    # the worst patches of the control are those, the worst first
    plain, planted = (by_filter.method(control.method + mark) for mark in ("", PLANTED))
    ours = {
        (p.scene, p.place)
        for p, q in zip(plain.patches, planted.patches, strict=True)
        if p.values["l1"] != q.values["l1"]
    }
    assert {(c.patch.scene, c.patch.place) for c in planted.worst[:8]} == ours


def test_a_network_that_nobody_trained_is_denied_where_nothing_was_planted(report: Report) -> None:
    """What it invents everywhere hides what was planted: the control may fail."""
    assert report.control.method == "M"
    assert np.nanmedian(report.method("M").values("excess")) > 10
    assert np.nanmedian(report.method(TRUTH).values("excess")) < 0
    assert report.control.detected < report.control.planted


def test_detail_too_weak_for_its_noise_is_not_found() -> None:
    """A control that always succeeds would prove nothing."""
    picture = np.full((3, 96, 96), 0.4, np.float32)
    weak = plant(picture, [(32, 32)], 32, strength=1e-6)
    assert np.abs(weak.picture - picture).max() < 1e-6
    strong = plant(picture, [(32, 32)], 32)
    assert strong.places == ((32, 32),)
    assert strong.picture[:, 32:64, 32:64].std() > 0.03
    assert (strong.picture[:, :32] == picture[:, :32]).all()


def test_report_and_page_hold_every_method(report: Report) -> None:
    told = to_json(report, ["one.png"])
    json.dumps(told, allow_nan=False)
    assert told["patches"] == len(report.methods[0].patches) > 8
    for method in told["methods"].values():
        assert set(MEASURES) < set(method)
        assert {"median", "p95", "p99", "max"} <= set(method["l1"])
        for measure in ("chi2", "detail"):
            maps = method[measure]["map"]
            assert list(maps) == list(dict.fromkeys(p.scene for p in report.methods[0].patches))
            assert sum(len(row) for rows in maps.values() for row in rows) == told["patches"]
    primary = told["methods"][report.control.method]
    assert len(primary["worst"]) == min(16, told["patches"])
    assert primary["worst"][0]["crop"] == "one.png"
    values = [entry["excess"] for entry in primary["worst"]]
    assert values == sorted(values, reverse=True)
    assert "control:" in to_text(told)
    page = hallucination_html(report)
    assert page.count("<img") >= 4
    assert crop_png(report.method(report.control.method).worst[0]).startswith(b"\x89PNG")


def test_the_chart_of_the_excess_keeps_its_sign_and_leaves_the_filter_out(report: Report) -> None:
    methods = [report.method(name) for name in (TRUTH, "wiener", "M")]
    panel = draw_histograms(methods).axes[MEASURES.index("excess")]
    labels = panel.get_legend_handles_labels()[1]
    assert labels == [TRUTH, "M"]
    low, _ = panel.get_xlim()
    assert -5 < low < 0


def test_overshoot_is_what_leaves_the_range_around() -> None:
    truth = np.full((3, 40, 40), 0.3, np.float32)
    truth[:, :, 20:] = 0.7
    got = truth.copy()
    got[:, 10, 20] = 0.9
    got[:, 30, 5] = 0.25
    got[:, 20, 19] = 0.6  # between the two sides of the edge
    over = overshoot_of(got, truth)
    assert over[10, 20] == pytest.approx(0.2, abs=1e-6)
    assert over[30, 5] == pytest.approx(0.05, abs=1e-6)
    assert over[20, 19] == 0
    assert (over > 0).sum() == 2


def test_patches_are_whole_and_away_from_the_border() -> None:
    corners = corners_of(160, 128, 32)
    assert corners[0] == (32, 32)
    assert len(corners) == 3 * 2
    assert corners_of(90, 90, 32) == []


def test_a_summary_leaves_out_what_is_not_known() -> None:
    found = summary(np.array([np.nan, 1.0, 2.0, 3.0]))
    assert (found["median"], found["max"]) == (2.0, 3.0)
    assert summary(np.full(3, np.nan))["median"] is None


def test_a_patch_larger_than_the_scene_is_refused(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match="no patch of 512 px"):
        analyse(bundle, stress_scenes(bundle, 1), Options(side_px=512))
    with pytest.raises(ContractError, match="at least 16"):
        Options(side_px=8)
