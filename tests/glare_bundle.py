"""A bundle that is no camera: it takes captures of any, and states no optics."""

from pathlib import Path

from camkit.bundle.stages import Deglare
from camkit.bundle.writer import write_bundle
from tools.hdr.glare_bundle import _manifest


def write_glare_bundle(folder: Path) -> Path:
    """Write the bundle that removes glare, without its golden cases."""
    return write_bundle(folder / "deglare.camkit", _manifest(Deglare(takes=("rgb",))), {}).path
