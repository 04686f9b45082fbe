"""A file of a database does no harm, whatever is in it."""

from pathlib import Path

import pytest

from camkit.calibration.lensfun import xml
from camkit.calibration.lensfun.xml import MOST_DEPTH, parse_xml, read_xml
from camkit.errors import DecodeError

BOMB = b"""<?xml version="1.0"?>
<!DOCTYPE lensdatabase [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>
<lensdatabase>&b;</lensdatabase>"""
OUTSIDE = b"""<!DOCTYPE lensdatabase [<!ENTITY x SYSTEM "file:///etc/hostname">]>
<lensdatabase>&x;</lensdatabase>"""
REFUSED = {
    "entities that grow": (BOMB, "document type of its own"),
    "a file from elsewhere": (OUTSIDE, "document type of its own"),
    "an unknown entity": (b"<lensdatabase>&x;</lensdatabase>", "no sound XML"),
    "an end too few": (b"<lensdatabase><lens>", "no sound XML"),
    "an encoding nobody knows": (b'<?xml version="1.0" encoding="foo"?><a/>', "no sound XML"),
    "nothing": (b"", "no sound XML"),
    "bytes": (bytes(range(256)), "no sound XML"),
    "depth": (b"<a>" * (MOST_DEPTH + 1) + b"</a>" * (MOST_DEPTH + 1), "nested too deep"),
}


@pytest.mark.parametrize(("data", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_sound_xml_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(DecodeError, match=message):
        parse_xml(data, "x.xml")


def test_the_document_type_of_lensfun_itself_is_taken() -> None:
    data = b'<!DOCTYPE lensdatabase SYSTEM "lensfun-database.dtd"><lensdatabase version="1"/>'
    assert parse_xml(data, "x.xml").get("version") == "1"


def test_files_too_large_or_of_another_kind_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x.xml"
    path.write_text("<html/>", encoding="utf-8")
    with pytest.raises(DecodeError, match="expected <lensdatabase>, got <html>"):
        read_xml(path)
    with pytest.raises(DecodeError, match="cannot read"):
        read_xml(tmp_path / "none.xml")
    monkeypatch.setattr(xml, "MOST_BYTES", 6)
    with pytest.raises(DecodeError, match="larger than 6 bytes"):
        read_xml(path)


def test_too_many_elements_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xml, "MOST_ELEMENTS", 10)
    with pytest.raises(DecodeError, match="too many"):
        parse_xml(b"<a>" + b"<b/>" * 10 + b"</a>", "x.xml")
