"""The tiny bundle with a sensor large enough for pictures whose borders are cut."""

from pathlib import Path

from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from tests.bundle_factory import tiny_camera, tiny_manifest, tiny_members


def write_wide_bundle(folder: Path, name: str = "wide.camkit") -> Bundle:
    """Write and open the tiny bundle with 320 x 240 pixels."""
    camera = tiny_camera().model_copy(update={"width_px": 320, "height_px": 240})
    path = folder / name
    write_bundle(path, tiny_manifest().model_copy(update={"camera": camera}), tiny_members())
    return open_bundle(path)
