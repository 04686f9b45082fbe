"""The manifest of a bundle, format 2.0: what `manifest.json` may say, and its JSON schema.

    Manifest
    |-- kind                         of camera (camkit/kinds.py)
    |-- sensor: Sensor               what it gives, size, levels, noise, colour (sensor.py)
    |-- optics: Optics | None        what the light goes through (optics.py)
    |-- stages: (Stage, ...)         what the pipeline does, in order (stages/)
    |-- planes: {name: Plane}        what runs from one stage to the next (plane.py, chain.py)
    |-- products: {name: plane}      what comes out
    |-- networks: {role: {size: NetworkFacts}}   members and measured facts (facts.py)
    |-- golden: (GoldenCase, ...)    the cases in golden.safetensors
    |-- card, freeze                 measured accuracy and speed; what freezing the PSF cost
    |-- envelope, plan               optional: where it helps; thresholds and their cost
    `-- members: {name: Member}      sha256 and size of every other file in the zip

Unknown fields are refused, so a newer minor version is refused too; format 1.0 is brought up to
date by camkit/bundle/upgrade.py: read `read_manifest`.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import Field, ValidationError, model_validator

from camkit.bundle.chain import CAPTURE, capture_plane, check_haze, check_use, join_stages
from camkit.bundle.entry import Count, Entry, NonNegative, Positive, Since, Sorted, Word
from camkit.bundle.facts import Card, NetworkFacts, StatedLaw
from camkit.bundle.golden import IMAGE
from camkit.bundle.optics import Optics
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import ColorSensor, LightSensor, Sensor
from camkit.bundle.stages import (
    JoinError,
    Parts,
    Stage,
    Wiener,
)
from camkit.bundle.strict_json import read_json
from camkit.bundle.upgrade import UpgradeError, upgrade
from camkit.errors import BundleError, UnsupportedError
from camkit.psf import FrozenPsf

FORMAT_VERSION: Final = (2, 12)
TOGETHER_VERSION: Final = (2, 4)
"""From here on a bank may restore colours together, and half of a kernel fits its windows."""
FOCUS_VERSION: Final = (2, 5)
"""From here on a PSF may hold kernels of a moved sensor; others state what they always did."""
PROFILE_VERSION: Final = (2, 6)
"""From here on distortion may have even powers."""
LIGHT_VERSION: Final = (2, 8)
"""From here on networks behind a bank are bounded, and laws of a picture are stated."""
NOT_TRAINED: Final = "not trained"
"""As `training_data`: weights are random, so that time and memory mean something and pictures do
not."""
_OLDEST: Final = 1
_S = TypeVar("_S", bound=Entry)
NetworkSize = Annotated[str, Field(pattern=r"^[A-Za-z0-9]{1,16}$")]
"""Name of a size of network; S, M and L from fast to good."""
Border = Literal["reflect", "edge", "zero"]
Tolerance = Annotated[float, Field(ge=0, le=1e-2)]
"""Of a golden case: a picture has 1.0 = white level, so more than this would prove nothing."""


class Member(Entry):
    """Hash and uncompressed size of one file in the bundle."""

    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    size: Count


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
    recipe: Annotated[dict[str, int | float | str], Sorted] = Field(default_factory=dict)
    iso: Positive
    origin_px: tuple[int, int] = (0, 0)
    white_balance: tuple[Positive, Positive, Positive] | None = None
    rtol: Tolerance = 1e-3
    atol: Tolerance = 1e-4


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
    """The manifest of format 2.0.

    Attributes:
        format_version: "major.minor" of the format.
        kind: Kind of camera.
        name: Name of the camera, as `--bundle` takes it.
        version: Semantic version of this bundle.
        licence: Licence of the weights (SPDX where there is one).
        training_data: What the networks were trained on, for people; `NOT_TRAINED` of random
            weights, which reports time and do not judge.
        sensor: What the camera sees with.
        optics: What it sees through; None where no stage needs to know.
        border: How a picture is continued to a multiple of the network's stride.
        stages: What is done to a capture, in order, and nothing else.
        planes: What the stages give; follows from the stages and is checked against them.
        products: Name of a result -> the plane that it is.
        networks: Role -> size -> facts.
        freeze: What freezing the PSF kept and what it cost (`loss_db` and whatever it measured).
        laws: Size -> law of a picture -> what export measured (format 2.8); None where it was not.
        exported_with: Package -> version.
    """

    format_version: Annotated[str, Field(pattern=r"^[0-9]{1,4}\.[0-9]{1,4}$")] = "2.4"
    kind: Word = "bayer"
    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")]
    version: Annotated[str, Field(pattern=r"^[0-9]+\.[0-9]+\.[0-9]+(-[0-9A-Za-z.-]+)?$")]
    licence: str
    training_data: str
    sensor: Sensor
    optics: Optics | None = None
    border: Border = "edge"
    stages: Annotated[tuple[Stage, ...], Field(max_length=32)]
    planes: Annotated[dict[Word, Plane], Sorted]
    products: Annotated[dict[Word, Word], Field(max_length=16), Sorted]
    networks: Annotated[
        dict[Word, Annotated[dict[NetworkSize, NetworkFacts], Field(max_length=16)]],
        Field(max_length=16),
    ] = Field(default_factory=dict)
    golden: Annotated[tuple[GoldenCase, ...], Field(max_length=32)] = ()
    card: Card = Card()
    freeze: Annotated[dict[str, int | float | str], Sorted] = Field(default_factory=dict)
    envelope: Annotated[dict[str, Range], Sorted] | None = None
    plan: Annotated[dict[str, Threshold], Sorted] | None = None
    laws: Annotated[
        Annotated[
            dict[NetworkSize, Annotated[dict[Word, StatedLaw], Field(max_length=32)]],
            Field(max_length=16),
        ]
        | None,
        Since(LIGHT_VERSION, "laws of a picture are stated"),
    ] = None
    exported_with: Annotated[dict[str, str], Sorted] = Field(default_factory=dict)
    members: Annotated[dict[str, Member], Sorted] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> "Manifest":
        joined = join_stages(self.stages, self.parts)
        for name in joined.keys() | self.planes.keys():
            if name not in joined:
                raise ValueError(f"no stage gives the plane {name!r}")
            if name not in self.planes:
                raise ValueError(f"the plane {name!r} is not stated")
            if joined[name] != self.planes[name]:
                raise ValueError(
                    f"the plane {name!r} is stated as {self.planes[name].describe()}; its stage "
                    f"gives {joined[name].describe()}"
                )
        check_use(self.stages, self.products, self.planes)
        check_haze(self.stages, self.optics)
        if idle := self.networks.keys() - {getattr(stage, "role", None) for stage in self.stages}:
            raise ValueError(f"no stage uses the networks of the role {', '.join(sorted(idle))}")
        names = [case.name for case in self.golden]
        if len(set(names)) != len(names):
            raise ValueError("two golden cases have one name")
        return self

    def needs(self) -> list[Since]:
        """Return what of it readers of older formats do not know."""
        optics = [] if self.optics is None else self.optics.needs()
        return super().needs() + optics + [need for stage in self.stages for need in stage.needs()]

    @property
    def parts(self) -> Parts:
        """Return the parts that stages use to derive their planes."""
        return Parts(sensor=self.sensor, optics=self.optics, networks=self.networks)

    @property
    def light_sensor(self) -> ColorSensor:
        """Return the sensor, which a stage of pictures always has: one of light in colours.

        Raises:
            UnsupportedError: If it counts photons.
        """
        if not isinstance(self.sensor, LightSensor):
            raise UnsupportedError(
                f"bundle {self.name} counts photons; this is for light in colours"
            )
        return self.sensor

    @property
    def has_kernels(self) -> bool:
        """Return whether the optics blur by kernels that are known: only then is there a twin."""
        return self.optics is not None and self.optics.type != "lens_profile"

    @property
    def has_haze(self) -> bool:
        """Return whether a haze lies beside these kernels."""
        return self.optics is not None and self.optics.type == "hazy_psf"

    @property
    def version_pair(self) -> tuple[int, int]:
        """Major and minor version of its format."""
        major, minor = self.format_version.split(".")
        return int(major), int(minor)

    @property
    def is_trained(self) -> bool:
        """Return whether what its networks make is a picture to be judged."""
        return self.training_data != NOT_TRAINED

    @property
    def all_planes(self) -> dict[str, Plane]:
        """Return every plane by name, that of the sensor first."""
        return {CAPTURE: capture_plane(self.sensor), **self.planes}

    def stage(self, kind: type[_S]) -> _S | None:
        """Return the first stage of one type, or None if this camera has none."""
        return next(iter(self.stages_of(kind)), None)

    def stages_of(self, kind: type[_S]) -> tuple[_S, ...]:
        """Return all stages of one type, in order."""
        return tuple(stage for stage in self.stages if isinstance(stage, kind))

    @property
    def sizes(self) -> tuple[str, ...]:
        """Return the names of the sizes that every role has, from the least work to the most."""
        if not self.networks:
            return ()
        first, *others = self.networks.values()
        common = [size for size in first if all(size in sizes for sizes in others)]
        return tuple(sorted(common, key=self.mac_per_pixel))

    def mac_per_pixel(self, size: str) -> float:
        """Return the multiplications per pixel of the networks of one size, all roles together."""
        return sum(sizes[size].mac_per_pixel for sizes in self.networks.values() if size in sizes)


def planes_of(stages: tuple[Stage, ...], parts: Parts) -> dict[str, Plane]:
    """Return the planes to state in a manifest.

    Raises:
        BundleError: If the stages do not join.
    """
    try:
        return join_stages(stages, parts)
    except JoinError as error:
        raise BundleError(str(error)) from error


def manifest_without_networks(
    stages: tuple[Stage, ...], sensor: Sensor, optics: Optics | None, **facts: Any
) -> Manifest:
    """Return the manifest of a camera of physics alone; its only product is what comes last.

    Args:
        stages: In order, none of them a network.
        sensor: What the camera sees with.
        optics: What it sees through; None where no stage needs to know.
        facts: Other entries: `name`, `version`, `licence` and what else a `Manifest` holds.

    Raises:
        BundleError: If the stages do not join.
    """
    entries = {
        "training_data": "none: no network",
        "format_version": format_of(None, (*stages, *([] if optics is None else [optics]))),
    } | facts
    parts = Parts(sensor=sensor, optics=optics, networks={})
    return Manifest(
        sensor=sensor,
        optics=optics,
        stages=stages,
        planes=planes_of(stages, parts),
        products={IMAGE: stages[-1].gives[0]},
        **entries,
    )


class _Head(Entry, extra="ignore"):
    """The part of a manifest that is read first, whatever its version."""

    format_version: str
    exported_with: dict[str, Any] = Field(default_factory=dict)


def format_of(
    psf: FrozenPsf | None, parts: Iterable[Entry], *, least: tuple[int, int] = TOGETHER_VERSION
) -> str:
    """Return the format of a bundle: the newest that one of its parts needs.

    Args:
        psf: Of its optics; None where they have none.
        parts: Its stages, its optics, or a whole manifest.
        least: An older one is not stated.
    """
    versions = [least, *(need.version for part in parts for need in part.needs())]
    if psf is not None and psf.focus_um is not None:
        versions.append(FOCUS_VERSION)
    if psf is not None and psf.distortion.even_coefficients is not None:
        versions.append(PROFILE_VERSION)
    return ".".join(map(str, max(versions)))


def read_manifest(data: bytes) -> Manifest:
    """Decode and check the bytes of manifest.json; one of format 1.0 is brought up to date.

    Raises:
        BundleError: If it is no JSON or holds a key twice, is of a newer format than this reader
            knows (major or minor), or breaks the schema.
    """
    read_json(data, what="manifest.json")
    try:
        head = _Head.model_validate_json(data)
    except ValidationError as error:
        raise BundleError(f"manifest.json cannot be read: {_first(error)}") from error
    major = _check_version(head.format_version, head.exported_with)
    try:
        if major < FORMAT_VERSION[0]:
            return _with_old_windows(Manifest.model_validate_json(upgrade(data)))
        return _with_old_windows(Manifest.model_validate_json(data))
    except (ValidationError, UpgradeError) as error:
        what = _first(error) if isinstance(error, ValidationError) else str(error)
        raise BundleError(
            f"manifest.json breaks the schema of format {head.format_version}: {what}"
        ) from error


def _with_old_windows(manifest: Manifest) -> Manifest:
    """Return a manifest whose bank explains clipped light as it did when the bundle was made."""
    if manifest.version_pair >= TOGETHER_VERSION:
        return manifest
    stages = tuple(
        stage.model_copy(update={"clip_windows": "whole_kernel"})
        if isinstance(stage, Wiener)
        else stage
        for stage in manifest.stages
    )
    return manifest.model_copy(update={"stages": stages})


def _check_version(text: str, exported_with: Mapping[str, Any]) -> int:
    """Refuse a version that this reader does not know; return the major version."""
    match = re.fullmatch(r"(\d{1,4})\.(\d{1,4})", text, flags=re.ASCII)
    if match is None:
        raise BundleError(f"format_version must read like 2.0; got {text[:20]!r}")
    version = (int(match[1]), int(match[2]))
    if version[0] < _OLDEST:
        raise BundleError(f"there never was a format {text}; export the bundle again")
    newest = FORMAT_VERSION if version[0] >= FORMAT_VERSION[0] else (version[0], 0)
    if version > newest:
        ours = ".".join(map(str, newest))
        maker = exported_with.get("camkit")
        hint = f" (it was written by camkit {maker})" if isinstance(maker, str) else ""
        part = "major" if version[0] > newest[0] else "minor"
        raise BundleError(
            f"this bundle has format {text}, a newer {part} version than this reader knows "
            f"({ours}); update to a camkit that reads format {text}{hint}"
        )
    return version[0]


def _first(error: ValidationError) -> str:
    """Return the first complaint as one line: where, what."""
    details = error.errors(include_url=False, include_input=False)
    where = "".join(f"{part}." for part in details[0]["loc"]).removesuffix(".")
    message = details[0]["msg"].removeprefix("Value error, ")
    more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
    return f"{where}: {message}{more}" if where else f"{message}{more}"


def manifest_to_bytes(manifest: Manifest) -> bytes:
    """Encode the manifest as it stands in the bundle; equal manifests give equal bytes."""
    return (manifest.model_dump_json(indent=2) + "\n").encode()


def manifest_schema() -> dict[str, Any]:
    """Return the JSON schema of format 2.0, as `camkit info --schema` prints it."""
    return Manifest.model_json_schema()
