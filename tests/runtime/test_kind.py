"""What the runtime knows of a kind of camera is found by its name, and must be a part."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from camkit import kinds
from camkit.errors import BundleError, ContractError, UnsupportedError
from camkit.kinds import KINDS
from camkit.runtime.kind import RuntimePart, part_of, runtime_part
from tests.bundle_factory import tiny_manifest
from tests.installed_package import installed

PACKAGE = "camkit_kind_of_runtime_test"


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_of_camkit_walks_stages_and_has_a_twin(name: str) -> None:
    part = runtime_part(name)
    assert isinstance(part, RuntimePart)
    assert all(suffix.startswith(".") for suffix in part.suffixes)
    given = {plane for stage in part.stages for plane in stage.gives}
    assert set(part.products.values()) <= given


def test_a_kind_that_is_not_there_is_refused() -> None:
    with pytest.raises(
        UnsupportedError, match="there is no kind of camera 'dream' here; there are"
    ):
        runtime_part("dream")


@pytest.fixture
def package(tmp_path: Path) -> Iterator[Path]:
    """Give the folder of an installed kind, whose part of the runtime a test writes."""
    folder = tmp_path / PACKAGE
    folder.mkdir()
    (folder / "__init__.py").write_text(
        "from camkit.kinds import Kind\n"
        f"MINE = Kind(name='mine', title='', sensor='planes', stages=(), metrics=(), "
        f"home='{PACKAGE}')\n",
        encoding="utf-8",
    )
    with installed(tmp_path, PACKAGE, {kinds.GROUP: {"mine": f"{PACKAGE}:MINE"}}):
        yield folder


def test_an_installed_kind_brings_its_own_part(package: Path) -> None:
    (package / "runtime.py").write_text(
        "from camkit.runtime.kinds.bayer import PART as BAYER\n"
        "from dataclasses import replace\n"
        "PART = replace(BAYER, suffixes=('.mine',))\n",
        encoding="utf-8",
    )
    assert runtime_part("mine").suffixes == (".mine",)


def test_a_kind_without_a_part_of_the_runtime_says_what_to_add(package: Path) -> None:
    with pytest.raises(UnsupportedError, match=f"add the package {PACKAGE}.runtime"):
        runtime_part("mine")


@pytest.mark.parametrize("text", ["", "PART = 'a word'\n"])
def test_a_module_without_a_part_is_named(package: Path, text: str) -> None:
    (package / "runtime.py").write_text(text, encoding="utf-8")
    with pytest.raises(ContractError, match=rf"{PACKAGE}\.runtime must define PART"):
        runtime_part("mine")


def test_a_bundle_of_a_kind_that_is_not_there_is_refused_by_name() -> None:
    assert part_of(tiny_manifest()) is runtime_part("bayer")
    with pytest.raises(BundleError, match="bundle tiny cannot be used here: there is no kind"):
        part_of(tiny_manifest(kind="dream"))
