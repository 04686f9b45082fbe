"""The contract of a foreign network: what it takes and gives, by its owner's TOML file.

    [input]   planes, order, space, range or mean and std, gain, noise, scale
    [output]  space, range or mean and std, residual, scale
    [global]  mode
    [proof]   pairs, space

Every fault of a contract is named at once.
"""

import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, TypeVar, cast, get_args

from camkit.bundle.stages.foreign.coding import Space
from camkit.bundle.stages.foreign.pack import PLACES, CodedColour
from camkit.errors import ContractError
from camkit.side_file import read_side_text

Planes = Literal["rgb", "rgb+restored", "mosaic", "packed"]
Residual = Literal["none", "added", "subtracted"]
Mode = Literal["refuse", "constants", "local", "whole"]
Numbers = tuple[float, ...]
Order = tuple[CodedColour, CodedColour, CodedColour, CodedColour]

SPACES: Final[dict[str, Space | None]] = {
    "camera-linear": "camera",
    "rec709-linear": "rec709",
    "srgb": "srgb",
    "stabilised": None,
}
"""Name in a contract -> that of a coding; None for the transform of camkit's own networks."""
USUAL_ORDER: Final[Order] = ("R", "G1", "G2", "B")
STABILISED_SCALE: Final = 64.0
LEAST_LOCAL_PX: Final = 16
MOST_LOCAL_PX: Final = 2048
_LOCAL: Final = re.compile(r"local:(\d{1,5})")
_TABLES: Final = {
    "input": ("planes", "order", "space", "range", "mean", "std", "gain", "noise", "scale"),
    "output": ("space", "range", "mean", "std", "residual", "scale"),
    "global": ("mode",),
    "proof": ("pairs", "space"),
}
_C = TypeVar("_C")


