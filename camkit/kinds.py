"""The kinds of cameras: what every floor of camkit may ask about one, as plain data.

    name -> find_kind -> Kind        its sensor, usual stages and metrics
                           `-> part  the module of a floor that knows this kind

A kind of camera is one folder on each floor that it needs, and one line in `KINDS` here:

    camkit/runtime/kinds/NAME      readers and twin
    camkit/models_def/kinds/NAME   samples and judging, for training
    camkit/report/kinds/NAME       metrics, rows of the bench, scenarios of stress

A package of somebody else brings its own: its entry point in the group `camkit.kinds` names a
`Kind` whose `home` is the package that holds the folders `runtime`, `models_def` and `report`, or
those of them that it needs.
"""

import contextlib
import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from types import ModuleType
from typing import Final, Literal

from camkit.entry_points import entry_points, has_module, load_entry_point, load_part
from camkit.errors import ContractError, UnsupportedError

GROUP: Final = "camkit.kinds"
Floor = Literal["runtime", "models_def", "report"]


@dataclass(frozen=True, slots=True, kw_only=True)
class KindOption:
    """An option for the captures of some kind, beyond those of every camera.

    Attributes:
        name: In Python; on the command line --name.
        text: For people: what it chooses.
        choices: What it may be; empty for any text.
        is_file: Whether it names a file.
    """

    name: str
    text: str
    choices: tuple[str, ...] = ()
    is_file: bool = False

    def check(self, value: str) -> None:
        """Refuse a value that this option cannot have.

        Raises:
            ContractError: Names those it can have.
        """
        if self.choices and value not in self.choices:
            raise ContractError(
                f"{self.name} must be one of {', '.join(self.choices)}; got {value!r}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of camera.

    Attributes:
        name: As manifests and recipes name it.
        title: For people.
        sensor: Type of its sensor, see `camkit.bundle.sensor`.
        stages: Types of its usual stages, in order; see `camkit.bundle.stages`.
        metrics: Names of the metrics by which its results are judged.
        home: Package with its folders; empty for the kinds that come with camkit.
        file_types: Suffixes of files that only captures of this kind have, with their dots.
        shared_types: Suffixes of files that captures of this kind have too.
        options: What a caller may choose for this kind alone.
        scenes: Sources of scenes that it brings: name -> "module:function", which draws
            (3, h, w) float32 linear Rec.709 of (seed, height, width).
    """

    name: str
    title: str
    sensor: str
    stages: tuple[str, ...]
    metrics: tuple[str, ...]
    home: str = ""
    file_types: tuple[str, ...] = ()
    shared_types: tuple[str, ...] = ()
    options: tuple[KindOption, ...] = ()
    scenes: Mapping[str, str] = field(default_factory=dict)

    def part(self, floor: Floor) -> ModuleType:
        """Import the part of this kind that belongs to one floor.

        Raises:
            UnsupportedError: If that floor knows nothing of it.
            ContractError: If what a package brings fails.
        """
        name = self._module(floor)
        if not has_module(name):
            raise UnsupportedError(
                f"cameras of the kind {self.name!r} have no part in {floor}: add the package {name}"
            )
        if not self.home:
            return importlib.import_module(name)
        return load_part(name, f"the kind of camera {self.name!r}")

    def has_part(self, floor: Floor) -> bool:
        """Return whether a floor knows something of this kind."""
        return has_module(self._module(floor))

    def _module(self, floor: Floor) -> str:
        return f"{self.home}.{floor}" if self.home else f"camkit.{floor}.kinds.{self.name}"


BAYER: Final = Kind(
    name="bayer",
    title="a colour photograph behind a mosaic",
    sensor="bayer",
    stages=(
        *("linearise", "repair", "white_balance", "demosaic", "wiener", "network"),
        *("raise_clipped", "illumination", "undistort", "color"),
    ),
    metrics=("picture",),
)

HDR: Final = Kind(
    name="hdr",
    title="a photograph whose clipped lights are read from the streaks of a plate",
    sensor="bayer",
    stages=(
        *("linearise", "repair", "white_balance", "demosaic", "highlights", "network"),
        *("illumination", "undistort", "color"),
    ),
    metrics=("picture", "hdr"),
    scenes={"night": "camkit.runtime.kinds.hdr.night:night_scene"},
)

SPAD: Final = Kind(
    name="spad",
    title="single photons: counts, histograms and time stamps",
    sensor="spad",
    stages=("correct", "super_resolve", "sharpen"),
    metrics=(),
    file_types=(".npz", ".h5", ".hdf5", ".mat", ".ptu", ".sdt", ".zip", ".spc"),
    shared_types=(".tif", ".tiff"),
    options=(
        KindOption(
            name="timing",
            text="File (.toml) with the time of each bin; default: as the capture states.",
            is_file=True,
        ),
        KindOption(
            name="product",
            text="Result; default: depth or intensity.",
            choices=("depth", "intensity", "transient", "lifetime"),
        ),
        KindOption(
            name="pool",
            text="Side in px of the squares of pooled photons; default: auto.",
            choices=("auto", "1", "3", "5"),
        ),
        KindOption(
            name="returns",
            text="Largest number of surfaces per pixel; default: 1.",
            choices=("1", "2"),
        ),
    ),
)

KINDS: Final = {kind.name: kind for kind in (BAYER, HDR, SPAD)}
"""The kinds that come with camkit: one line each."""


def all_kinds() -> list[Kind]:
    """Return every kind that can be used here; a broken package brings none."""
    kinds = dict(KINDS)
    for name in sorted(entry_points(GROUP)):
        with contextlib.suppress(ContractError):
            kinds.setdefault(name, find_kind(name))
    return list(kinds.values())


def kinds_of_packages() -> dict[str, str]:
    """Return the kinds that packages bring by name: "ready", or why they are refused."""
    states = {}
    for name in sorted(entry_points(GROUP)):
        try:
            find_kind(name).part("runtime")
            states[name] = "ready"
        except (ContractError, UnsupportedError) as error:
            states[name] = str(error)
    return states


def kind_of_file(file: PurePath) -> Kind | None:
    """Return the kind that alone has files of this type; None if photographs are such files too."""
    suffix = file.suffix.lower()
    return next((kind for kind in all_kinds() if suffix in kind.file_types), None)


def find_kind(name: str) -> Kind:
    """Return the kind of a name: one of camkit's, or of an installed package.

    Raises:
        UnsupportedError: If there is none; names those there are.
        ContractError: If what is installed under that name is no kind.
    """
    if name in KINDS:
        return KINDS[name]
    installed = entry_points(GROUP)
    if name not in installed:
        names = ", ".join(sorted({*KINDS, *installed}))
        raise UnsupportedError(
            f"there is no kind of camera {name!r} here; there are: {names}. The package that "
            "brings it may not be installed"
        )
    kind = load_entry_point(installed[name], "kind of camera")
    if not isinstance(kind, Kind) or kind.name != name or not kind.home:
        raise ContractError(
            f"the entry point {installed[name].value!r} must be a camkit Kind called {name!r} with "
            "a home"
        )
    return kind
