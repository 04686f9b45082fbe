"""Every bundle that is built in proves itself, so that no change of the runtime passes unseen."""

import pytest

from camkit.bundle.reader import built_in_bundles
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work


@pytest.mark.parametrize("name", sorted(built_in_bundles()))
def test_a_built_in_bundle_gives_what_it_was_stored_with(name: str) -> None:
    report = check_bundle(built_in_bundles()[name], "golden", run=case_work, threads=1)
    assert report.passed, report.lines()
    states = {layer.name: layer.status for layer in report.layers}
    assert states["schema"] == states["hash"] == "pass"
