"""How methods were tuned: what bundle and code state, and nothing else."""

from camkit.bundle.stages import Deglare, Highlights, Linearise, Wiener
from camkit.runtime.bank import baselines
from camkit.runtime.plan.tuning import NOT_RECORDED, stage_tuning
from tests.together_factory import TOGETHER

BANK = Wiener(prior_scale=3e-4, prior_exponent=2.5, block_px=64, overlap_px=24)


def test_the_bank_is_tuned_by_the_numbers_of_its_bundle() -> None:
    found = stage_tuning([Linearise(), BANK], "wiener")
    assert found is not None
    assert found.values["prior_scale"] == 3e-4
    assert (found.source, found.captures) == ("stage wiener of the bundle", NOT_RECORDED)
    together = stage_tuning([BANK.model_copy(update={"together": TOGETHER})], "wiener")
    assert together is not None
    assert together.values["together_mistrust"] == TOGETHER.mistrust
    assert "fit-bank" in together.source


def test_classical_methods_name_the_numbers_they_work_by_and_what_those_were_tuned_on() -> None:
    lucy, admm = (stage_tuning([BANK], method) for method in ("rl", "admm-tv"))
    assert lucy is not None
    assert admm is not None
    assert lucy.values["rounds_per_snr"] == baselines.RL_ROUNDS_PER_SNR
    assert admm.values["tv_weight"] == baselines.TV_WEIGHT
    assert admm.values["iterations"] == baselines.ADMM_ITERATIONS
    for tuning in (lucy, admm):
        assert tuning.values["block_px"] == 64
        assert "prior_scale" not in tuning.values  # has no part in them
        assert tuning.captures.startswith(baselines.TUNED_ON)
        assert "ISO" in tuning.follows


def test_a_stage_that_says_nothing_itself_is_told_by_its_entry() -> None:
    glare = stage_tuning([Deglare(level=0.5)], "deglare")
    assert glare is not None
    assert glare.values["level"] == 0.5
    lights = stage_tuning([Highlights()], "physics")
    assert lights is not None
    assert (dict(lights.values), lights.captures) == ({}, NOT_RECORDED)
    assert stage_tuning([Linearise()], "wiener") is None
