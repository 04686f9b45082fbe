from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.design.tolerance import (
    FIELDS,
    Measured,
    ToleranceResult,
    ToleranceRun,
    run_tolerance,
)
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.tolerance.errors import ErrorWidth, Tolerances

PRESCRIPTIONS = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions"
DUET = read_lens(PRESCRIPTIONS / "duet.toml")
QUICK = ToleranceRun(copies=3, limit_copies=1, patch_px=32, patches=1, rays=128)
NOTHING = Tolerances().only("conic")  # which is 0 by default


@pytest.fixture(scope="module")
def found() -> ToleranceResult:
    return run_tolerance(DUET, Tolerances(), QUICK)


def test_copies_without_errors_are_as_good_as_the_design() -> None:
    result = run_tolerance(DUET, NOTHING, QUICK)
    np.testing.assert_array_equal(
        result.copies.psnr_db, np.repeat(result.nominal.psnr_db, 3, axis=0)
    )
    assert result.classes == ()
    assert result.offenders == ()
    assert result.share_at_least(float(result.nominal.mean_db[0])) == 1


def test_a_run_repeats_itself_and_another_seed_does_not(found: ToleranceResult) -> None:
    one = Tolerances().only("element_tilt")
    first, again = (run_tolerance(DUET, one, QUICK) for _ in range(2))
    np.testing.assert_array_equal(again.copies.psnr_db, first.copies.psnr_db)
    other = run_tolerance(DUET, NOTHING, replace(QUICK, seed=2))
    assert not np.array_equal(other.nominal.psnr_db, found.nominal.psnr_db)


def test_wider_errors_lose_more(found: ToleranceResult) -> None:
    wide = Tolerances(
        surface_decentre=ErrorWidth(half_width=0.2), radius=ErrorWidth(half_width=0.01)
    )
    worse = run_tolerance(DUET, wide, QUICK)
    assert worse.copies.mean_db.mean() < found.copies.mean_db.mean() - 1
    assert worse.copies.spot_rms_mm.mean() > found.copies.spot_rms_mm.mean()


def test_every_field_and_class_is_judged_and_sorted(found: ToleranceResult) -> None:
    assert found.nominal.psnr_db.shape == (1, len(FIELDS))
    assert found.copies.spot_rms_mm.shape == (3, len(FIELDS))
    assert {c.error_class for c in found.classes} == set(Tolerances().active())
    losses = [float(c.loss_db.mean()) for c in found.classes]
    assert losses == sorted(losses, reverse=True)
    growths = [o.spot_growth_mm for o in found.offenders]
    assert growths == sorted(growths, reverse=True)
    assert found.copies.energy_kept > 0.95


def test_fields_of_the_round_design_differ_only_by_their_patches(found: ToleranceResult) -> None:
    spots = found.nominal.spot_rms_mm[0]
    np.testing.assert_allclose(spots[1:5], spots[1], rtol=1e-9)
    np.testing.assert_allclose(spots[5:], spots[5], rtol=1e-9)


def test_watch_is_told_every_batch() -> None:
    told: list[tuple[int, int]] = []
    only = Tolerances().only("element_tilt")
    run_tolerance(DUET, only, QUICK, lambda done, total: told.append((done, total)))
    # 3 samples, 1 of the class at its limit, 2 elements at 2 limits each
    assert told == [(0, 8), (3, 8), (4, 8), (8, 8)]


def test_without_a_ranking_samples_bound_the_run() -> None:
    told: list[tuple[int, int]] = []
    only, run = Tolerances().only("element_tilt"), replace(QUICK, ranking=False)
    result = run_tolerance(DUET, only, run, lambda done, total: told.append((done, total)))
    assert told == [(0, 4), (3, 4), (4, 4)]
    assert (result.offenders, result.ranking) == ((), ())


def test_a_lens_with_the_axis_alone_has_one_field() -> None:
    lens: Lens = replace(DUET, field_angles_rad=(0.0,), wavelengths_um=(1.0,))
    result = run_tolerance(lens, Tolerances().only("focus"), QUICK)
    assert result.copies.psnr_db.shape == (3, 1)


def test_yield_and_percentiles_are_those_of_the_copies(found: ToleranceResult) -> None:
    psnr = np.arange(1.0, 11.0)[:, None]
    made = Measured(
        psnr_db=np.repeat(psnr, 2, axis=1),
        spot_rms_mm=psnr,
        refocus_mm=psnr[:, 0],
        gap_mm=psnr[:, 0],
        energy_kept=1.0,
    )
    result = replace(found, copies=made)
    assert result.share_at_least(8.0) == 0.3
    assert result.share_at_least(11.0) == 0
    assert result.percentile_db(50) == 5.5


def test_a_larger_error_loses_more_in_either_direction() -> None:
    """Single errors of growing size: what is lost grows, and vanishes with them."""
    losses = []
    for scale in (1e-6, 1.0, 4.0):
        widths = replace(
            NOTHING,
            irregularity=ErrorWidth(half_width=scale),
            wedge=ErrorWidth(half_width=3e-4 * scale),
        )
        ranking = run_tolerance(DUET, widths, replace(QUICK, copies=1)).ranking
        losses.append(
            [
                max(one.loss_db for one in ranking if one.single.error_class == error_class)
                for error_class in ("irregularity", "wedge")
            ]
        )
    np.testing.assert_allclose(losses[0], 0, atol=1e-4)
    assert (np.diff(losses, axis=0) > 0.01).all()


def test_single_errors_are_judged_by_the_picture_and_by_spots(found: ToleranceResult) -> None:
    assert len(found.offenders) == 2 * len(found.ranking)
    losses = [one.loss_db for one in found.ranking]
    assert losses == sorted(losses, reverse=True)
    assert {one.spot_place for one in found.ranking} == set(range(1, len(losses) + 1))
    # the order by spots is another one
    assert [one.spot_place for one in found.ranking] != list(range(1, len(losses) + 1))
    assert losses[0] > 0.1


def test_a_wedge_loses_what_a_tilt_of_the_rear_loses() -> None:
    wide = ErrorWidth(half_width=1e-3)
    wedge, tilt = (
        run_tolerance(DUET, Tolerances(**{one: wide}).only(one), QUICK).offenders
        for one in ("wedge", "surface_tilt")
    )
    by_rear = {(o.single.part, o.single.value): o.loss_db for o in tilt}
    for one in wedge:
        # the windows of both runs differ by a few pixels: their first samples do
        rear = by_rear[one.single.part + 1, one.single.value]
        assert one.loss_db == pytest.approx(rear, rel=5e-3)


def test_the_gap_that_assembly_moves_is_named_and_lowers_the_loss() -> None:
    errors = Tolerances().only("radius")
    paraxial, gap = (
        run_tolerance(DUET, replace(errors, compensator=one), QUICK) for one in ("paraxial", "gap")
    )
    assert paraxial.tolerances.compensator_gap is None
    assert not paraxial.copies.gap_mm.any()
    assert gap.tolerances.compensator_gap == 2
    assert gap.copies.gap_mm.all()
    assert not gap.nominal.gap_mm.any()
    np.testing.assert_allclose(gap.nominal.psnr_db, paraxial.nominal.psnr_db, atol=1e-4)
    assert gap.copies.mean_db.mean() > paraxial.copies.mean_db.mean()


def test_senseless_runs_are_refused() -> None:
    for wrong in ({"copies": 0}, {"seed": -1}, {"rays": 1}, {"pitch_um": 0.0}):
        with pytest.raises(ContractError):
            ToleranceRun(**wrong)
