import logging
import re
from pathlib import Path

import pytest

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.lens_file.lens_file import read_lens, write_lens
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.optics_file import read_optics
from camkit.models_def.optics.prescription import read_prescription
from tests.zmx_factory import LA1131

DUET = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions" / "duet.toml"


@pytest.mark.parametrize("name", ["lens.toml", "lens.zmx", "lens.ZMX", "lens.json"])
def test_suffix_decides_the_format(tmp_path: Path, name: str) -> None:
    lens = read_prescription(DUET)
    write_lens(lens, tmp_path / name)
    assert read_lens(tmp_path / name) == lens


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedError, match=r"\.toml or \.zmx or \.json; got lens\.seq"):
        read_lens(tmp_path / "lens.seq")


def test_what_is_left_out_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "lens.zmx"
    path.write_text(LA1131.replace("VCYN 0 0", "VCYN 0 0.2"), encoding="utf-8")
    with caplog.at_level(logging.WARNING):
        read_lens(path)
    assert "vignetting factors VCYN left out" in caplog.text


def test_a_lens_is_frozen_with_the_glasses_that_are_chosen(tmp_path: Path) -> None:
    path = tmp_path / "lens.toml"
    path.write_text(re.sub(r'glass = "(?!air)[^"]*"', 'glass = "F2"', DUET.read_text()))
    with pytest.raises(ContractError, match="F2-Schott or F2-Hikari"):
        read_optics(path)
    optics = read_optics(path, catalogue="hikari")
    assert isinstance(optics, LensOptics)
    assert optics.lens == read_lens(path, catalogue="hikari")
    assert {s.glass for s in optics.lens.surfaces} == {"air", "F2-Hikari"}
