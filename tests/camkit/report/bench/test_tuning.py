"""Every method of a bench is named with how it was tuned, once."""

from pathlib import Path

from camkit.bundle.reader import open_bundle
from camkit.report.bench.tuning import tuning_table
from tests.bench_factory import make_trial
from tests.bundle_factory import write_tiny_bundle

PLAIN = {"size": None, "mode": None, "dtype": None, "provider": None}


def test_networks_are_told_by_their_manifest_and_methods_by_their_stage(tmp_path: Path) -> None:
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    trials = [
        make_trial(),
        make_trial(threads=1),  # the same network
        make_trial(bundle="rival"),
        make_trial(maker="classical", method="rl", **PLAIN),
        make_trial(maker="develop", method="develop", path=None, **PLAIN),
    ]
    found = tuning_table(trials, {"duet": bundle, "rival": bundle})
    assert [(t["bundle"], t["method"], t["size"]) for t in found] == [
        ("duet", "net", "M"),
        ("rival", "net", "M"),
        ("duet", "rl", None),
        ("duet", "develop", None),
    ]
    assert found[0]["captures"] == bundle.manifest.training_data == "untrained"
    assert found[0]["source"] == "weights in tiny 1.0.0, restore"
    assert found[0]["values"]["parameters"] > 0
    assert found[2]["values"]["most_rounds"] == 80
    assert (found[3]["values"], found[3]["captures"]) == ({}, "none")
