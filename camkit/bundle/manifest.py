"""The manifest of a bundle, format 1.0: what `manifest.json` may say, and its JSON schema.

    Manifest
    |-- camera: Camera              sensor, levels, noise, colour (camkit/bundle/camera.py)
    |-- input_contract, border      what kind of capture it takes; how the picture is continued
    |-- stages: (Stage, ...)        what the pipeline does, in order (camkit/bundle/stages.py)
    |-- networks: {size: NetworkFacts}   one per size: its member and the measured facts
    |-- golden: (GoldenCase, ...)   the cases in golden.safetensors
    |-- card, freeze                measured accuracy and speed; what freezing the PSF cost
    |-- envelope, plan              optional: where it helps; thresholds and their cost
    `-- members: {name: Member}     sha256 and size of every other file in the zip

Unknown fields are refused, so a newer minor version is refused too: read `read_manifest`.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import AfterValidator, Field, ValidationError, model_validator

from camkit.bundle.camera import Camera, ChannelResponse, Entry, IsoNoise, NonNegative, Positive
from camkit.bundle.facts import Card, CardRow, HaloError, NetworkFacts
from camkit.bundle.stages import (
    STAGE_ORDER,
    Color,
    Demosaic,
    Illumination,
    Network,
    Stage,
    Undistort,
    WhiteBalance,
    Wiener,
)
from camkit.errors import BundleError

__all__ = [
    "FORMAT_VERSION",
    "Border",
    "Camera",
    "Card",
    "CardRow",
    "ChannelResponse",
    "Color",
    "Demosaic",
    "GoldenCase",
    "HaloError",
    "Illumination",
    "InputContract",
    "IsoNoise",
    "Manifest",
    "Member",
    "Network",
    "NetworkFacts",
    "NetworkSize",
    "Range",
    "Stage",
    "Threshold",
    "Undistort",
    "WhiteBalance",
    "Wiener",
    "manifest_schema",
    "manifest_to_bytes",
    "read_manifest",
]

FORMAT_VERSION: Final = (1, 0)
_S = TypeVar("_S", bound=Entry)
NetworkSize = Literal["S", "M", "L"]
"""Sizes of network, from fast to good."""
InputContract = Literal["raw_bayer_v1", "linear_rgb_v1", "spad_counts_v1", "spad_histogram_v1"]
"""raw_bayer_v1: (h, w) mosaic in DN; linear_rgb_v1: (3, h, w) linear, 1.0 = white level."""
Border = Literal["reflect", "edge", "zero"]


def _sorted(mapping: dict[str, Any]) -> dict[str, Any]:
    return dict(sorted(mapping.items()))


# Sorted, so that equal manifests are equal bytes whatever order they were filled in.
_Sort = AfterValidator(_sorted)


class Member(Entry):
    """Hash and uncompressed size of one file in the bundle."""

    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    size: Annotated[int, Field(ge=0)]


class GoldenCase(Entry):
    """One case in golden.safetensors, with which a bundle proves itself.

    Attributes:
        name: Prefix of its tensors; see camkit/bundle/golden.py.
        recipe: The scene and its simulation, enough to make the case again.
        iso: ISO of the capture.
        origin_px: (x, y) of the capture's top left pixel on the sensor.
        white_balance: Gains (R, G, B) with G = 1; None for no gain.
        rtol: Allowed |difference| relative to max(1, max |output|).
        atol: Allowed |difference| on top of it.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9_]{1,40}$")]
    recipe: Annotated[dict[str, int | float | str], _Sort] = Field(default_factory=dict)
    iso: Positive
    origin_px: tuple[int, int] = (0, 0)
    white_balance: tuple[Positive, Positive, Positive] | None = None
    rtol: NonNegative = 1e-3
    atol: NonNegative = 1e-4


class Range(Entry):
    """A closed range of one quantity."""

    low: float
    high: float

    @model_validator(mode="after")
    def _check(self) -> "Range":
        if self.low > self.high:
            raise ValueError(f"low {self.low} lies above high {self.high}")
        return self


class Threshold(Entry):
    """A threshold of the plan, and what taking the cheaper way there costs."""

    value: float
    cost_db: NonNegative


