"""Verdicts on leads whose answer is known."""

import numpy as np
import pytest

from tools.tables.losses.overfitting import Lead, lead_of, overfitting, sentences, verdict_of

PAIRS = {
    "holds": ((7.5, 0.5), (-2.0, 0.5)),
    "partly": ((7.5, 0.5), (3.0, 0.5)),
    "fails": ((1.0, 0.5), (3.0, 0.5)),
    "behind": ((-2.0, 0.5), (-7.5, 0.5)),
    "untold": ((0.5, 0.5), (0.2, 0.5)),
}


@pytest.mark.parametrize(("verdict", "leads"), PAIRS.items())
def test_every_verdict_has_its_case(verdict, leads):
    home, abroad = (Lead(mean=mean, error=error) for mean, error in leads)
    assert verdict_of(home, abroad) == verdict
    wide = [Lead(mean=mean, error=10.0) for mean, _ in leads]
    assert verdict_of(*wide) == "untold"


def test_a_lead_at_home_alone_is_what_overfits():
    trails, leads = Lead(mean=-2.0, error=0.1), Lead(mean=2.0, error=0.1)
    assert verdict_of(trails, leads) == "fails"
    assert verdict_of(trails, trails) == "behind"
    assert verdict_of(trails, Lead(mean=0.1, error=0.1)) == "behind"


def test_errors_are_those_of_paired_samples():
    pictures = np.random.default_rng(0).normal(25, 5, 400)
    better = pictures + 1 + np.tile([0.1, -0.1], 200)
    lead = lead_of(better, pictures, range(400))
    assert lead.mean == pytest.approx(1)
    assert lead.error == pytest.approx(0.1 / 20, rel=0.01)
    assert lead.sure == 1
    assert lead_of([1.0], [0.0], [0]).sure == 0
    assert lead_of([1.0, 1.1], [0.0, 0.0], [7, 7]).sure == 0


def test_samples_of_a_frame_count_as_one_where_they_are_alike():
    frames = np.repeat(np.arange(8), 6)
    of_frame = np.random.default_rng(1).normal(0.3, 1, 8)
    lead = lead_of(of_frame[frames], np.zeros(48), frames)
    whole = lead_of(of_frame, np.zeros(8), range(8))
    assert (lead.mean, lead.error) == pytest.approx((whole.mean, whole.error))
    assert lead.error > 2 * lead_of(of_frame[frames], np.zeros(48), range(48)).error


def row(loss, lab, wild, network=("unet",)):
    spread = np.tile([0.01, -0.01], 8)

    def domain(level):
        names = {"psnr_db": 1, "ssim": 0.01, "perceptual": -0.1}
        each = {name: (share * level + spread).tolist() for name, share in names.items()}
        return {"each": each, "frames": list(range(16))}

    return {"loss": loss, "network": list(network), "lab": domain(lab), "wild": domain(wild)}


def test_supervised_rows_meet_those_of_their_own_network():
    rows = {
        "capture": {"lab": {}, "wild": {}},
        "supervised": row("l1", 30, 20),
        "adversarial": row("adversarial", 22, 24),
        "other": row("adversarial", 22, 24, network=("another",)),
    }
    (found,) = overfitting(rows)
    assert (found["supervised"], found["other"]) == ("supervised", "adversarial")
    assert {found[name]["verdict"] for name in ("psnr_db", "ssim", "perceptual")} == {"holds"}
    # less is better of what is perceived
    assert found["perceptual"]["lab"][0] == pytest.approx(0.8)
    assert "ahead by 8.000 +- 0.000 at home, -4.000" in sentences([found])[0]
    assert "no verdict" in sentences(overfitting({"supervised": rows["supervised"]}))[0]
