from pathlib import Path

import pytest

from camkit.bundle.reader import Bundle
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError
from camkit.report.quality import Shot
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle
from tools.comparison.peers import PEERS, Setting
from tools.comparison.photograph import photograph
from tools.comparison.tuning import (
    Trial,
    at_edge,
    choose,
    try_peers,
    tuned_from_json,
    tuned_to_json,
)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


def trial(setting: Setting, psnr_db: float, iso: float = 100.0) -> Trial:
    return Trial(peer="admm_tv", iso=iso, setting=setting, psnr_db=psnr_db)


def test_the_setting_with_the_best_mean_is_chosen_for_each_iso() -> None:
    weak, strong = (1.0, 8.0), (2.0, 8.0)
    trials = [trial(weak, 20), trial(weak, 30), trial(strong, 26), trial(strong, 26)]
    tuned, curves = choose([*trials, trial(weak, 5, 1600)])
    assert tuned == {"admm_tv": {100.0: strong, 1600.0: weak}}
    assert curves["admm_tv"]["100"] == {
        "weight 1, iterations 8": 25.0,
        "weight 2, iterations 8": 26.0,
    }


def test_a_choice_at_the_edge_names_its_parameter() -> None:
    weights, iterations = PEERS["admm_tv"].candidates
    assert at_edge("admm_tv", (weights[1], iterations[-1])) == ["iterations"]
    assert at_edge("admm_tv", (weights[0], iterations[1])) == ["weight"]
    assert at_edge("admm_tv", (weights[1], iterations[1])) == []


def test_tuned_settings_survive_json() -> None:
    tuned = {"admm_tv": {100.0: (0.3, 8.0), 1600.0: (3.0, 16.0)}, "skimage_rl": {100.0: (12.0,)}}
    table = tuned_to_json(tuned)
    assert table["admm_tv"]["1600"] == {"weight": 3.0, "iterations": 16.0}
    assert tuned_from_json(table) == tuned


@pytest.mark.parametrize(
    "table",
    [
        {"admm_tv": {"100": 3.0}},
        {"admm_tv": {"100": {"weight": 3.0}}},
        {"magic": {"100": {"x": 1}}},
    ],
)
def test_parameters_of_another_protocol_are_refused(table: dict[str, dict[str, object]]) -> None:
    with pytest.raises(ContractError, match="tune again"):
        tuned_from_json(table)


def test_every_setting_is_tried_on_a_capture(bundle: Bundle) -> None:
    shot = Shot(set_name="s", picture=Path("a"), number=0, position=0, iso=100.0, psf="bundle")
    taken = photograph(shot, decode_srgb(texture(96, 96)), bundle, bundle.frozen_optics)
    trials = try_peers(taken, bundle, ["skimage_wiener"])
    assert tuple(t.setting for t in trials) == PEERS["skimage_wiener"].settings
    assert len({t.psnr_db for t in trials}) == len(trials)
