"""Cameras without a bank or without networks are stressed by what means something to them."""

from pathlib import Path

from camkit.report.stress.scenario import all_scenarios, choose
from camkit.report.stress.score import judge_of
from camkit.report.stress.stress_run import StressOptions, run_stress
from tests.plain_bundle import SIZES, write_bankless_bundle, write_networkless_bundle


def test_without_a_bank_networks_of_any_name_stand_against_the_input(tmp_path: Path) -> None:
    bundle = write_bankless_bundle(tmp_path)
    judge = judge_of(bundle, bundle.manifest.sizes, None)
    assert judge.methods == ("input", *SIZES)
    assert (judge.rivals, judge.primary) == (("input",), SIZES[0])
    options = StressOptions(
        scenarios=choose("bit_depth,known_depth,fp16_range"), scenes=1, quick=True
    )
    rows = {row["scenario"]: row for row in run_stress(bundle, options).rows}
    assert rows["bit_depth"]["psnr_db"].keys() == {"input", *SIZES}
    assert rows["fp16_range"]["extra"]["max_activation"].keys() == set(SIZES)
    assert "asks for a depth" in rows["known_depth"]["skipped"]


def test_without_networks_the_bank_is_judged(tmp_path: Path) -> None:
    bundle = write_networkless_bundle(tmp_path)
    judge = judge_of(bundle, (), None)
    assert (judge.methods, judge.rivals) == (("input", "wiener"), ("input",))
    options = StressOptions(scenarios=choose("bit_depth,tile_seams"), scenes=1, quick=True)
    result = run_stress(bundle, options)
    rows = {row["scenario"]: row for row in result.rows}
    assert result.primary == "wiener"
    assert {found["method"] for found in rows["bit_depth"]["breaks"]} == {"wiener"}
    assert rows["tile_seams"]["skipped"] == "it holds no network"


def test_scenarios_ask_what_a_bundle_states_and_never_its_kind(tmp_path: Path) -> None:
    bundle = write_networkless_bundle(tmp_path)
    manifest = bundle.manifest.model_copy(update={"kind": "of somebody else"})
    stranger = bundle.__class__(
        path=bundle.path, manifest=manifest, _container=bundle._container, _optics=bundle._optics
    )
    for scenario in all_scenarios():
        assert scenario.applies(bundle) == scenario.applies(stranger), scenario.name
