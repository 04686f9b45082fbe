"""Stages are found by type: those of camkit, and those of packages that are installed."""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camkit
from camkit.bundle.manifest import Manifest, format_of, manifest_to_bytes, read_manifest
from camkit.bundle.reader import open_bundle
from camkit.bundle.stages import Wiener, all_stages, find_stage, type_of
from camkit.bundle.stages.register import BUILT_IN, GROUP
from camkit.bundle.writer import write_bundle
from camkit.cli.app import run
from camkit.cli.judge.doctor import examine
from camkit.errors import BundleError, UnsupportedError
from camkit.runtime.stage_finder import all_methods, known_facts, methods_of, stage_module
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_stages
from tests.installed_package import Points, installed

PACKAGE = "stages-for-this-test"
HOME = "stages_for_this_test"
ENTRIES = f'''
from typing import ClassVar, Literal

from camkit.bundle.entry import Positive, Since
from camkit.bundle.stages import PackageStage, StageEntry


class Dim(PackageStage):
    """Light times a factor."""

    runtime: ClassVar = "{HOME}.work"
    type: Literal["dim"] = "dim"
    package: Literal["{PACKAGE}"] = "{PACKAGE}"
    takes: tuple[str, ...] = ("rgb",)
    gives: tuple[str, ...] = ("dimmed",)
    factor: Positive = 0.5

    def join(self, planes, parts):
        return tuple(planes)


class Homeless(Dim):
    runtime: ClassVar = ""
    type: Literal["homeless"] = "homeless"


class Named(Dim):
    type: Literal["wiener"] = "wiener"


class Built(StageEntry):
    """No stage of a package: it does not name it."""

    runtime: ClassVar = "{HOME}.work"
    type: Literal["broken"] = "broken"
'''
WORK = """
from camkit.runtime.job.stage_work import StageWork

METHODS = ("dimmer",)
OPTIONS = ()
FACTS = ("lamp",)


def prepare(entry, job):
    def run(taken):
        dimmed = (entry.factor * band for band in taken[0].bands())
        return (taken[0].with_bands(dimmed),)

    return StageWork(run=run, held_bytes=0)


def seconds(entry, subject, work, speed):
    return 0.0
"""
POINTS: Points = {
    GROUP: {
        "dim": f"{HOME}.entries:Dim",
        "broken": f"{HOME}.entries:Built",
        "wiener": f"{HOME}.entries:Named",
        "other": f"{HOME}.entries:Dim",
        "homeless": f"{HOME}.entries:Homeless",
        "gone": "nowhere_at_all:Dim",
    }
}


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """Return a folder with the package, not installed."""
    site = tmp_path / "site"
    (site / HOME).mkdir(parents=True)
    for name, source in (("__init__", ""), ("entries", ENTRIES), ("work", WORK)):
        (site / HOME / f"{name}.py").write_text(source, encoding="utf-8")
    return site


@pytest.fixture
def package(site: Path) -> Iterator[Path]:
    with installed(site, PACKAGE, POINTS):
        yield site


def _manifest(factor: float = 0.5, **changes: Any) -> Manifest:
    """Return the tiny camera without bank and network, its colours dimmed."""
    left_out = "wiener", "network", "raise_clipped", "illumination", "undistort", "color"
    dim, color = find_stage("dim")(factor=factor), tiny_stages()[-1]
    stages = (*tiny_stages(*left_out), dim, color.model_copy(update={"takes": dim.gives}))
    stated = {"format_version": format_of(None, stages), "networks": {}, "golden": ()}
    return tiny_manifest(stages=stages, **(stated | changes))


def _write(folder: Path, **changes: Any) -> Path:
    path = folder / "dim.camkit"
    write_bundle(path, _manifest(**changes), {"psf.safetensors": tiny_members()["psf.safetensors"]})
    return path


def _with_stage(**changes: Any) -> bytes:
    """Return the bytes of a manifest whose stage of the package says something else."""
    document = json.loads(manifest_to_bytes(_manifest()))
    stage = next(stage for stage in document["stages"] if stage["type"] == "dim")
    stage |= changes
    return json.dumps(document).encode()


def test_a_stage_of_a_package_is_read_back_with_its_own_fields(package: Path) -> None:
    manifest = _manifest()
    assert manifest.format_version == "2.9"
    again = read_manifest(manifest_to_bytes(manifest))
    assert again == manifest
    assert manifest_to_bytes(again) == manifest_to_bytes(manifest)
    assert again.stages_of(find_stage("dim"))[0].model_dump()["factor"] == 0.5


