"""Gains on the same captures: means, errors over pictures, and what is compared with what."""

from dataclasses import replace

import numpy as np
import pytest

from tools.comparison.measurement import Measurement
from tools.comparison.paired import (
    best_classical,
    mean_and_error,
    paired_gains,
    pairs_of,
    to_lines,
)

MEASUREMENT = Measurement(
    psf="fresh",
    set_name="set",
    picture="a.png",
    position=2,
    height_mm=9.8,
    iso=100.0,
    seed=2001,
    method="M",
    psnr_db=20.0,
    ssim=0.5,
    seconds=1.0,
    megapixels=0.1,
    identity="x",
)
GAINS_DB = ((1.0, 3.0), (2.0, 4.0), (0.0, 0.5))
"""Of three pictures at two ISOs each."""


def captures() -> list[Measurement]:
    found = []
    for number, of_picture in enumerate(GAINS_DB):
        for iso, gain_db in zip((100.0, 1600.0), of_picture, strict=True):
            base = replace(MEASUREMENT, picture=f"{number}.png", iso=iso, psnr_db=20.0 + number)
            found += [
                replace(base, method="M before"),
                replace(base, method="M", psnr_db=base.psnr_db + gain_db),
            ]
    return found


def test_gains_are_means_over_captures_with_the_error_over_pictures() -> None:
    (gain,) = paired_gains(captures(), [("M", "M before")])
    means = [np.mean(pair) for pair in GAINS_DB]
    assert gain["all"]["db"] == pytest.approx(np.mean(GAINS_DB), abs=1e-3)
    assert gain["all"]["error_db"] == pytest.approx(np.std(means, ddof=1) / 3**0.5, abs=1e-3)
    assert gain["all"]["captures"] == 6
    assert gain["by_iso"]["1600"]["db"] == pytest.approx(2.5)
    assert gain["by_position"].keys() == {str(MEASUREMENT.position)}


def test_a_capture_that_lacks_one_of_both_counts_in_neither() -> None:
    found = captures()
    (gain,) = paired_gains(found[:-1], [("M", "M before")])
    assert gain["all"]["captures"] == 5
    assert paired_gains([m for m in found if m.method == "M"], [("M", "M before")]) == []


def test_one_picture_has_a_gain_without_an_error() -> None:
    (gain,) = paired_gains(captures()[:4], [("M", "M before")])
    assert "error_db" not in gain["all"]
    assert "| network M over network M before | +2.00 | +0.2: reached |" in "\n".join(
        to_lines([gain])
    )
    assert to_lines([]) == []


def test_everything_is_compared_with_itself_before_the_best_classical_and_rivals() -> None:
    methods = ("input", "admm_tv", "bank", "S", "M", "bank before", "M before", "U-Net")
    assert pairs_of(methods, "admm_tv") == [
        ("bank", "bank before"),
        ("M", "M before"),
        ("S", "M before"),
        ("bank", "admm_tv"),
        ("S", "admm_tv"),
        ("M", "admm_tv"),
        ("M", "U-Net"),
    ]
    assert pairs_of(("input", "bank"), None) == []


def test_the_best_classical_method_is_the_one_with_the_highest_mean() -> None:
    levels = {"admm_tv": 23.0, "skimage_rl": 22.0, "M": 25.0}
    found = [replace(MEASUREMENT, method=name, psnr_db=db) for name, db in levels.items()]
    assert best_classical(found) == "admm_tv"
    assert best_classical(found[2:]) is None


def test_captures_of_a_group_are_one_observation() -> None:
    mean, error = mean_and_error([1.0, 1.0, 1.0, 3.0], ["a", "a", "a", "b"])
    assert mean == 1.5
    assert error == pytest.approx(1.0)  # of the means 1 and 3
    assert mean_and_error([1.0, 2.0], [0, 0]) == (1.5, None)
