"""The metadata of a photograph, all fields stated."""

import pytest

from camkit.runtime.metadata import Metadata

FULL = Metadata(
    make="Müller",
    model="Kamera 7",
    lens_make="Ångström",
    lens_model="AF 24-105mm f/4",
    artist="Zoë",
    copyright="© Zoë 2024",
    captured_at="2024:05:06 07:08:09",
    utc_offset="-03:30",
    exposure_time_s=1 / 640,
    f_number=6.3,
    iso=3200.0,
    focal_length_mm=129.0,
    latitude_deg=-33.856784,
    longitude_deg=151.215297,
    altitude_m=-12.5,
)


def assert_like(found: Metadata, expected: Metadata, rel: float = 1e-6) -> None:
    """Compare text exactly and numbers nearly."""
    mine, wanted = found.to_json(), expected.to_json()
    assert mine.keys() == wanted.keys()
    for name, value in wanted.items():
        assert mine[name] == (value if isinstance(value, str) else pytest.approx(value, rel=rel))
