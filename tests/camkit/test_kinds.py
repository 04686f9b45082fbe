"""Kinds of cameras are found by name: camkit's own, and those of installed packages."""

import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from camkit import kinds
from camkit.bundle.sensor import Sensor
from camkit.bundle.stages.register import BUILT_IN, type_of
from camkit.errors import ContractError, UnsupportedError
from camkit.kinds import BAYER, KINDS, find_kind
from tests import installed_package

PACKAGE = "camkit_kind_for_this_test"
SOURCE = f"""
from camkit.kinds import Kind

MINE = Kind(
    name="mine", title="", sensor="planes", stages=(), metrics=(), home="{PACKAGE}"
)
HOMELESS = Kind(name="homeless", title="", sensor="planes", stages=(), metrics=())
NO_KIND = "a word"
"""


@pytest.fixture(name="installed")
def installed_kinds(tmp_path: Path) -> Iterator[Path]:
    """A package of somebody else with entry points, some of them wrong."""
    package = tmp_path / PACKAGE
    package.mkdir()
    (package / "__init__.py").write_text(SOURCE, encoding="utf-8")
    (package / "models_def.py").write_text("FLOOR = 'design'\n", encoding="utf-8")
    (package / "report.py").write_text("import nothing_of_this_name\n", encoding="utf-8")
    points = {
        "mine": f"{PACKAGE}:MINE",
        "yours": f"{PACKAGE}:MINE",
        "homeless": f"{PACKAGE}:HOMELESS",
        "word": f"{PACKAGE}:NO_KIND",
        "missing": f"{PACKAGE}:GONE",
        "absent": "package_that_is_not_there:KIND",
    }
    with installed_package.installed(tmp_path, PACKAGE, {kinds.GROUP: points}):
        yield package


def test_kinds_of_camkit_name_sensors_and_stages_that_there_are() -> None:
    known = set(map(type_of, BUILT_IN))
    types = {member.model_fields["type"].default for member in _members(Sensor)}
    for name, kind in KINDS.items():
        assert kind.name == name
        assert kind.sensor in types
        assert set(kind.stages) <= known
        assert find_kind(name) is kind


def _members(union: object) -> tuple[type, ...]:
    return union.__origin__.__args__  # type: ignore[attr-defined, no-any-return]


def test_unknown_kind_is_refused_naming_those_there_are(installed: Path) -> None:
    with pytest.raises(
        UnsupportedError, match=r"no kind of camera 'plate' here; there are: .*bayer.*mine"
    ):
        find_kind("plate")


def test_kind_of_an_installed_package_is_found_with_its_parts(installed: Path) -> None:
    kind = find_kind("mine")
    assert kind.home == PACKAGE
    assert kind.part("models_def").__dict__["FLOOR"] == "design"


def test_part_that_is_missing_is_refused_by_name(installed: Path) -> None:
    with pytest.raises(UnsupportedError, match=rf"no part in runtime: add .*{PACKAGE}\.runtime"):
        find_kind("mine").part("runtime")
    with pytest.raises(UnsupportedError, match=r"camkit\.runtime\.kinds\.nobody"):
        kinds.Kind(name="nobody", title="", sensor="bayer", stages=(), metrics=()).part("runtime")


def test_part_that_cannot_be_imported_says_why(installed: Path) -> None:
    with pytest.raises(ContractError, match=r"'mine' cannot be loaded .*nothing_of_this_name"):
        find_kind("mine").part("report")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("yours", "must be a camkit Kind called 'yours' with a home"),
        ("homeless", "must be a camkit Kind called 'homeless' with a home"),
        ("word", "must be a camkit Kind called 'word'"),
        ("missing", "cannot be loaded from .*GONE"),
        ("absent", "cannot be loaded from .*package_that_is_not_there"),
    ],
)
def test_entry_point_that_is_no_kind_is_refused(name: str, message: str, installed: Path) -> None:
    with pytest.raises(ContractError, match=message):
        find_kind(name)


def test_nobody_takes_the_name_of_a_kind_of_camkit(installed: Path) -> None:
    points = {kinds.GROUP: {"bayer": f"{PACKAGE}:MINE"}}
    with installed_package.installed(installed.parent, PACKAGE, points):
        assert find_kind("bayer") is BAYER


def test_doctor_lists_kinds_of_packages_and_why_one_is_refused(installed: Path) -> None:
    states = kinds.kinds_of_packages()
    assert "have no part in runtime" in states["mine"]
    assert "with a home" in states["homeless"]
    (installed / "runtime.py").write_text("", encoding="utf-8")
    importlib.invalidate_caches()
    assert kinds.kinds_of_packages()["mine"] == "ready"
