"""The tiny bundle with a sensor large enough for pictures whose borders are cut."""

from pathlib import Path

from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_sensor


def write_wide_bundle(folder: Path, name: str = "wide.camkit") -> Bundle:
    """Write and open the tiny bundle with 320 x 240 pixels."""
    path = folder / name
    write_bundle(path, tiny_manifest(sensor=tiny_sensor(320, 240)), tiny_members())
    return open_bundle(path)
