"""The stages that a manifest may list, found by type: camkit's own, and those of packages."""

import operator
import re
from collections.abc import Mapping
from functools import reduce
from typing import Annotated, Any, Final, get_args

from pydantic import Field, GetCoreSchemaHandler, GetPydanticSchema
from pydantic_core import CoreSchema, core_schema

from camkit.bundle.stages.color import Color
from camkit.bundle.stages.correct import Correct
from camkit.bundle.stages.deglare import Deglare
from camkit.bundle.stages.demosaic import Demosaic
from camkit.bundle.stages.entry import PackageStage, StageEntry
from camkit.bundle.stages.foreign.pack import Pack
from camkit.bundle.stages.foreign.unpack import Unpack
from camkit.bundle.stages.haze import Dehaze
from camkit.bundle.stages.highlights import Highlights
from camkit.bundle.stages.illumination import Illumination
from camkit.bundle.stages.lifetime import Lifetime
from camkit.bundle.stages.linearise import Linearise
from camkit.bundle.stages.network import Network
from camkit.bundle.stages.raise_clipped import RaiseClipped
from camkit.bundle.stages.repair import Repair
from camkit.bundle.stages.sharpen import Sharpen
from camkit.bundle.stages.super_resolve import SuperResolve
from camkit.bundle.stages.undistort import Undistort
from camkit.bundle.stages.white_balance import WhiteBalance
from camkit.bundle.stages.wiener import Wiener
from camkit.entry_points import entry_points, load_entry_point
from camkit.errors import CamkitError, ContractError, UnsupportedError

GROUP: Final = "camkit.stages"
READY: Final = "ready"
BUILT_IN: Final[tuple[type[StageEntry], ...]] = (
    Linearise,
    Repair,
    WhiteBalance,
    Pack,
    Demosaic,
    Highlights,
    Deglare,
    Dehaze,
    Wiener,
    Network,
    Unpack,
    RaiseClipped,
    Illumination,
    Undistort,
    Color,
    Correct,
    SuperResolve,
    Sharpen,
    Lifetime,
)
"""The stages that come with camkit: one line each."""


def type_of(entry: type[StageEntry]) -> str:
    """Return the name of a stage in manifests."""
    return str(entry.model_fields["type"].default)


_BY_TYPE: Final = {type_of(entry): entry for entry in BUILT_IN}
_TYPE: Final = re.compile(r"[a-z][a-z0-9_]{0,39}")
_PACKAGE: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def find_stage(name: str) -> type[StageEntry]:
    """Return the stage of a type: camkit's own, or that of an installed package.

    Raises:
        UnsupportedError: If nobody brings it; names those there are.
        ContractError: If what is installed under that name is no stage.
    """
    if name in _BY_TYPE:
        return _BY_TYPE[name]
    installed = entry_points(GROUP)
    if name not in installed:
        names = ", ".join(sorted({*_BY_TYPE, *installed}))
        raise UnsupportedError(
            f"no installed package brings the stage {name!r}; there are: {names}"
        )
    return _of_package(name)


def _of_package(name: str) -> type[StageEntry]:
    """Return the stage that a package brings under a name.

    Raises:
        ContractError: If it is no stage of that type, or camkit has one of that name.
    """
    point = entry_points(GROUP)[name]
    if name in _BY_TYPE:
        raise ContractError(
            f"the entry point {point.value!r} brings a stage {name!r}, which camkit has; a stage "
            "of a package needs another name"
        )
    entry = load_entry_point(point, "stage")
    if (
        not (isinstance(entry, type) and issubclass(entry, PackageStage))
        or type_of(entry) != name
        or not entry.runtime
    ):
        raise ContractError(
            f"the entry point {point.value!r} must be a camkit PackageStage of the type {name!r} "
            "that names its runtime module"
        )
    packages = {_plain(name) for name in get_args(entry.model_fields["package"].annotation)}
    if point.dist is not None and packages and _plain(point.dist.name) not in packages:
        raise ContractError(
            f"the stage {name!r} says that {' or '.join(sorted(packages))} brings it; it is "
            f"{point.dist.name}"
        )
    return entry


def _plain(distribution: str) -> str:
    """Return the name of a distribution as packaging compares it."""
    return re.sub(r"[-_.]+", "-", distribution).lower()


def all_stages() -> list[type[StageEntry]]:
    """Return every stage that can be used here; a broken package brings none."""
    ready = [name for name, state in stages_of_packages().items() if state == READY]
    return [*BUILT_IN, *map(_of_package, ready)]


def stages_of_packages() -> dict[str, str]:
    """Return the stages that packages bring by name: `READY`, or why they are refused."""
    states = {}
    for name in sorted(entry_points(GROUP)):
        try:
            _of_package(name)
            states[name] = READY
        except ContractError as error:
            states[name] = str(error)
    return states


def _validated(value: Any, built_in: core_schema.ValidatorFunctionWrapHandler) -> StageEntry:
    """Return a stage, checked as its type demands."""
    table = value if isinstance(value, Mapping) else {}
    name = table.get("type", getattr(value, "type", None))
    if not isinstance(name, str) or not _TYPE.fullmatch(name) or name in _BY_TYPE:
        entry: StageEntry = built_in(value)  # it refuses what is no name
        return entry
    try:
        return find_stage(name).model_validate(value)
    except UnsupportedError as error:
        package = str(table.get("package", ""))
        hint = f"; the bundle names the package {package!r}" if _PACKAGE.fullmatch(package) else ""
        raise ValueError(f"{error}{hint}") from error
    except CamkitError as error:
        raise ValueError(str(error)) from error


def _schema(_: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
    """Return the schema of a stage: what is published are those of camkit."""
    union: Any = reduce(operator.or_, BUILT_IN)
    return core_schema.no_info_wrap_validator_function(
        _validated,
        handler.generate_schema(Annotated[union, Field(discriminator="type")]),
        serialization=core_schema.simple_ser_schema("any"),
    )


Stage = Annotated[StageEntry, GetPydanticSchema(_schema)]
