"""Pictures that lie where the capture lies, so that both can be compared pixel by pixel."""

from typing import Any

from camkit.bundle.manifest import Manifest
from camkit.runtime.job.choices import known_options


def in_sensor_geometry(manifest: Manifest) -> dict[str, Any]:
    """Return the options by which a bundle's pictures stay in the geometry of its sensor."""
    return {"undistort": False} if "undistort" in known_options(manifest.stages) else {}
