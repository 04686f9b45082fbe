"""A bundle of format 2.0 as it was written when the format was new: it opens and proves itself."""

from pathlib import Path

import pytest

from camkit.bundle.reader import open_bundle
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work
from tests.toy_camera.install import toy_installed  # noqa: F401

EXAMPLE = Path(__file__).resolve().parents[2] / "data" / "example-2.0.camkit"


def test_it_opens_without_the_package_of_its_kind() -> None:
    manifest = open_bundle(EXAMPLE).manifest
    assert (manifest.format_version, manifest.kind) == ("2.0", "toy")
    assert [stage.type for stage in manifest.stages] == [
        *("linearise", "repair", "network", "network", "color")
    ]
    assert manifest.planes["fine"].grid.pitch_ratio == 0.5
    assert manifest.sensor.channels == ("Y",)


@pytest.mark.usefixtures("toy_installed")
def test_it_gives_the_pictures_that_it_gave() -> None:
    report = check_bundle(EXAMPLE, run=case_work)
    assert [layer.status for layer in report.layers] == [*["pass"] * 6, "skip"], report.lines()