class Manifest(Entry):
    """The manifest of format 1.0.

    Attributes:
        format_version: "major.minor" of the format.
        name: Name of the camera, as `--bundle` takes it.
        version: Semantic version of this bundle.
        licence: Licence of the weights (SPDX where there is one).
        training_data: What the networks were trained on, for people.
        input_contract: What kind of capture it takes.
        border: How a picture is continued to a multiple of the network's stride.
        object_distance_mm: Distance of focus from the first surface; None for infinity.
        freeze: What freezing the PSF kept and what it cost (`loss_db` and whatever it measured).
        exported_with: Package -> version.
    """

    format_version: Annotated[str, Field(pattern=r"^[0-9]{1,4}\.[0-9]{1,4}$")] = "1.0"
    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")]
    version: Annotated[str, Field(pattern=r"^[0-9]+\.[0-9]+\.[0-9]+(-[0-9A-Za-z.-]+)?$")]
    licence: str
    training_data: str
    camera: Camera
    object_distance_mm: Positive | None = None
    input_contract: InputContract
    border: Border = "edge"
    stages: tuple[Stage, ...]
    networks: dict[NetworkSize, NetworkFacts] = Field(default_factory=dict)
    golden: tuple[GoldenCase, ...] = ()
    card: Card = Card()
    freeze: Annotated[dict[str, int | float | str], _Sort] = Field(default_factory=dict)
    envelope: Annotated[dict[str, Range], _Sort] | None = None
    plan: Annotated[dict[str, Threshold], _Sort] | None = None
    exported_with: Annotated[dict[str, str], _Sort] = Field(default_factory=dict)
    members: Annotated[dict[str, Member], _Sort] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> "Manifest":
        order = [STAGE_ORDER.index(stage.type) for stage in self.stages]
        if order != sorted(set(order)):
            got = ", ".join(stage.type for stage in self.stages)
            raise ValueError(
                f"stages must come once each, in the order {', '.join(STAGE_ORDER)}; got {got}"
            )
        if self.stage(Network) is not None and not self.networks:
            raise ValueError("there is a network stage but no network")
        if self.input_contract == "raw_bayer_v1" and self.camera.cfa is None:
            raise ValueError("raw_bayer_v1 needs a cfa")
        names = [case.name for case in self.golden]
        if len(set(names)) != len(names):
            raise ValueError("two golden cases have one name")
        return self

    def stage(self, kind: type[_S]) -> _S | None:
        """Give the stage of one type, or None if this camera does without it."""
        return next((stage for stage in self.stages if isinstance(stage, kind)), None)


class _Head(Entry, extra="ignore"):
    """What is read of a manifest before anything else, whatever its version."""

    format_version: str
    exported_with: dict[str, Any] = Field(default_factory=dict)


def read_manifest(data: bytes) -> Manifest:
    """Decode and check the bytes of manifest.json.

    Raises:
        BundleError: If it is no JSON, of a newer format than this reader knows (major or
            minor), or breaks the schema.
    """
    try:
        head = _Head.model_validate_json(data)
    except ValidationError as error:
        raise BundleError(f"manifest.json cannot be read: {_first(error)}") from error
    _check_version(head.format_version, head.exported_with)
    try:
        return Manifest.model_validate_json(data)
    except ValidationError as error:
        raise BundleError(
            f"manifest.json breaks the schema of format {head.format_version}: {_first(error)}"
        ) from error


def _check_version(text: str, exported_with: Mapping[str, Any]) -> None:
    match = re.fullmatch(r"(\d{1,4})\.(\d{1,4})", text, flags=re.ASCII)
    if match is None:
        raise BundleError(f"format_version must read like 1.0; got {text[:20]!r}")
    version = (int(match[1]), int(match[2]))
    if version > FORMAT_VERSION:
        ours = ".".join(map(str, FORMAT_VERSION))
        maker = exported_with.get("camkit")
        hint = f" (it was written by camkit {maker})" if isinstance(maker, str) else ""
        part = "major" if version[0] > FORMAT_VERSION[0] else "minor"
        raise BundleError(
            f"this bundle has format {text}, a newer {part} version than this reader knows "
            f"({ours}); update to a camkit that reads format {text}{hint}"
        )
    if version[0] < 1:
        raise BundleError(f"there never was a format {text}; export the bundle again")


def _first(error: ValidationError) -> str:
    """Put the first complaint into one line: where, what."""
    details = error.errors(include_url=False, include_input=False)
    where = ".".join(str(part) for part in details[0]["loc"]) or "manifest"
    more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
    return f"{where}: {details[0]['msg']}{more}"


def manifest_to_bytes(manifest: Manifest) -> bytes:
    """Encode the manifest as it stands in the bundle; equal manifests give equal bytes."""
    return (manifest.model_dump_json(indent=2) + "\n").encode()


def manifest_schema() -> dict[str, Any]:
    """Give the JSON schema of format 1.0, as `camkit info --schema` prints it."""
    return Manifest.model_json_schema()
