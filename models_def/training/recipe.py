"""Recipes: what a person edits to train the networks of a camera, read from TOML.

    name, kind, [sensor], [data], [schedule], [networks]   common to all kinds: here
    [lens], [wiener], ...                                  of one kind: in its own recipe module

`[networks.SIZE]` is a size of the one network of a kind; a kind with several names their roles,
`[networks.ROLE.SIZE]`. Keys are strict: an unknown or missing key, a wrong type or a value out of
range is an error that names the key.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from camkit.bundle.sensor import (
    GREY,
    RGB,
    BayerSensor,
    ColorSensor,
    PlanesSensor,
    Sensor,
    nested_sensor,
)
from camkit.errors import ContractError
from camkit.models_def.model_faults import fault_texts
from camkit.models_def.toml_table import Faults, check_keys, section, typed

PICTURE_LOSSES = ("content", "adversarial")
"""Of what is seen on a display; by a fitter that a kind brings."""
LOSSES = ("log_mse", "mse", "l1", *PICTURE_LOSSES)
PRECISIONS = ("float32", "bfloat16")
AHEAD: Final = 32
"""Samples made beyond those that a step may draw; their slots are taken."""
COMMON: Final = frozenset({"name", "kind", "sensor", "data", "schedule", "networks"})
DEFAULT_KIND: Final = "bayer"

_SENSOR: Final[TypeAdapter[Sensor]] = TypeAdapter(Sensor)
_FLAT: Final = ("bayer", "planes", "spad", "extent")
"""Parts of the place of an error that a recipe does not spell out."""

M = TypeVar("M", bound=BaseModel)
_S = TypeVar("_S", bound=ColorSensor)


def check_share(where: str, value: float) -> None:
    """Refuse a share outside 0..1.

    Raises:
        ContractError: Naming the key.
    """
    if not 0 <= value <= 1:
        raise ContractError(f"{where} must lie in 0..1; got {value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneRecipe:
    """Sources of sharp crops.

    Attributes:
        picture_share: Share of crops from pictures, 0 to 1; the rest, and all without a folder of
            pictures, is procedural.
        procedural_scenes: Number of different procedural scenes.
        scene_px: Side of a procedural scene.
    """

    picture_share: float = 0.8
    procedural_scenes: int = 24
    scene_px: int = 512


@dataclass(frozen=True, slots=True, kw_only=True)
class DataRecipe(SceneRecipe):
    """Numbers of samples that are made and held; a kind may add keys of its own.

    Attributes:
        sample_px: Side of a finished sample; training patches are cut from it.
        pool_samples: Samples held on disk at one time; more than `AHEAD`.
        first_samples: Samples that must exist before the first step.
        steps_per_sample: Training steps after which one more sample replaces the oldest.
    """

    procedural_scenes: int = 48
    scene_px: int = 1024
    sample_px: int = 256
    pool_samples: int = 1600
    first_samples: int = 400
    steps_per_sample: int = 8

    def __post_init__(self) -> None:
        check_share("data.picture_share", self.picture_share)
        if not 0 < self.first_samples < self.pool_samples:
            raise ContractError("data.first_samples must lie between 0 and pool_samples")
        if self.pool_samples <= AHEAD:
            raise ContractError(
                f"data.pool_samples must exceed the {AHEAD} samples that are made ahead of training"
                f"; got {self.pool_samples}"
            )
        if min(self.sample_px, self.scene_px, self.procedural_scenes, self.steps_per_sample) < 1:
            raise ContractError("sizes and counts of data must be positive")


@dataclass(frozen=True, slots=True, kw_only=True)
class ContentRecipe:
    """The comparison of output and truth.

    Attributes:
        l1_weight: On the mean |difference| in the square-root domain.
        gram_weight: On the Gram matrices of features, eq. (3.7).
        feature_weight: On the features themselves, mean square; the authors' public code has it
            beside the Gram matrices, the text has not.
    """

    l1_weight: float = 1.0
    gram_weight: float = 0.0
    feature_weight: float = 0.0

    def __post_init__(self) -> None:
        weights = self.l1_weight, self.gram_weight, self.feature_weight
        if min(weights) < 0 or sum(weights) == 0:
            raise ContractError(f"schedule.content needs weights >= 0, one > 0; got {weights}")

    @property
    def looks(self) -> bool:
        """Return whether pictures are compared by features."""
        return self.gram_weight + self.feature_weight > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class CriticRecipe:
    """The critic, its training, and how much its opinion counts.

    Attributes:
        weight: lambda_a of eq. (3.9).
        steps: Of the critic for each of the generator.
        penalty: lambda_g of eq. (3.8). The thesis does not give it; 10 is what its source has.
        layers: Strided layers: the text has five; the authors' public code has three.
        width: Channels of the first; they double per layer, up to 8 times.
        learning_rate: Peak of Adam's rate, with the decay of the schedule.
        beta1: Of both optimisers.
        sharp_share: Share of the true pictures that have no capture, where such are given.
    """

    weight: float = 0.1
    steps: int = 5
    penalty: float = 10.0
    layers: int = 5
    width: int = 64
    learning_rate: float = 1e-4
    beta1: float = 0.5
    sharp_share: float = 0.5

    def __post_init__(self) -> None:
        if min(self.weight, self.penalty) < 0 or self.learning_rate <= 0:
            raise ContractError("schedule.critic needs weight, penalty >= 0, learning_rate > 0")
        if min(self.steps, self.layers, self.width) < 1:
            raise ContractError(
                "schedule.critic needs steps, layers and width >= 1; got "
                f"{self.steps}, {self.layers}, {self.width}"
            )
        if not (0 <= self.beta1 < 1 and 0 <= self.sharp_share <= 1):
            raise ContractError(
                "schedule.critic needs beta1 in [0, 1) and sharp_share in 0..1; got "
                f"{self.beta1}, {self.sharp_share}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduleRecipe:
    """The schedule of a fit.

    Attributes:
        steps: Steps of the whole schedule; `--max-minutes` may end it sooner, decay included.
        batch: Patches per step.
        patch_px: Side of a training patch.
        learning_rate: Peak of AdamW's rate: linear warm-up, then a half cosine.
        final_rate: Rate at the end, relative to the peak.
        warmup_steps: Steps of warm-up.
        weight_decay: AdamW's decay.
        gradient_clip: Largest norm of the gradient.
        ema_decay: Decay of the weight average that is validated and exported.
        loss: log_mse, mse or l1, all in the square-root domain of the signal; content, what
            `content` weighs; adversarial, the same and a critic.
        overshoot: Weight of squared overshoots beside the errors, against halos; 0 where the loss
            is content or adversarial.
        precision: float32, or bfloat16: multiplies in it where the processor has instructions for
            that, and in float32 elsewhere (weights stay float32).
        float32_share: Share of the schedule, at its end, computed in float32 anyway.
        seed: Seed of weights, samples and order.
        content: Weights of what is seen.
        critic: Against whom.
    """

    steps: int = 40_000
    batch: int = 8
    patch_px: int = 128
    learning_rate: float = 2e-3
    final_rate: float = 0.005
    warmup_steps: int = 200
    weight_decay: float = 1e-4
    gradient_clip: float = 1.0
    ema_decay: float = 0.999
    loss: str = "log_mse"
    overshoot: float = 0.0
    precision: str = "bfloat16"
    float32_share: float = 0.05
    seed: int = 1
    content: ContentRecipe = field(default_factory=ContentRecipe)
    critic: CriticRecipe = field(default_factory=CriticRecipe)

    def __post_init__(self) -> None:
        if self.loss not in LOSSES:
            raise ContractError(f"schedule.loss must be one of {LOSSES}; got {self.loss!r}")
        if self.precision not in PRECISIONS:
            raise ContractError(
                f"schedule.precision must be one of {PRECISIONS}; got {self.precision!r}"
            )
        if self.overshoot < 0:
            raise ContractError(f"schedule.overshoot must be >= 0; got {self.overshoot}")
        if self.overshoot and self.loss in PICTURE_LOSSES:
            raise ContractError(
                f"the loss {self.loss} has no term for overshoots; set schedule.overshoot = 0.0"
            )
        check_share("schedule.float32_share", self.float32_share)
        check_share("schedule.ema_decay", self.ema_decay)
        if min(self.steps, self.batch, self.patch_px) < 1 or self.learning_rate <= 0:
            raise ContractError("schedule needs positive steps, batch, patch_px, learning_rate")


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkRecipe:
    """One size of network.

    Attributes:
        network: Name by which its kind builds it.
        config: Fields of its config that differ from the defaults.
        schedule: The schedule, with what this network changes of it.
    """

    network: str
    config: Mapping[str, Any] = field(default_factory=dict)
    schedule: ScheduleRecipe = field(default_factory=ScheduleRecipe)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """A camera and how its networks are trained: what all kinds have in common.

    Attributes:
        name: Name of the camera and its bundle.
        kind: Kind of camera.
        sensor: As the bundle will state it.
        data: Where samples come from.
        networks: Role -> size -> network.
    """

    name: str
    kind: str
    sensor: Sensor
    data: DataRecipe
    networks: Mapping[str, Mapping[str, NetworkRecipe]]

    def role(self, name: str | None) -> str:
        """Return a role by its name, or the only one.

        Raises:
            ContractError: If there is no such role, or several to choose from.
        """
        have = ", ".join(self.networks)
        if name is None and len(self.networks) == 1:
            return next(iter(self.networks))
        if name is None:
            raise ContractError(f"recipe {self.name} has networks of the roles {have}; choose one")
        if name not in self.networks:
            raise ContractError(f"recipe {self.name} has networks of the role {have}; not {name!r}")
        return name

    def network(self, size: str, role: str | None = None) -> NetworkRecipe:
        """Return the network of a size, or raise ContractError naming the sizes there are."""
        sizes = self.networks[self.role(role)]
        if size not in sizes:
            raise ContractError(
                f"recipe {self.name} has the sizes {', '.join(sizes)}; got {size!r}"
            )
        return sizes[size]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonTables:
    """The common tables of a recipe but [data], which may hold keys of a kind; see `Recipe`."""

    name: str
    kind: str
    sensor: Sensor
    networks: Mapping[str, Mapping[str, NetworkRecipe]]


def common_tables(
    table: Mapping[str, Any],
    *,
    kind_keys: Iterable[str],
    roles: Sequence[str],
    main: str | None = None,
) -> CommonTables:
    """Check the common tables of a recipe.

    Args:
        table: The whole recipe.
        kind_keys: Keys of its kind.
        roles: Of the networks of its kind.
        main: The role of [networks.SIZE]; None for the only one.

    Raises:
        ContractError: If keys are unknown, missing or wrong: naming all of them.
    """
    faults = Faults()
    faults.read(check_keys, "recipe", table, {*COMMON, *kind_keys})
    base = ScheduleRecipe()
    schedule = faults.read(own_schedule, "schedule", table.get("schedule", {}), base) or base
    common = CommonTables(
        name=faults.read(typed, "name", table.get("name"), str),
        kind=faults.read(typed, "kind", table.get("kind", DEFAULT_KIND), str),
        sensor=faults.read(_sensor, table.get("sensor", {})),
        networks=faults.read(_networks, table.get("networks"), schedule, roles, main),
    )
    faults.refuse()
    return common


def mosaic_sensor(sensor: Sensor) -> BayerSensor:
    """Return a sensor with a mosaic of which training knows all that it simulates.

    Raises:
        ContractError: If it is another, or its size or response is not stated.
    """
    if not isinstance(sensor, BayerSensor):
        raise ContractError("this kind of camera has a Bayer mosaic; sensor.cfa is missing")
    return _known_sensor(sensor)


def picture_sensor(sensor: Sensor) -> ColorSensor:
    """Return a sensor with a mosaic, or with full planes: R, G, B or one of grey.

    Raises:
        ContractError: If it is another, or its size or response is not stated.
    """
    if isinstance(sensor, BayerSensor):
        return _known_sensor(sensor)
    if not isinstance(sensor, PlanesSensor) or sensor.channels not in (RGB, GREY):
        raise ContractError(
            "this kind of camera has a Bayer mosaic (sensor.cfa), or planes with the channels "
            'R, G, B or Y alone (sensor.type = "planes", sensor.channels)'
        )
    return _known_sensor(sensor)


def _known_sensor(sensor: _S) -> _S:
    """Refuse a sensor whose size or response is not stated."""
    if sensor.extent is None or sensor.channel_response is None:
        raise ContractError("sensor needs width_px, height_px, pixel_pitch_um, channel_response")
    return sensor


def with_new_names(table: Mapping[str, Any], older: Mapping[str, str]) -> Mapping[str, Any]:
    """Return the table of today's names, from one that may hold older ones.

    Checkpoints carry their recipe as text, so older names are read for ever.

    Args:
        table: A recipe.
        older: Older name -> today's.

    Raises:
        ContractError: If a table is there under both names.
    """
    for old, new in older.items():
        if {old, new} <= table.keys():
            raise ContractError(f"{old} is the older name of {new}; a recipe holds one of them")
    return {older.get(key, key): value for key, value in table.items()}


def differing_part(one: Recipe, other: Recipe, parts: Iterable[str]) -> str | None:
    """Return the first part in which two recipes describe different cameras, None for none.

    How networks are trained, and on which samples, may differ from size to size.
    """
    return next((part for part in parts if getattr(one, part) != getattr(other, part)), None)


def own_schedule(where: str, table: Any, base: ScheduleRecipe) -> ScheduleRecipe:
    """Return a schedule with what a table changes of it.

    Raises:
        ContractError: If a key is unknown or wrong.
    """
    if not isinstance(table, Mapping):
        raise ContractError(f"{where} must be a table; got {table!r}")
    whole = asdict(base) | dict(table)
    for name, kind in (("content", ContentRecipe), ("critic", CriticRecipe)):
        changes = table.get(name, {})
        if not isinstance(changes, Mapping):
            raise ContractError(f"{where}.{name} must be a table; got {changes!r}")
        whole[name] = section(f"{where}.{name}", kind, asdict(getattr(base, name)) | dict(changes))
    return section(where, ScheduleRecipe, whole)


def model(where: str, kind: type[M], table: Mapping[str, Any]) -> M:
    """Check a table that is part of the manifest too.

    Raises:
        ContractError: Naming the key.
    """
    try:
        return kind.model_validate(table.get(where, {}))
    except ValidationError as error:
        raise ContractError("; ".join(fault_texts(where, error, left_out=_FLAT))) from error


def _sensor(table: Any) -> Sensor:
    if not isinstance(table, Mapping):
        raise ContractError(f"sensor must be a table; got {table!r}")
    try:
        return _SENSOR.validate_python(nested_sensor(table))
    except ValidationError as error:
        raise ContractError("; ".join(fault_texts("sensor", error, left_out=_FLAT))) from error


def _networks(
    table: Any, schedule: ScheduleRecipe, roles: Sequence[str], main: str | None
) -> dict[str, dict[str, NetworkRecipe]]:
    if not isinstance(table, Mapping) or not table:
        raise ContractError("a recipe needs at least one table [networks.SIZE]")
    networks: dict[str, dict[str, NetworkRecipe]] = {}
    for name, entry in table.items():
        if not isinstance(entry, Mapping):
            raise ContractError(f"networks.{name} must be a table; got {entry!r}")
        if name in roles and not isinstance(entry.get("network"), str):
            for size, one in entry.items():
                networks.setdefault(name, {})[size] = _network(
                    f"networks.{name}.{size}", one, schedule
                )
            continue
        if main is None and len(roles) != 1:
            raise ContractError(
                f"networks.{name} is of no role; write [networks.ROLE.{name}] with one of the "
                f"roles {', '.join(roles)}"
            )
        networks.setdefault(main or roles[0], {})[name] = _network(
            f"networks.{name}", entry, schedule
        )
    return networks


def _network(where: str, entry: Any, schedule: ScheduleRecipe) -> NetworkRecipe:
    if not isinstance(entry, Mapping):
        raise ContractError(f"{where} must be a table; got {entry!r}")
    check_keys(where, entry, {"network", "config", "schedule"})
    return NetworkRecipe(
        network=typed(f"{where}.network", entry.get("network"), str),
        config=dict(entry.get("config", {})),
        schedule=own_schedule(f"{where}.schedule", entry.get("schedule", {}), schedule),
    )
