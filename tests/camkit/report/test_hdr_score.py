"""Scores of high dynamic range: closed forms, what is left out, and what alignment forgives."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import encode_srgb
from camkit.errors import ContractError
from camkit.report.hdr_score import (
    BEST_DB,
    DARKEST,
    NITS_PER_UNIT,
    Reference,
    aligned,
    blob_guess,
    exposed,
    guess_scores,
    hdr_scores,
    mu_law,
    psnr_db,
    stops_rmse,
)
from camkit.scenes.saturation import CEILING
from tests.hdr_pictures import hdr_pair

RESULT, TRUTH = hdr_pair(48)
NAMES = {
    *("hdr_psnr_db", "stops_rmse", "unclipped_psnr_db", "mu_psnr_db", "pu21_psnr_db", "pu21_ssim"),
    *("ev0_psnr_db", "ev4_psnr_db", "ev8_psnr_db"),
}


def clipped_green(truth: FloatArray) -> NDArray[np.bool_]:
    """Give a mask of green alone: colours are mixed of it, so no other counts there either."""
    mask = np.zeros(truth.shape, np.bool_)
    mask[1] = truth[1] >= 1
    return mask


def scores(result: FloatArray, truth: FloatArray = TRUTH) -> dict[str, float]:
    return hdr_scores(result, Reference(truth=truth, clipped=clipped_green(truth)))


CLIPPED = clipped_green(TRUTH)


def flat(level: float, side_px: int = 16) -> FloatArray:
    return np.full((3, side_px, side_px), level, np.float32)


def test_every_number_is_given_as_it_is_and_aligned() -> None:
    assert set(scores(RESULT)) == {f"{name}{end}" for name in NAMES for end in ("", "_aligned")}


def test_equal_pictures_reach_the_cap_and_no_other_does_better() -> None:
    for found in (scores(TRUTH), scores(TRUTH * np.float32(1 + 1e-7))):
        for name, value in found.items():
            best = BEST_DB if "_db" in name else 1.0 if "ssim" in name else 0.0
            assert value == pytest.approx(best, abs=1e-6), name
    assert psnr_db(0.0, CEILING) == BEST_DB
    assert psnr_db(1e-11) == pytest.approx(110)


def test_hdr_psnr_has_its_peak_at_the_ceiling() -> None:
    found = scores(TRUTH + np.float32(0.256))
    assert found["hdr_psnr_db"] == pytest.approx(60, abs=1e-3)
    assert found["unclipped_psnr_db"] == pytest.approx(-20 * math.log10(0.256), abs=1e-3)


def test_stops_are_counted_above_white_alone() -> None:
    doubled = np.where(TRUTH > 1, 2 * TRUTH, 100)
    assert stops_rmse(doubled, TRUTH) == pytest.approx(1)
    mixed = flat(2)
    mixed[0] = 32  # of four times too much, by two stops, a third of the samples
    assert stops_rmse(mixed, flat(8)) == pytest.approx(2)
    assert stops_rmse(flat(-1), flat(2)) == pytest.approx(1 - math.log2(DARKEST))
    assert stops_rmse(flat(0.5), flat(1)) is None


def test_what_cannot_be_measured_is_left_out() -> None:
    dim = hdr_scores(flat(0.4), Reference(truth=flat(0.5)))
    assert {"stops_rmse", "stops_rmse_aligned", "unclipped_psnr_db"}.isdisjoint(dim)
    assert dim["hdr_psnr_db"] == pytest.approx(20 * math.log10(2560))
    assert "unclipped_psnr_db" not in scores(flat(2), flat(3))
    assert guess_scores(Reference(truth=TRUTH, clipped=CLIPPED)) == {}
    assert guess_scores(Reference(truth=TRUTH, bare=np.minimum(TRUTH, 1))) == {}
    dark = Reference(truth=flat(0.5), bare=flat(0.5), clipped=np.zeros((3, 16, 16), bool))
    assert guess_scores(dark) == {}


def test_the_mu_law_is_that_of_its_formula() -> None:
    ends = mu_law(np.array([-1, 0, CEILING, 1e4], np.float32))
    assert ends.tolist() == [0, 0, 1, 1]
    assert mu_law(np.float32([1]))[0] == pytest.approx(math.log(1 + 5000 / 256) / math.log(5001))
    error = mu_law(np.float32([8]))[0] - mu_law(np.float32([4]))[0]
    found = scores(flat(4), flat(8))
    assert found["mu_psnr_db"] == pytest.approx(-20 * math.log10(error))


def test_an_exposure_shows_its_own_range() -> None:
    found = scores(flat(4), flat(8))
    assert found["ev0_psnr_db"] == BEST_DB  # both white
    for ev, levels in {4: (0.25, 0.5), 8: (4 / 256, 8 / 256)}.items():
        low, high = (float(v) for v in encode_srgb(np.array(levels, np.float32)))
        assert found[f"ev{ev}_psnr_db"] == pytest.approx(-20 * math.log10(high - low), abs=1e-4)
    assert exposed(flat(16), 4)[0, 0, 0] == pytest.approx(1)


def test_alignment_forgives_one_factor_and_nothing_else() -> None:
    for factor in (0.01, 0.5, 7.0):
        found = scores(TRUTH * np.float32(factor))
        assert found["hdr_psnr_db"] < 60
        assert found["hdr_psnr_db_aligned"] > 110
        assert found["stops_rmse_aligned"] == pytest.approx(0, abs=1e-5)
    lost = np.minimum(TRUTH, 100)  # the few brightest lights do not move the scale of the rest
    np.testing.assert_array_equal(aligned(lost, TRUTH), lost)
    noise = flat(0.005)
    np.testing.assert_array_equal(aligned(noise, TRUTH[:, :16, :16]), noise)


def test_clipped_samples_do_not_count_among_the_others() -> None:
    result = np.where(CLIPPED.any(axis=0), 0, TRUTH + np.float32(0.1))
    assert scores(result)["unclipped_psnr_db"] == pytest.approx(20, abs=1e-3)


def test_the_guess_is_the_squared_distance_from_the_rim() -> None:
    clipped = np.zeros((3, 61, 64), bool)
    y, x = np.mgrid[:61, :64]
    clipped[0] = np.hypot(y - 30, x - 30) <= 12.2
    clipped[1] = x < 4  # at the border: the frame ends there
    clipped[2] = True
    bare = np.where(clipped, 1, 0.3).astype(np.float32)
    guess = blob_guess(bare, clipped)
    free = np.argwhere(~clipped[0])
    for place in ((30, 30), (30, 35), (25, 26), (30, 42)):
        squared = np.square(free - place).sum(axis=1).min()
        assert guess[0][place] == pytest.approx(max(0.6 * squared, 1))
    assert guess[0][~clipped[0]].tolist() == [pytest.approx(0.3)] * int((~clipped[0]).sum())
    assert guess[1, 30, :5].tolist() == pytest.approx([1, 0.6 * 4, 0.6 * 4, 1, 0.3])
    assert guess[2].max() == CEILING  # 31 px deep
    assert np.isfinite(guess).all()


def test_the_guess_is_scored_in_stops() -> None:
    truth = np.where(CLIPPED, 8, TRUTH).astype(np.float32)
    reference = Reference(truth=truth, clipped=CLIPPED, bare=np.minimum(truth, 1))
    found = guess_scores(reference)
    guess = blob_guess(np.minimum(truth, 1), CLIPPED)
    assert found["stops_rmse_guess"] == stops_rmse(guess, truth)
    assert found["stops_rmse_guess_aligned"] == stops_rmse(aligned(guess, truth), truth)


def test_the_luminance_of_white_moves_what_the_eye_sees_alone() -> None:
    default, bright = (
        hdr_scores(RESULT, Reference(truth=TRUTH, nits_per_unit=nits))
        for nits in (NITS_PER_UNIT, 4 * NITS_PER_UNIT)
    )
    moved = {name for name in default if default[name] != bright[name]}
    assert moved == {f"pu21_{n}{e}" for n in ("psnr_db", "ssim") for e in ("", "_aligned")}


NAN = np.where(np.arange(16) == 3, np.float32(np.nan), flat(1))


@pytest.mark.parametrize(
    ("changes", "result", "words"),
    [
        ({}, NAN, "result must be finite; 48 samples"),
        ({}, flat(1, 15), r"as the truth; got \(3, 15, 15\)"),
        ({"truth": NAN}, flat(1), "truth must be finite"),
        ({"truth": flat(1)[:2]}, flat(1), r"must be \(3, h, w\)"),
        ({"truth": flat(1, 10)}, flat(1, 10), "11 px a side"),
        ({"bare": flat(1, 15)}, flat(1), "bare lens"),
        ({"clipped": np.ones((16, 16), bool)}, flat(1), "mask of clipped samples"),
        ({"nits_per_unit": 0.0}, flat(1), "luminance > 0"),
        ({"nits_per_unit": math.inf}, flat(1), "luminance > 0"),
    ],
)
def test_what_cannot_be_scored_is_refused(
    changes: dict[str, object], result: FloatArray, words: str
) -> None:
    with pytest.raises(ContractError, match=words):
        hdr_scores(result, Reference(**({"truth": flat(1)} | changes)))  # type: ignore[arg-type]