@dataclass(frozen=True, slots=True, kw_only=True)
class Affine:
    """Numbers of light between 0 and 1: gain * value + offset.

    Attributes:
        gain: One, or one for each channel.
        offset: Likewise.
    """

    gain: Numbers = (1.0,)
    offset: Numbers = (0.0,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Contract:
    """The contract of a network.

    Attributes:
        planes: What it takes.
        order: Of the planes of a packed cell.
        space: Of what it takes, as a contract names it.
        numbers: Of what it takes.
        exposure: Factor on the light in front of it, taken back behind it.
        noise: Whether it takes a map of the noise.
        stabilised_scale: Divisor of stabilised planes.
        output_space: Of what it gives.
        output_numbers: Of what it gives.
        residual: What is done with what it gives: nothing, added to its last plane, subtracted.
        scale: Samples of the output along a side for one of the input; None for as the graph says.
        mode: What becomes of statistics of the whole picture.
        local_px: Side of the windows of the mode local.
        pairs: Pairs of the owner's own script; None for none.
        pairs_space: Of their arrays.
    """

    planes: Planes
    space: str
    order: Order = USUAL_ORDER
    numbers: Affine = Affine()
    exposure: float = 1.0
    noise: bool = False
    stabilised_scale: float = STABILISED_SCALE
    output_space: str = ""
    output_numbers: Affine = Affine()
    residual: Residual = "none"
    scale: int | None = None
    mode: Mode = "refuse"
    local_px: int = 0
    pairs: Path | None = None
    pairs_space: str = "camera-linear"

    @property
    def is_of_mosaic(self) -> bool:
        """Return whether it takes samples of a mosaic."""
        return self.planes in ("mosaic", "packed")

    @property
    def plane_channels(self) -> tuple[int, ...]:
        """Return the channels of its planes."""
        return {"rgb": (3,), "rgb+restored": (3, 3), "mosaic": (1,), "packed": (4,)}[self.planes]

    @property
    def channels(self) -> int:
        """Return the channels that its network takes, a map of the noise included."""
        return sum(self.plane_channels) + self.noise


@dataclass(slots=True)
class _Reader:
    """Values of a contract, and what is wrong with them."""

    tables: dict[str, Any]
    faults: list[str] = field(default_factory=list)

    def value(self, table: str, key: str) -> Any:
        return self.tables.get(table, {}).get(key)

    def choice(self, table: str, key: str, choices: tuple[_C, ...], default: _C | None) -> _C:
        value = self.value(table, key)
        if value is None and default is not None:
            return default
        if value not in choices:
            names = ", ".join(f'"{choice}"' for choice in choices)
            got = "is missing" if value is None else f"is {value!r}"
            self.faults.append(f"{table}.{key} {got}; one of {names}")
            return choices[0]
        return cast("_C", value)

    def positive(self, table: str, key: str, default: float) -> float:
        value = self.value(table, key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
            self.faults.append(f"{table}.{key} is {value!r}; a number above 0")
            return default
        return float(value)

    def numbers(self, table: str, key: str, counts: tuple[int, ...]) -> Numbers | None:
        value = self.value(table, key)
        if value is None:
            return None
        values = value if isinstance(value, list) else [value]
        plain = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
        if not plain or len(values) not in counts:
            expected = " or ".join(map(str, counts))
            self.faults.append(f"{table}.{key} is {value!r}; {expected} number(s)")
            return None
        return tuple(map(float, values))


def read_contract(path: Path) -> Contract:
    """Read a contract.

    Raises:
        ContractError: Naming every fault.
        DecodeError: If the file cannot be read.
    """
    text = read_side_text(path, "the contract")
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ContractError(f"{path} is no TOML: {error}") from error
    try:
        return to_contract(tables, path.parent)
    except ContractError as error:
        raise ContractError(f"{path}: {error}") from error


def to_contract(tables: dict[str, Any], folder: Path = Path()) -> Contract:
    """Return the contract of some tables.

    Args:
        tables: As TOML has them.
        folder: That the path of the pairs is relative to.

    Raises:
        ContractError: Naming every fault.
    """
    reader = _Reader(tables)
    _check_keys(reader)
    planes: Planes = reader.choice("input", "planes", get_args(Planes), None)
    space = reader.choice("input", "space", tuple(SPACES), None)
    channels = {"rgb": 3, "rgb+restored": 3, "mosaic": 1, "packed": 4}[planes]
    numbers = _affine(reader, "input", (1, channels)) or Affine()
    given_output = _affine(reader, "output", (1, 3, 4))
    output_space = reader.choice("output", "space", tuple(SPACES), space)
    mode, local_px = _mode(reader)
    scale = reader.value("output", "scale")
    if scale is not None and (not isinstance(scale, int) or not 1 <= scale <= 16):
        reader.faults.append(f"output.scale is {scale!r}; a whole number from 1 to 16")
    contract = Contract(
        planes=planes,
        order=_order(reader, planes),
        space=space,
        numbers=numbers,
        exposure=reader.positive("input", "gain", 1.0),
        noise=reader.choice("input", "noise", ("none", "map"), "none") == "map",
        stabilised_scale=reader.positive("input", "scale", STABILISED_SCALE),
        output_space=output_space,
        output_numbers=given_output or _like(numbers),
        residual=reader.choice("output", "residual", get_args(Residual), "none"),
        scale=scale if isinstance(scale, int) else None,
        mode=mode,
        local_px=local_px,
        pairs=_pairs(reader, folder),
        pairs_space=reader.choice(
            "proof", "space", ("camera-linear", "rec709-linear", "srgb"), "camera-linear"
        ),
    )
    _check_together(reader, contract)
    if reader.faults:
        count = len(reader.faults)
        text = "; ".join(reader.faults)
        raise ContractError(f"{count} fault(s) in the contract: {text}")
    return contract


def _check_keys(reader: _Reader) -> None:
    for table, values in reader.tables.items():
        if table not in _TABLES or not isinstance(values, dict):
            names = ", ".join(f"[{name}]" for name in _TABLES)
            reader.faults.append(f"{table} is no table of a contract; there are {names}")
            reader.tables = {k: v for k, v in reader.tables.items() if k != table}
            continue
        for key in values:
            if key not in _TABLES[table]:
                names = ", ".join(_TABLES[table])
                reader.faults.append(f"{table}.{key} is not known; there are {names}")


def _affine(reader: _Reader, table: str, counts: tuple[int, ...]) -> Affine | None:
    """Return the numbers that light from 0 to 1 becomes: by a range, or by mean and deviation."""
    ends = reader.numbers(table, "range", (2,))
    mean, deviation = (reader.numbers(table, key, counts) for key in ("mean", "std"))
    if ends is not None and (mean is not None or deviation is not None):
        reader.faults.append(f"{table}.range and {table}.mean or std exclude each other")
        return None
    if ends is not None:
        if ends[0] == ends[1]:
            reader.faults.append(f"{table}.range is empty: {list(ends)}")
            return None
        return Affine(gain=(ends[1] - ends[0],), offset=(ends[0],))
    if mean is None and deviation is None:
        return None
    if deviation is not None and min(deviation) <= 0:
        reader.faults.append(f"{table}.std must be above 0; got {list(deviation)}")
        return None
    means, spreads = mean or (0.0,), deviation or (1.0,)
    count = max(len(means), len(spreads))
    means, spreads = (v * count if len(v) == 1 else v for v in (means, spreads))
    if len(means) != len(spreads):
        reader.faults.append(f"{table}.mean and {table}.std have different lengths")
        return None
    pairs = list(zip(means, spreads, strict=True))
    return Affine(
        gain=tuple(1 / spread for _, spread in pairs),
        offset=tuple(-mean / spread for mean, spread in pairs),
    )


def _like(numbers: Affine) -> Affine:
    """Return the numbers of an output that has those of the input, where it may have them."""
    return numbers if len(numbers.gain) in (1, 3) else Affine()


def _order(reader: _Reader, planes: Planes) -> Order:
    order = reader.value("input", "order")
    if order is None:
        return USUAL_ORDER
    if planes != "packed":
        reader.faults.append('input.order is of input.planes = "packed" alone')
        return USUAL_ORDER
    if not isinstance(order, list) or set(map(str, order)) != set(PLACES) or len(order) != 4:
        reader.faults.append(
            f"input.order is {order!r}; R, G1, G2, B in any order (G1 lies in the row of red)"
        )
        return USUAL_ORDER
    return cast("Order", tuple(order))


def _mode(reader: _Reader) -> tuple[Mode, int]:
    value = reader.value("global", "mode")
    if value is None:
        return "refuse", 0
    match = _LOCAL.fullmatch(value) if isinstance(value, str) else None
    if match is not None and LEAST_LOCAL_PX <= int(match[1]) <= MOST_LOCAL_PX:
        return "local", int(match[1])
    if match is None and value in ("refuse", "constants", "whole"):
        return cast("Mode", value), 0
    reader.faults.append(
        f'global.mode is {value!r}; one of "refuse", "constants", "whole" or "local:N", N from '
        f"{LEAST_LOCAL_PX} to {MOST_LOCAL_PX} px"
    )
    return "refuse", 0


def _pairs(reader: _Reader, folder: Path) -> Path | None:
    value = reader.value("proof", "pairs")
    if value is None:
        return None
    if not isinstance(value, str):
        reader.faults.append(f"proof.pairs is {value!r}; the path of an .npz")
        return None
    return folder / value


def _check_together(reader: _Reader, contract: Contract) -> None:
    """Find faults of values that do not go together."""
    if contract.is_of_mosaic and contract.space in ("rec709-linear", "srgb"):
        reader.faults.append(
            f'input.space = "{contract.space}" has red, green and blue in every pixel; a mosaic is '
            '"camera-linear"'
        )
    if (contract.space == "stabilised") != (contract.output_space == "stabilised"):
        reader.faults.append("input.space and output.space are both stabilised or neither is")
    if contract.space == "stabilised":
        if contract.is_of_mosaic:
            reader.faults.append('input.space = "stabilised" is of rgb and rgb+restored alone')
        extra = [
            key
            for key in ("range", "mean", "std", "gain", "noise")
            if reader.value("input", key) not in (None, "none")
        ]
        if extra:
            names = ", ".join(f"input.{key}" for key in extra)
            reader.faults.append(f"stabilised planes have no {names}: their noise is 0.5 / scale")
    elif reader.value("input", "scale") is not None:
        reader.faults.append('input.scale is of input.space = "stabilised" alone')
    if contract.residual != "none" and contract.space != contract.output_space:
        reader.faults.append("a residual lies in the space of the input; leave output.space out")
