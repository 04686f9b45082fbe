"""Lenses are found by name, and what is malformed is refused by name."""

from pathlib import Path

import pytest

from camkit.calibration.lensfun.database import Database
from camkit.errors import DecodeError
from tests.lensfun_factory import TERMS, ZOOM, write_database


def test_a_lens_is_found_with_and_without_its_maker(tmp_path: Path) -> None:
    database = Database(write_database(tmp_path))
    for name in (ZOOM, f"  example {ZOOM.upper()} "):
        (lens,) = database.find(name)
        assert {one.focal_mm: one.terms for one in lens.distortion} == TERMS
        assert (lens.crop_factor, lens.aspect, lens.kind) == (1.0, 1.5, "rectilinear")
        assert len(lens.vignetting) == 3
    (small,) = database.find("Small 50mm")
    assert small.aspect == pytest.approx(4 / 3)
    assert (small.distortion[0].model, small.distortion[0].terms) == ("poly5", (-0.02, 0.004))


def test_a_lens_is_found_by_the_name_that_cameras_state(tmp_path: Path) -> None:
    stated = ZOOM.replace("f/", "F")
    assert stated != ZOOM
    assert Database(write_database(tmp_path)).find(stated)[0].name == ZOOM


def test_a_single_file_is_a_database(tmp_path: Path) -> None:
    assert Database(write_database(tmp_path) / "example.xml").find(ZOOM)


def test_cameras_are_known_by_maker_and_model(tmp_path: Path) -> None:
    database = Database(write_database(tmp_path))
    assert database.crop_factor("EXAMPLE", "box 2") == 1.5
    assert database.crop_factor("", "Box 2") == 1.5
    assert database.crop_factor("Other", "Box 2") is None
    assert database.crop_factor("", "") is None


def test_near_names_are_told(tmp_path: Path) -> None:
    database = Database(write_database(tmp_path))
    with pytest.raises(DecodeError, match=r"no lens 'Sharp 24-70mm'; near: Sharp 24-70mm f/2.8"):
        database.find("Sharp 24-70mm")
    with pytest.raises(DecodeError, match="none is near"):
        database.find("qqqq")
    # all the words, in whatever order
    with pytest.raises(DecodeError, match="near: Unmeasured 50mm"):
        database.find("50mm unmeas")
    with pytest.raises(DecodeError, match="none is near"):
        database.find("")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<distortion model="acm" focal="24" k1="1"/>', "the model 'acm' of distortion"),
        ('<distortion focal="24"/>', "the model '' of distortion"),
        ('<distortion model="poly3" focal="24" k1="x"/>', "k1 must be a number; got 'x'"),
        ('<distortion model="poly3" focal="24" k1="nan"/>', "k1 must be a number; got 'nan'"),
        ('<distortion model="poly3" focal="24" k1="1e300"/>', "k1 must be a number"),
        ('<distortion model="poly3" k1="0.1"/>', "focal must be a number; got None"),
        ('<distortion model="poly3" focal="-3" k1="0.1"/>', "focal must be > 0"),
        ('<vignetting model="pa" focal="3" k1="0.1"/>', "aperture must be a number"),
    ],
)
def test_a_malformed_entry_names_its_lens(tmp_path: Path, text: str, message: str) -> None:
    lens = f"<lens><model>Odd</model><calibration>{text}</calibration></lens>"
    database = Database(write_database(tmp_path, lens))
    with pytest.raises(DecodeError, match=f"example.xml, Odd: .*{message}|Odd: {message}"):
        database.find("Odd")


@pytest.mark.parametrize("aspect", ["0:3", "a:b", "1:", ""])
def test_an_aspect_that_is_none_is_refused(tmp_path: Path, aspect: str) -> None:
    lens = f"<lens><model>Odd</model><aspect-ratio>{aspect}</aspect-ratio></lens>"
    with pytest.raises(DecodeError, match="aspect-ratio"):
        Database(write_database(tmp_path, lens)).find("Odd")


def test_a_place_without_database_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DecodeError, match="neither a file nor a folder"):
        Database(tmp_path / "none")
    with pytest.raises(DecodeError, match="holds 0 XML files"):
        Database(tmp_path)
