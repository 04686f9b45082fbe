"""Facts that the tags of a RAW file state beyond LibRaw: noise profile, place, camkit's own.

Nothing here raises on odd values: a tag that is missing or not believable becomes None.
Tag numbers and meanings: DNG specification 1.7, chapter 4; Exif 2.32, section 4.6.
"""

import json
import re
from dataclasses import dataclass, fields
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from camkit.cfa import CfaPattern, cfa_channels
from camkit.noise import NoiseModel
from camkit.runtime.files.raw_checks import sensor_directories
from camkit.runtime.files.tiff_tags import TiffTags
from camkit.runtime.metadata import Metadata, clean_text

BITS_PER_SAMPLE: Final = 258
IMAGE_DESCRIPTION: Final = 270
UNIQUE_CAMERA_MODEL: Final = 50708
CFA_PLANE_COLOR: Final = 50710
NOISE_PROFILE: Final = 51041

_BUNDLE_IN_MODEL: Final = re.compile(r"camkit ([A-Za-z0-9_.-]{1,64})")


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorPlace:
    """Records that camkit leaves in a capture of its own; all None for other files.

    Attributes are those of a `Capture`.
    """

    bundle_name: str | None = None
    psf_sha256: str | None = None
    origin_px: tuple[int, int] | None = None
    sensor_size_px: tuple[int, int] | None = None
    pixel_pitch_um: float | None = None

    @classmethod
    def of(cls, capture: Any) -> Self:
        """Return the records of a capture."""
        return cls(**{f.name: getattr(capture, f.name) for f in fields(cls)})

    @property
    def facts(self) -> dict[str, Any]:
        """Return the records by the names that they have in a `Capture`."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def text(self) -> str:
        """Return the JSON that `place_of_text` reads; empty without records."""
        facts = self.facts
        record = {"bundle": facts.pop("bundle_name")} | facts
        known_facts = {name: value for name, value in record.items() if value is not None}
        return json.dumps({"camkit": known_facts}) if known_facts else ""


def camera_name(tags: TiffTags, metadata: Metadata) -> str:
    """Return the camera as people read it; empty if not stated."""
    return clean_text(tags.text(UNIQUE_CAMERA_MODEL)) or metadata.camera


def sample_bits(tags: TiffTags) -> int:
    """Return the bits of a sample of the sensor picture; 0 if not stated or not believable."""
    values = [d.get(BITS_PER_SAMPLE, b"") for d in sensor_directories(tags.directories)]
    bits = [value[0] for value in values if value and not isinstance(value, bytes)]
    return int(max(bits)) if bits and 1 <= max(bits) <= 16 else 0


def noise_profile(tags: TiffTags, cfa: CfaPattern | None) -> NoiseModel | None:
    """Return the DNG NoiseProfile as R, G, B; None if absent or not believable.

    The tag holds (scale, offset) once, per colour plane in CFAPlaneColor order, or (as some
    cameras write it) per position of the 2x2 cell.
    """
    values = tags.numbers(NOISE_PROFILE)
    if values is None or len(values) % 2:
        return None
    pairs = np.array(values, dtype=np.float64).reshape(-1, 2)
    if not np.isfinite(pairs).all() or (pairs < 0).any():
        return None
    rgb = _pairs_by_color(pairs, tags, cfa)
    if rgb is None:
        return None
    shot, read = rgb.T.tolist()
    return NoiseModel(shot=(shot[0], shot[1], shot[2]), read_variance=(read[0], read[1], read[2]))


def _pairs_by_color(
    pairs: NDArray[np.float64], tags: TiffTags, cfa: CfaPattern | None
) -> NDArray[np.float64] | None:
    if len(pairs) == 1:
        return np.repeat(pairs, 3, axis=0)
    if len(pairs) == 4 and cfa is not None:
        colors = np.array(cfa_channels(cfa)).ravel()
        return np.stack([pairs[colors == c].mean(axis=0) for c in range(3)])
    if len(pairs) != 3:
        return None
    order = tags.numbers(CFA_PLANE_COLOR)
    opaque = next((d[CFA_PLANE_COLOR] for d in tags.directories if CFA_PLANE_COLOR in d), None)
    planes = list(opaque) if isinstance(opaque, bytes) else [int(n) for n in order or (0, 1, 2)]
    if sorted(planes) != [0, 1, 2]:
        return None
    return pairs[[planes.index(c) for c in range(3)]]


def sensor_place(tags: TiffTags) -> SensorPlace:
    """Return camkit's record in ImageDescription, else the bundle of UniqueCameraModel."""
    match = _BUNDLE_IN_MODEL.fullmatch(tags.text(UNIQUE_CAMERA_MODEL) or "")
    return place_of_text(tags.text(IMAGE_DESCRIPTION) or "", match.group(1) if match else None)


def place_of_text(text: str, model_bundle: str | None = None) -> SensorPlace:
    """Return the records in a text that a file holds.

    Args:
        text: JSON of camkit, or anything else.
        model_bundle: The bundle where the text names none.
    """
    try:
        record = json.loads(text)["camkit"]
        bundle = record.get("bundle", model_bundle)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return SensorPlace(bundle_name=model_bundle)
    pitch, psf = record.get("pixel_pitch_um"), record.get("psf_sha256")
    return SensorPlace(
        bundle_name=bundle if isinstance(bundle, str) else model_bundle,
        psf_sha256=psf if isinstance(psf, str) else None,
        origin_px=_whole_pair(record.get("origin_px"), least=0),
        sensor_size_px=_whole_pair(record.get("sensor_size_px"), least=1),
        pixel_pitch_um=float(pitch) if isinstance(pitch, int | float) and 0 < pitch < 1e4 else None,
    )


def _whole_pair(value: Any, *, least: int) -> tuple[int, int] | None:
    if isinstance(value, list) and len(value) == 2 and all(type(n) is int for n in value):
        x, y = value
        return (x, y) if least <= min(x, y) and max(x, y) < 1 << 24 else None
    return None
