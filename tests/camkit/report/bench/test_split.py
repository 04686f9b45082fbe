"""Accuracy by ISO and by place: means over pictures of the captures that share them."""

import pytest

from camkit.report.bench.accuracy import CaptureScores, Scores
from camkit.report.bench.metrics.picture import METRIC
from camkit.report.bench.split import picture_mean, split_columns


def make_taken(picture: str, iso: float, share: float | None, psnr_db: float) -> CaptureScores:
    return CaptureScores(
        picture=picture,
        iso=iso,
        field_share=share,
        field_mm=None if share is None else 20 * share,
        values={"psnr_db": psnr_db},
    )


def test_every_iso_and_place_has_the_mean_of_its_own_captures() -> None:
    own = [
        make_taken(name, iso, share, level + 10 * (iso < 200) - 4 * share)
        for name, level in (("a", 20.0), ("b", 22.0))
        for iso in (1600.0, 100.0)
        for share in (1.0, 0.0)
    ]
    inputs = [make_taken(t.picture, t.iso, t.field_share, 15.0) for t in own]
    found = split_columns(Scores(captures=own), Scores(captures=inputs), (METRIC,))
    assert [(c["iso"], c["psnr_db"]) for c in found["by_iso"]] == [(100.0, 29.0), (1600.0, 19.0)]
    assert [(c["field_share"], c["field_mm"], c["psnr_db"]) for c in found["by_field"]] == [
        (0.0, 0.0, 26.0),
        (1.0, 20.0, 22.0),
    ]
    cells = found["by_iso_and_field"]
    assert [(c["iso"], c["field_share"]) for c in cells] == [
        (100, 0),
        (100, 1),
        (1600, 0),
        (1600, 1),
    ]
    assert [c["psnr_db"] for c in cells] == [31.0, 27.0, 21.0, 17.0]
    assert {(c["captures"], c["images"], c["input_psnr_db"]) for c in cells} == {(2, 2, 15.0)}
    assert {c["ssim"] for c in cells} == {None}  # was not measured


def test_a_picture_counts_once_however_many_captures_it_has() -> None:
    taken = [make_taken("a", 100.0, 0.0, v) for v in (10.0, 20.0)]
    assert picture_mean([*taken, make_taken("b", 100.0, 0.0, 25.0)], "psnr_db") == 20.0
    assert picture_mean(taken, "ssim") is None


def test_without_scores_there_is_no_cell_and_unknown_places_are_null() -> None:
    assert split_columns(None, None, (METRIC,)) == {
        "by_iso": [],
        "by_field": [],
        "by_iso_and_field": [],
    }
    (cell,) = split_columns(Scores(captures=[make_taken("a", 100.0, None, 20.0)]), None, (METRIC,))[
        "by_field"
    ]
    assert (cell["field_share"], cell["field_mm"]) == (None, None)
    assert cell["psnr_db"] == pytest.approx(20.0)
