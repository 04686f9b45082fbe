"""A camera body is read from TOML, holds for its own bundle only, and says what is wrong."""

from pathlib import Path

import pytest

from camkit.bundle.reader import open_bundle
from camkit.errors import ContractError
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.stage_finder import stage_module
from camkit.runtime.unit import Unit, read_unit
from tests.bundle_factory import write_tiny_bundle
from tests.job_factory import made_mosaic

HASH = "0123456789abcdef" * 4


def _written(folder: Path, text: str) -> Path:
    path = folder / "body 17.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_unit_is_what_its_file_says(tmp_path: Path) -> None:
    text = f'bundle_sha256 = "{HASH}"\nname = "my body"\n[facts]\nfocus_um = 12.5\nturns = 3\n'
    unit = read_unit(_written(tmp_path, text))
    assert unit == Unit(name="my body", bundle_sha256=HASH, facts={"focus_um": 12.5, "turns": 3.0})


def test_a_unit_without_a_name_has_that_of_its_file(tmp_path: Path) -> None:
    unit = read_unit(_written(tmp_path, f'bundle_sha256 = "{HASH}"\n'))
    assert (unit.name, dict(unit.facts)) == ("body 17", {})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "bundle_sha256 must be the hash of a bundle; got None"),
        ('bundle_sha256 = "abc"', "must be the hash of a bundle"),
        (f'bundle_sha256 = "{HASH.upper()}"', "must be the hash of a bundle"),
        (f'bundle_sha256 = "{HASH}"\nlens = 1', r"unknown key\(s\) lens"),
        (f'bundle_sha256 = "{HASH}"\nname = 3', "name must be text"),
        (f'bundle_sha256 = "{HASH}"\nfacts = 3', "facts a table"),
        (f'bundle_sha256 = "{HASH}"\n[facts]\na = "b"', r"facts\.a must be a number; got 'b'"),
        (f'bundle_sha256 = "{HASH}"\n[facts]\na = true', r"facts\.a must be a number; got True"),
        ("no toml at all", "is no TOML"),
    ],
)
def test_what_is_no_unit_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        read_unit(_written(tmp_path, text))


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="cannot read the unit"):
        read_unit(tmp_path / "absent.toml")


def test_a_unit_of_another_bundle_is_refused_before_any_work(tmp_path: Path) -> None:
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    other = Unit(name="body", bundle_sha256=HASH)
    with pytest.raises(ContractError, match=rf"sha256 {HASH[:16]}, this is {bundle.sha256[:16]}"):
        Pipeline(bundle, Options(unit=other))
    own = Unit(name="body", bundle_sha256=bundle.sha256)
    work = Pipeline(bundle, Options(unit=own)).start(made_mosaic())
    assert work.origin.unit is own
    assert (work.origin.bundle, work.origin.bundle_sha256) == ("tiny", bundle.sha256)
    assert (work.origin.metadata.iso, work.origin.white_balance) == (100.0, work.white_balance)


def test_facts_that_no_stage_knows_are_refused_by_name(tmp_path: Path) -> None:
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    unit = Unit(name="body", bundle_sha256=bundle.sha256, facts={"focus_um": 2.0, "turns": 1.0})
    with pytest.raises(
        ContractError,
        match=r"states focus_um, turns, which no stage of bundle tiny knows; .*known are: none",
    ):
        Pipeline(bundle, Options(unit=unit))


def test_facts_that_a_stage_knows_are_taken_and_near_misses_suggested(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stage_module("wiener"), "FACTS", ("focus_um",), raising=False)
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    own = Unit(name="body", bundle_sha256=bundle.sha256, facts={"focus_um": 2.0})
    assert Pipeline(bundle, Options(unit=own)).options.unit is own
    near = Unit(name="body", bundle_sha256=bundle.sha256, facts={"focus_mm": 2.0})
    with pytest.raises(ContractError, match=r"did you mean focus_um\? known are: focus_um"):
        Pipeline(bundle, Options(unit=near))
