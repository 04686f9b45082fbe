"""Side files are regular, bounded in size and depth; every refusal is one line, and none hangs."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from camkit.bundle.psf_file import read_psf
from camkit.calibration.lensfun.xml import read_xml
from camkit.errors import CamkitError, ContractError
from camkit.models_def.optics.diffraction.plate import read_plate
from camkit.models_def.optics.glass.encoding import read_text
from camkit.models_def.optics.prescription import read_prescription
from camkit.models_def.toml_table import read_table
from camkit.runtime.kinds.spad.containers.stored_array import read_columns, read_map
from camkit.runtime.kinds.spad.files.npz import read_npz
from camkit.runtime.kinds.spad.timing import read_timing
from camkit.runtime.unit import read_unit
from camkit.side_file import MOST_DEPTH, parse_toml, read_side_toml

READERS: dict[str, Callable[[Path], object]] = {
    "timing": read_timing,
    "unit": read_unit,
    "irf": lambda path: read_columns(path, "the pulse"),
    "dark": lambda path: read_map(path, "the map"),
    "scene": read_npz,
    "plate": read_plate,
    "lens": read_prescription,
    "glass": read_text,
    "lensfun": read_xml,
    "psf": read_psf,
    "recipe": lambda path: read_table(path, "recipe"),
}


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _link_to_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def _link_to_pipe(path: Path) -> None:
    os.mkfifo(path.with_suffix(".pipe"))
    path.symlink_to(path.with_suffix(".pipe"))


def _loop(path: Path) -> None:
    path.symlink_to(path)


def _large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(10**12)


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("make", [_pipe, _link_to_device, _link_to_pipe, _loop, Path.mkdir, _large])
def test_what_is_no_small_regular_file_is_refused_at_once(
    reader: str, make: Callable[[Path], None], tmp_path: Path
) -> None:
    path = tmp_path / "side.toml"
    make(path)
    with pytest.raises(CamkitError) as refusal:
        READERS[reader](path)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 50_000,
        "a = " + "[" * 40 + "]" * 40,
        "a = " + "{a = " * 40 + "1" + "}" * 40,
        "[" + ".".join("a" * 40) + "]\n",
        ".".join("a" * 200_000) + " = 1\n",
        "x = {" + ".".join(["'a b'"] * 50) + " = 1}\n",
    ],
)
def test_deep_toml_is_refused_by_its_name(text: str) -> None:
    with pytest.raises(ContractError, match=f"nested too deep; expected at most {MOST_DEPTH}"):
        parse_toml(text.encode(), "the file")


def test_sound_toml_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text('a.b.c = [[1, 2], [3]]\ntext = "a.b.c.d"\n', encoding="utf-8")
    assert read_side_toml(path, "it") == {"a": {"b": {"c": [[1, 2], [3]]}}, "text": "a.b.c.d"}
