from pathlib import Path

import pytest

from camkit.bundle.reader import Bundle
from camkit.colorimetry import decode_srgb
from camkit.report.peers import PEERS
from camkit.report.quality import Shot, expose
from camkit.report.tuning import Trial, choose, try_peers, tuned_from_json, tuned_to_json
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


def trial(value: float, psnr_db: float, iso: float = 100.0) -> Trial:
    return Trial(peer="admm_tv", iso=iso, value=value, psnr_db=psnr_db)


def test_the_value_with_the_best_mean_is_chosen_for_each_iso() -> None:
    trials = [trial(1, 20), trial(1, 30), trial(2, 26), trial(2, 26), trial(1, 5, 1600)]
    tuned, curves = choose(trials)
    assert tuned == {"admm_tv": {100.0: 2, 1600.0: 1}}
    assert curves["admm_tv"]["100"] == {"1": 25.0, "2": 26.0}


def test_tuned_values_survive_json() -> None:
    tuned = {"admm_tv": {100.0: 0.3, 1600.0: 3.0}}
    assert tuned_from_json(tuned_to_json(tuned)) == tuned


def test_every_candidate_is_tried_on_a_capture(bundle: Bundle) -> None:
    shot = Shot(set_name="s", picture=Path("a"), number=0, position=0, iso=100.0, psf="bundle")
    exposed = expose(shot, decode_srgb(texture(96, 96)), bundle, bundle.psf)
    trials = try_peers(exposed, bundle, ["skimage_wiener"])
    assert tuple(t.value for t in trials) == PEERS["skimage_wiener"].candidates
    assert len({t.psnr_db for t in trials}) == len(trials)
