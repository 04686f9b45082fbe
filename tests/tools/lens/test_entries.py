"""Every distortion of a lensfun database is converted exactly, or refused by name."""

from pathlib import Path

from camkit.calibration.lensfun.database import Database
from tests.data_folder import data_path
from tests.lensfun_factory import write_database
from tools.lens.entries import summarise

EXACT_PX = 0.05


def test_entries_are_counted_and_those_that_fold_named(tmp_path: Path) -> None:
    found = summarise(Database(write_database(tmp_path)), warped=True)
    assert (found.entries, found.converted) == (5, 4)
    assert [line.split(":")[0] for line in found.refused] == ["Folding 8mm, 8 mm"]
    assert found.worst_px < EXACT_PX
    assert found.worst_warped_px is not None
    assert 0 < found.worst_warped_px < EXACT_PX


def test_every_entry_of_the_real_database_is_exact_or_refused() -> None:
    found = summarise(Database(data_path("lens/lensfun_db")))
    assert found.entries > 5000
    assert found.converted == found.entries - len(found.refused)
    assert len(found.refused) < 0.002 * found.entries
    assert found.worst_px <= EXACT_PX