def test_a_stage_of_a_package_is_walked_planned_and_checked(
    package: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = _write(tmp_path)
    capture = np.full((64, 96), 543, np.uint16)
    half = camkit.load(str(path)).process_array(capture, iso=100)
    whole = camkit.load(str(_write(tmp_path, factor=1.0))).process_array(capture, iso=100)
    np.testing.assert_allclose(half, 0.5 * whole, rtol=1e-3)
    assert run(["check", str(path)]) == 0
    assert "pass  schema" in capsys.readouterr().out


def test_methods_and_facts_of_packages_are_found(package: Path) -> None:
    stages = _manifest().stages
    assert methods_of(stages) == ("dimmer",)
    assert known_facts(stages) == ("lamp",)
    assert "dimmer" in all_methods()
    assert stage_module("dim").__name__ == f"{HOME}.work"


def test_a_bundle_whose_stage_no_package_brings_is_refused_by_name(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with installed(site, PACKAGE, POINTS):
        path = _write(tmp_path)
    with pytest.raises(
        BundleError,
        match=rf"stages.4: no installed package brings the stage 'dim'.*package '{PACKAGE}'",
    ):
        open_bundle(path)
    assert run(["check", str(path)]) == 3
    assert "no installed package brings the stage 'dim'" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"factor": 0}, "factor: Input should be greater than 0"),
        ({"surprise": 1}, "surprise: Extra inputs are not permitted"),
        ({"package": "another"}, "package: Input should be"),
        ({"takes": ["nothing"]}, r"stage 5 \(dim\) takes 'nothing'"),
        ({"type": "gone"}, "stage 'gone' cannot be loaded from 'nowhere_at_all:Dim'"),
        ({"type": "other"}, "must be a camkit PackageStage of the type 'other'"),
        ({"type": "broken"}, "must be a camkit PackageStage of the type 'broken'"),
        ({"type": "homeless"}, "names its runtime module"),
        ({"type": "nobody", "package": "a b"}, "there are: broken, color, .*wiener$"),
        ({"type": "Os.Path"}, "Os.Path"),
        ({"type": 3}, "type"),
    ],
)
def test_a_wrong_stage_of_a_package_is_refused(
    change: dict[str, Any], message: str, package: Path
) -> None:
    with pytest.raises(BundleError, match=f"breaks the schema of format 2.9: .*{message}"):
        read_manifest(_with_stage(**change))


def test_only_what_is_installed_is_imported(package: Path) -> None:
    data = _with_stage(type="antigravity")
    with pytest.raises(BundleError, match="no installed package brings the stage 'antigravity'"):
        read_manifest(data)
    assert "antigravity" not in sys.modules
    with pytest.raises(BundleError, match="runtime: Extra inputs"):
        read_manifest(_with_stage(runtime="antigravity"))


def test_nobody_takes_the_name_of_a_stage_of_camkit(package: Path) -> None:
    assert find_stage("wiener") is Wiener
    assert [type_of(entry) for entry in all_stages()].count("wiener") == 1
    told = examine()["stages_of_packages"]
    assert told["dim"] == "ready"
    assert "brings a stage 'wiener', which camkit has" in told["wiener"]


@pytest.mark.parametrize(
    ("work", "message"),
    [
        (None, "the stage 'dim' is not walked: there is no module"),
        ("import nowhere_at_all", "the stage 'dim' cannot be loaded from .*nowhere_at_all"),
        ("METHODS = (no_name,)", "the stage 'dim' cannot be loaded from .*no_name"),
        ("METHODS = ()", "of the stage 'dim' does not define prepare, OPTIONS"),
    ],
)
def test_doctor_says_what_the_module_of_a_stage_lacks(
    work: str | None, message: str, site: Path
) -> None:
    module = site / HOME / "work.py"
    module.unlink()
    if work is not None:
        module.write_text(work, encoding="utf-8")
    with installed(site, PACKAGE, POINTS):
        assert re.search(message, examine()["stages_of_packages"]["dim"])


def test_a_stage_names_the_distribution_that_brings_it(site: Path) -> None:
    with installed(site, "another-package", POINTS):
        state = examine()["stages_of_packages"]["dim"]
    assert state == f"the stage 'dim' says that {PACKAGE} brings it; it is another-package"


def test_a_plan_counts_no_seconds_for_a_stage_that_says_none(site: Path, tmp_path: Path) -> None:
    module = site / HOME / "work.py"
    module.write_text(WORK.split("def seconds", maxsplit=1)[0], encoding="utf-8")
    with installed(site, PACKAGE, POINTS):
        plan = camkit.load(str(_write(tmp_path))).plan(np.full((64, 96), 543, np.uint16))
    assert plan["plan"]["stages"]["dim"]["expected_s"] == 0
    assert plan["estimate"]["seconds"] > 0


def test_a_broken_package_hides_no_stage(package: Path) -> None:
    assert all_stages() == [*BUILT_IN, find_stage("dim")]


def test_a_stage_that_nobody_brings_is_refused_with_those_there_are(package: Path) -> None:
    with pytest.raises(UnsupportedError, match=r"stage 'dream'; there are: broken, color, .*dim"):
        find_stage("dream")


def test_a_stage_is_refused_in_a_format_that_did_not_know_it(package: Path, tmp_path: Path) -> None:
    with pytest.raises(
        BundleError, match=r"lists a stage of a package of its own, which format 2.9 brought"
    ):
        _write(tmp_path, format_version="2.8")


def test_bundles_without_such_stages_state_the_format_that_they_always_stated() -> None:
    bank = Wiener(prior_scale=1e-3, prior_exponent=2.0)
    assert format_of(None, tiny_stages()) == "2.4"
    assert format_of(None, [bank.model_copy(update={"depth": "estimated"})]) == "2.8"
