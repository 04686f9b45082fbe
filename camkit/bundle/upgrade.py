"""A manifest of format 1.0 brought up to date, so that its bundle gives the bits it always gave.

Format 1.0 knew one kind of camera: a mosaic (or linear RGB), one network behind the Wiener bank.
Its list of stages left out what was done anyway: black and white level, repair, white balance,
demosaicking, neutral highlights and colour were done whether they were listed or not. Here they
are listed. Two faults of it are mended: a network without a Wiener bank, which was never run, is
refused, and so is one whose channels are not those of capture and bank.

The schema of 1.0 was strict, and stays so: an unknown key, a stage out of order or a value out of
range is refused, by the models here where 2.0 has none of their own.
"""

import json
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import Field, ValidationError

from camkit.bundle.chain import join_stages, rewired
from camkit.bundle.entry import Entry
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.optics import PSF, FrozenPsfOptics
from camkit.bundle.sensor import BayerSensor, PlanesSensor, nested_sensor
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Illumination,
    JoinError,
    Linearise,
    Network,
    Parts,
    RaiseClipped,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
    Wiener,
)
from camkit.bundle.stages.network import DEFAULT_ROLE

STAGE_ORDER: Final = (
    "white_balance",
    "demosaic",
    "wiener",
    "network",
    "illumination",
    "undistort",
    "color",
)
_PSF_STAGES: Final = {"wiener", "illumination", "undistort"}
_LISTED: Final = ("wiener", "network", "illumination", "undistort")
"""What format 1.0 did only where it was listed."""
_ADDED: Final = {"kind", "sensor", "optics", "planes", "products"}
"""What format 1.0 did not have."""
_COLOURS: Final = 3
_T = TypeVar("_T", bound=Entry)


class UpgradeError(ValueError):
    """A manifest of format 1.0 that format 1.0 would have refused, or that it got wrong."""


class _Old(Entry):
    """The fields of a manifest of format 1.0 that 2.0 no longer has."""

    format_version: Literal["1.0"]
    camera: dict[str, Any]
    object_distance_mm: Annotated[float, Field(gt=0)] | None = None
    input_contract: Literal["raw_bayer_v1", "linear_rgb_v1", "spad_counts_v1", "spad_histogram_v1"]
    stages: tuple[dict[str, Any], ...]
    networks: dict[Literal["S", "M", "L"], dict[str, Any]] = Field(default_factory=dict)


def upgrade(data: bytes) -> bytes:
    """Return the manifest of format 2.0 that says the same as one of 1.0.

    Args:
        data: JSON of format 1.0.

    Raises:
        UpgradeError: If a part that 2.0 does not have breaks the schema of 1.0, or the bundle asked
            for what 1.0 did not do.
        ValidationError: Likewise, with pydantic's own words.
    """
    try:
        document: dict[str, Any] = json.loads(data)
    except ValueError as error:
        raise UpgradeError(f"it cannot be read: {error}") from error
    rest = {name: document.pop(name) for name in list(document) if name not in _Old.model_fields}
    old = _Old.model_validate(document)
    if newer := rest.keys() & _ADDED:
        raise UpgradeError(f"{', '.join(sorted(newer))}: extra inputs are not permitted")
    sensor = _sensor(old)
    stages = _stages(old, sensor)
    members = rest.get("members", {})
    if not isinstance(members, dict):
        raise UpgradeError("members: it must be a table")
    optics = _optics(old, members, stages)
    networks = {str(size): _facts(facts) for size, facts in old.networks.items()}
    roles = {DEFAULT_ROLE: networks} if networks else {}
    try:
        planes = join_stages(stages, Parts(sensor=sensor, optics=optics, networks=roles))
    except JoinError as error:
        raise UpgradeError(str(error)) from error
    upgraded = {
        "format_version": "2.0",
        "kind": "bayer",
        "sensor": sensor.model_dump(mode="json"),
        "optics": None if optics is None else optics.model_dump(mode="json"),
        "stages": [stage.model_dump(mode="json") for stage in stages],
        "planes": {name: plane.model_dump(mode="json") for name, plane in planes.items()},
        "products": {"image": stages[-1].gives[0]},
        "networks": {
            role: {size: facts.model_dump(mode="json") for size, facts in sizes.items()}
            for role, sizes in roles.items()
        },
    }
    return json.dumps(rest | upgraded).encode()


