"""Programs that develop, with one that burns a known CPU time, and camkit's own."""

import sys
from pathlib import Path
from typing import Any

import pytest

from camkit.errors import ContractError
from tools.memory import Captures
from tools.methods import developers
from tools.methods.developers import CAMKIT, Developer, time_developers

START_S, EACH_S = 0.2, 0.1
BURN = "import sys, time\nwhile time.process_time() < float(sys.argv[1]): pass"


class Sized:
    """A capture that is its number of megapixels."""

    def __init__(self, folder: Path, bundle: str, megapixels: float) -> None:
        assert folder.is_dir()
        assert bundle == "duet"
        self.megapixels = megapixels


def _burning(captures: Any, folder: Path) -> list[str]:
    assert folder.is_dir()
    return [sys.executable, "-c", BURN, f"{START_S + EACH_S * captures.megapixels}"]


def test_a_megapixel_and_the_start_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    programs = {
        "burner": Developer(program=sys.executable, version=("--version",), words=_burning),
        "absent": Developer(program="no-such-program", version=(), words=_burning),
    }
    monkeypatch.setattr(developers, "DEVELOPERS", programs)
    monkeypatch.setattr(developers, "MEGAPIXELS", (1.0, 4.0))
    monkeypatch.setattr(developers, "Captures", Sized)
    told: list[str] = []
    (burner,) = time_developers("duet", 2, told.append)
    assert burner.title == "burner"
    assert burner.version.startswith("3.")
    assert burner.cpu_s_per_mp == pytest.approx(EACH_S, abs=0.04)
    assert burner.start_s == pytest.approx(START_S, abs=0.2)
    assert len(told) == 2


def test_a_program_that_fails_is_named_with_what_it_said() -> None:
    with pytest.raises(ContractError, match="failed: no such lens"):
        developers._cpu_s([sys.executable, "-c", "import sys; sys.exit('no such lens')"])


def test_camkit_develops_by_the_command_that_is_timed(tmp_path: Path) -> None:
    words = developers.DEVELOPERS[CAMKIT].words(Captures(tmp_path, "duet", 0.5), tmp_path / "out")
    assert developers._cpu_s(words) > 0
    assert (tmp_path / "out" / "photo.tif").is_file()
