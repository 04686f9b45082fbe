import math
from dataclasses import replace

import pytest

from camkit.runtime.files.exr_attributes import exr_attributes, metadata_of_exr
from camkit.runtime.metadata import Metadata
from tests.metadata_factory import FULL, assert_like


def test_attributes_have_the_names_of_the_standard() -> None:
    found = exr_attributes(FULL)
    assert found["cameraMake"] == "Müller".encode()
    assert found["capDate"] == b"2024:05:06 07:08:09"
    assert found["utcOffset"] == 12600.0, "what is added to local time gives UTC"
    assert found["isoSpeed"] == 3200.0
    assert len(found) == len(FULL.to_json()) - 1, "the artist has no attribute"
    assert exr_attributes(Metadata()) == {}


def test_a_header_comes_back_as_the_metadata() -> None:
    header = {k: v.decode() if isinstance(v, bytes) else v for k, v in exr_attributes(FULL).items()}
    assert_like(metadata_of_exr(header), replace(FULL, artist=""))


@pytest.mark.parametrize("seconds", [math.nan, math.inf, 1e30, -1e6, "3600"])
def test_offsets_that_no_place_has_are_none(seconds: object) -> None:
    assert metadata_of_exr({"utcOffset": seconds, "isoSpeed": "fast"}) == Metadata()