def _sensor(old: _Old) -> BayerSensor | PlanesSensor:
    if old.input_contract.startswith("spad"):
        raise UpgradeError(f"format 1.0 had no sensor for {old.input_contract}")
    table = dict(old.camera)
    if "type" in table or "optical_centre_px" in table or "extent" in table:
        raise UpgradeError("camera: extra inputs are not permitted")
    if table.get("channel_response") is None:
        raise UpgradeError("camera.channel_response: field required")
    if table.get("color_matrix") is None:
        raise UpgradeError("camera.color_matrix: field required")
    if old.input_contract == "raw_bayer_v1" and table.get("cfa") is None:
        raise UpgradeError("raw_bayer_v1 needs a cfa")
    nested = nested_sensor(table)
    if old.input_contract == "linear_rgb_v1":
        nested = {**nested, "type": "planes"}
        nested.pop("cfa", None)
        return _validated("camera", PlanesSensor, nested)
    return _validated("camera", BayerSensor, nested)


def _stages(old: _Old, sensor: BayerSensor | PlanesSensor) -> tuple[Stage, ...]:
    """Return the list of what format 1.0 did."""
    types = [stage.get("type") for stage in old.stages]
    if unknown := [t for t in types if t not in STAGE_ORDER]:
        raise UpgradeError(f"stages: format 1.0 had no stage {unknown[0]!r}")
    order = [STAGE_ORDER.index(str(t)) for t in types]
    if order != sorted(set(order)):
        raise UpgradeError(
            f"stages must come once each, in the order {', '.join(STAGE_ORDER)}; "
            f"got {', '.join(map(str, types))}"
        )
    if "network" in types and not old.networks:
        raise UpgradeError("there is a network stage but no network")
    if ("network" in types or old.networks) and not {"wiener", "network"} <= set(types):
        raise UpgradeError(
            "a network of format 1.0 takes the planes of a Wiener bank, and the stages have "
            f"{'no bank' if 'network' in types else 'no network stage'}"
        )
    listed = {str(stage["type"]): stage for stage in old.stages}
    if any(
        {"takes", "gives", "role", "transform", "most_light"} & stage.keys() for stage in old.stages
    ):
        raise UpgradeError("stages: extra inputs are not permitted")
    bank = Wiener(prior_scale=1.0, prior_exponent=0.0)
    usual: tuple[Stage, ...] = (Linearise(), Repair(), WhiteBalance(), Demosaic(method="fast"))
    usual = (*usual, bank, Network(), RaiseClipped(), Illumination(), Undistort(), Color())
    mosaic = isinstance(sensor, BayerSensor)
    implied = {"demosaic": mosaic, "raise_clipped": mosaic} | dict.fromkeys(_LISTED, False)
    # a demosaic that linear RGB listed was checked and passed over
    stages = [
        _validated("stages", type(stage), listed.get(stage.type, stage.model_dump()))
        for stage in usual
        if stage.type in listed or implied.get(stage.type, True)
    ]
    stages = [stage for stage in stages if mosaic or stage.type != "demosaic"]
    return rewired(stages, usual)


def _optics(
    old: _Old, members: Mapping[str, Any], stages: tuple[Stage, ...]
) -> FrozenPsfOptics | None:
    """Return the optics: those of every bundle that held a PSF, or whose stages needed one."""
    needs = _PSF_STAGES & {stage.type for stage in stages}
    if PSF not in members and not needs:
        return None
    table = {
        "pixel_pitch_um": old.camera.get("pixel_pitch_um"),
        "object_distance_mm": old.object_distance_mm,
    }
    return _validated("optics", FrozenPsfOptics, table)


def _facts(table: Mapping[str, Any]) -> NetworkFacts:
    """Add the inputs of a network to its facts: the capture, and behind it the bank."""
    if {"inputs", "outputs"} & table.keys():
        raise UpgradeError("networks: extra inputs are not permitted")
    rest = {k: v for k, v in table.items() if k not in {"input_channels", "output_channels"}}
    channels_in, channels_out = (
        table.get("input_channels", 2 * _COLOURS),
        table.get("output_channels", _COLOURS),
    )
    if not (isinstance(channels_in, int) and isinstance(channels_out, int)):
        raise UpgradeError("networks: channels must be whole numbers")
    if channels_in != 2 * _COLOURS:
        raise UpgradeError(
            f"a network of format 1.0 is given {2 * _COLOURS} planes; this one takes {channels_in}"
        )
    ports = [{"name": "capture", "channels": _COLOURS}, {"name": "wiener", "channels": _COLOURS}]
    outputs = [{"name": "clean", "channels": channels_out}]
    return _validated("networks", NetworkFacts, {**rest, "inputs": ports, "outputs": outputs})


def _validated(where: str, model: type[_T], table: Mapping[str, Any]) -> _T:
    try:
        return model.model_validate(dict(table))
    except ValidationError as error:
        details = error.errors(include_url=False, include_input=False)[0]
        place = ".".join([where, *(str(part) for part in details["loc"])])
        raise UpgradeError(f"{place}: {details['msg']}") from error
