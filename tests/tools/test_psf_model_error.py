"""tools/psf_model_error.py on one lens: a row of the table of docs/lens.md."""

import pytest

from tests.tiny_design import run_tool
from tools import psf_model_error


def test_rays_are_wrong_by_what_the_document_says_where_the_spot_is_sharp(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(psf_model_error, "DIAMETERS_MM", (4.0,))
    monkeypatch.setattr(psf_model_error, "SHIFTS_MM", (0.0,))
    monkeypatch.setattr(psf_model_error, "FIELDS_DEG", (0.0,))
    monkeypatch.setattr(psf_model_error, "WINDOWS", ((2.0, 25),))
    run_tool(monkeypatch, "psf_model_error")
    head, row = (line.split() for line in capsys.readouterr().out.splitlines())
    assert head[:3] == ["RMS", "/", "Airy"]
    ratio, pitch_um, difference = map(float, row)
    assert (ratio, pitch_um) == (pytest.approx(0.6, abs=0.05), 2)
    assert 0.16 <= difference <= 0.22
