"""The format pages are enough: a reader of 400 lines, written by one who read nothing else."""

import json
import zipfile
from typing import Any

import numpy as np
import pytest

from camkit.bundle.reader import built_in_bundles
from tools.portable_table import READERS, load_example

READER = READERS / "page_reader.py"


@pytest.fixture(scope="module", name="reader")
def fixture_reader() -> Any:
    return load_example("page_reader")


@pytest.mark.parametrize("name", ["duet", "duet-joint"])
def test_golden_cases_are_met_from_the_pages_alone(reader: Any, name: str) -> None:
    path = built_in_bundles()[name]
    with zipfile.ZipFile(path) as bundle:
        cases = json.loads(bundle.read("manifest.json"))["golden"]
    for case in cases:
        picture, stored, allowed = reader.develop(path, case["name"], "S")
        assert np.abs(picture - stored).max() <= allowed, case["name"]


@pytest.mark.parametrize("name", ["trio-edof", "thin-plate", "deglare", "streak-hdr", "spad-sr"])
def test_other_cameras_are_refused_by_name(reader: Any, name: str) -> None:
    with pytest.raises(SystemExit, match=f"{name} is not covered"):
        reader.develop(built_in_bundles()[name], "typical", "S")


def test_the_reader_has_400_lines_and_knows_no_camkit() -> None:
    lines = READER.read_text().splitlines()
    assert len(lines) <= 400
    assert max(map(len, lines)) <= 100
    imports = [line for line in lines if line.startswith(("import", "from"))]
    packages = {line.split()[1].partition(".")[0] for line in imports}
    assert packages == {"json", "sys", "zipfile", "types", "numpy", "onnxruntime", "scipy"}
