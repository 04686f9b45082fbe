"""A camera of an ordinary lens: distortion and illumination by a lens profile, no kernels."""

from typing import Any

from camkit.bundle.chain import rewired
from camkit.bundle.manifest import Manifest
from camkit.bundle.optics import IlluminationEntry, LensProfile, RadialEntry
from camkit.bundle.stages import Stage
from tests.bundle_factory import tiny_manifest, tiny_stages


def tiny_profile(**changes: Any) -> LensProfile:
    """Give the profile of a lens with odd and even powers, for the tiny sensor."""
    fields: dict[str, Any] = {
        "distortion": RadialEntry(
            coefficients=((1.02, -0.03, 0.0, 0.0),) * 3,
            even_coefficients=((0.01, 0.004, 0.0),) * 3,
            radius_mm=0.35,
        ),
        "illumination": IlluminationEntry(
            heights_mm=(0.0, 0.2, 0.4), relative_illumination=(1.0, 0.9, 0.6)
        ),
    }
    return LensProfile(**(fields | changes))


def profile_stages() -> tuple[Stage, ...]:
    """Give the stages of a camera without kernels: what needs none."""
    kept = [stage for stage in tiny_stages() if stage.type not in ("wiener", "network")]
    return rewired(kept, tiny_stages())


def profile_manifest(**changes: Any) -> Manifest:
    """Give its manifest; it has no members."""
    fields: dict[str, Any] = {
        "format_version": "2.6",
        "optics": tiny_profile(),
        "stages": profile_stages(),
        "networks": {},
        "golden": (),
    }
    return tiny_manifest(**(fields | changes))
