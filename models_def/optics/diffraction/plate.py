"""A plate as a file: `PLATE.toml` says what it is and stands before, its heights lie beside it.

name = "four-lines"
glass = "SILICA"
heights = "four-lines.safetensors"     # what its heights follow from, see map_numbers

[bench]                                # aperture, lens, sensor: the fields of geometry.Bench
diameter_mm = 9.162
focal_length_mm = 50.0
focus_mm = 5000.0

[etching]                              # how the heights are made; without it as designed
range_um = 0.3
levels = 16

In place of `heights`, a pattern (`patterns`) and how many cells it is drawn with:

cells = 1527

[pattern]
kind = "star"
angles_deg = [0, 45, 90, 135]
near_um = 47.76
far_um = 716.4
share = 0.06
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from camkit.bundle.reader import PLATE, PLATE_HEIGHTS, SUFFIX, built_in_bundles, open_bundle
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.etching import Etching
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.map_numbers import HEIGHTS, MAX_CELLS, map_of
from camkit.models_def.optics.diffraction.patterns import PATTERNS, Pattern
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.toml_table import key_line, section
from camkit.side_file import parse_toml, read_side_bytes, read_side_toml
from camkit.units import UM_PER_MM

PLATES: Final = Path(__file__).resolve().parents[2] / "plates"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Head:
    """The keys of a file that are no tables."""

    name: str
    glass: str
    heights: str = ""
    cells: int = 0
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plate:
    """A plate before a lens.

    Attributes:
        name: For people.
        note: Where it comes from.
        glass: Strict name of its material.
        bench: Aperture, lens and sensor.
        height_um: (cells, cells) as designed, rows downwards; its side is the bench's diameter.
        etching: How it is made; None for as designed.
        pattern: What its heights follow from, if they are those of a pattern.
        numbers: The same, if they are those of a map of few numbers (`map_numbers`).
    """

    name: str
    glass: str
    bench: Bench
    height_um: Tensor
    etching: Etching | None = None
    note: str = ""
    pattern: Pattern | None = None
    numbers: Mapping[str, Tensor] | None = None

    def __post_init__(self) -> None:
        """Refuse heights that are none.

        Raises:
            ContractError: If so, or the glass is not known.
        """
        find_glass(self.glass)
        shape = tuple(self.height_um.shape)
        if len(shape) != 2 or shape[0] != shape[1] or not 1 < shape[0] <= MAX_CELLS:
            raise ContractError(
                f"plate {self.name}: heights are a square of 2 to {MAX_CELLS} cells; got {shape}"
            )
        if not self.height_um.is_floating_point():
            raise ContractError(f"plate {self.name}: heights are {self.height_um.dtype}")
        if not bool(torch.isfinite(self.height_um).all()):
            raise ContractError(f"plate {self.name}: a height is not a finite number")

    @property
    def cell_um(self) -> float:
        """Return the side of a cell."""
        return UM_PER_MM * self.bench.diameter_mm / self.height_um.shape[0]

    @property
    def made_um(self) -> Tensor:
        """Return the heights as they are made."""
        return self.height_um if self.etching is None else self.etching.etched(self.height_um)

    def index(self, wavelength_um: float) -> float:
        """Return the index of its glass."""
        wave = torch.tensor([wavelength_um], dtype=torch.float64)
        return float(refractive_index(find_glass(self.glass), wave))

    def psf(
        self,
        wavelength_um: float,
        grid: PixelGrid,
        depth_mm: float = math.inf,
        *,
        bare: bool = False,
    ) -> Tensor:
        """Return the PSF (side, side) of the plate, or of its lens without it; see `plate_psf`."""
        height_um = torch.zeros_like(self.height_um) if bare else self.made_um
        return plate_psf(
            height_um,
            self.index(wavelength_um),
            wavelength_um,
            bench=self.bench,
            grid=grid,
            depth_mm=depth_mm,
        )


def pattern_plate(
    name: str,
    pattern: Pattern,
    *,
    cells: int,
    bench: Bench,
    glass: str = "SILICA",
    etching: Etching | None = None,
    note: str = "",
) -> Plate:
    """Make the plate of a pattern.

    Raises:
        ContractError: If the pattern cannot be drawn with such cells, or the glass is not known.
    """
    if not 1 < cells <= MAX_CELLS:
        raise ContractError(f"a plate has 2 to {MAX_CELLS} cells along a side; got {cells}")
    medium = find_glass(glass)

    def index_at(wavelength_um: float) -> float:
        return float(refractive_index(medium, torch.tensor([wavelength_um], dtype=torch.float64)))

    return Plate(
        name=name,
        note=note,
        glass=glass,
        bench=bench,
        etching=etching,
        height_um=pattern.height_um(bench, index_at, cells),
        pattern=pattern,
    )


def built_in_plates() -> tuple[str, ...]:
    """Return the names of the plates that come with camkit."""
    return tuple(sorted(path.stem for path in PLATES.glob("*.toml")))


def _built_in(path: Path) -> Path:
    """Return the file of a built-in plate, or bundle that holds one, or the path as it is."""
    if path.is_file():
        return path
    if str(path) in built_in_plates():
        return PLATES / f"{path}.toml"
    bundle = built_in_bundles().get(str(path))
    return bundle if bundle is not None and PLATE in open_bundle(bundle).names else path


def is_plate(path: Path) -> bool:
    """Return whether optics are a plate: TOML that has a bench, a plate's name, or a bundle."""
    path = _built_in(path)
    if path.suffix == SUFFIX:
        return True
    if path.suffix.lower() != ".toml" or not path.is_file():
        return False
    return "bench" in read_side_toml(path, "optics")


def read_plate(path: Path) -> Plate:
    """Read a plate.

    Args:
        path: Its file, a bundle (.camkit) that holds it, or the name of a built-in one of either.

    Raises:
        ContractError: If the file, or that of its heights, is missing, damaged or no plate, or the
            bundle holds none.
        BundleError: If a bundle is refused.
    """
    path = _built_in(path)
    if path.suffix == SUFFIX:
        return _bundled(path)
    if not path.suffix and not path.exists():
        raise ContractError(
            f"no plate {path}: name a file, or one of {', '.join(built_in_plates())}"
        )

    def heights_of(name: str) -> bytes:
        if Path(name).name != name:
            raise ContractError(f"plate {path}: heights lie beside it, not at {name!r}")
        return read_side_bytes(path.with_name(name), "the heights")

    return to_plate(read_side_toml(path, "plate"), heights_of, what=str(path))


def _bundled(path: Path) -> Plate:
    bundle = open_bundle(path)
    if PLATE not in bundle.names:
        raise ContractError(f"{path} holds no {PLATE}; name a plate, or a bundle with one")
    names = (PLATE, PLATE_HEIGHTS)
    members = {name: bundle.member(name) for name in bundle.names if name in names}
    return plate_of_members(members, str(path))


def plate_members(plate: Plate) -> dict[str, bytes]:
    """Return a plate as members of a bundle: name -> content."""
    text, heights = plate_to_bytes(plate, PLATE_HEIGHTS)
    return {PLATE: text} if heights is None else {PLATE: text, PLATE_HEIGHTS: heights}


def plate_of_members(members: Mapping[str, bytes], what: str) -> Plate:
    """Return the plate of members of a bundle.

    Args:
        members: With `plate.toml`.
        what: What holds them, for errors.

    Raises:
        ContractError: If they are no plate.
    """

    def member(name: str) -> bytes:
        if name not in members:
            raise ContractError(f"the plate of {what} lacks its heights, {name}")
        return members[name]

    table = parse_toml(members[PLATE], f"{PLATE} of {what}")
    return to_plate(table, member, what=f"of {what}")


def to_plate(table: Mapping[str, Any], heights_of: Callable[[str], bytes], *, what: str) -> Plate:
    """Make the plate of a parsed file.

    Args:
        table: What the TOML file holds.
        heights_of: Name of the file of its heights, if it names one -> what that holds.
        what: Its name in error messages.

    Raises:
        ContractError: If it is no plate.
    """
    table = dict(table)
    parts = {key: table.pop(key, None) for key in ("bench", "etching", "pattern")}
    head = section(f"plate {what}", _Head, table)
    if parts["bench"] is None:
        raise ContractError(f"plate {what} lacks the table [bench]")
    bench = section("bench", Bench, parts["bench"])
    etching = None if parts["etching"] is None else section("etching", Etching, parts["etching"])
    if bool(head.heights) == (parts["pattern"] is not None):
        raise ContractError(f"plate {what} needs heights or a table [pattern], one of them")
    if head.heights and head.cells:
        raise ContractError(f"plate {what}: its heights know their cells; leave out cells")
    if parts["pattern"] is not None:
        return pattern_plate(
            head.name,
            _read_pattern(parts["pattern"]),
            cells=head.cells,
            bench=bench,
            glass=head.glass,
            etching=etching,
            note=head.note,
        )
    numbers = _numbers_of(heights_of(head.heights), head.heights)
    with torch.no_grad():
        height_um = map_of(numbers)().detach()
    return Plate(
        name=head.name,
        note=head.note,
        glass=head.glass,
        bench=bench,
        etching=etching,
        height_um=height_um,
        numbers=None if HEIGHTS in numbers else numbers,
    )


def _read_pattern(table: Any) -> Pattern:
    """Read the table of a pattern.

    Raises:
        ContractError: If it is none.
    """
    kind = table.get("kind") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in PATTERNS:
        raise ContractError(f"pattern.kind must be one of {', '.join(PATTERNS)}; got {kind!r}")
    return section("pattern", PATTERNS[kind], {k: v for k, v in table.items() if k != "kind"})


def _numbers_of(data: bytes, name: str) -> dict[str, Tensor]:
    """Decode the heights of a plate.

    Raises:
        ContractError: If they are none.
    """
    try:
        return load(data)
    except (SafetensorError, ValueError) as error:
        raise ContractError(f"{name} is no safetensors file: {error}") from error


def write_plate(plate: Plate, path: Path) -> None:
    """Write a plate and, unless it is one of a pattern, its heights beside it.

    The heights take the plate's name and appear before it; each file is whole or not there.

    Raises:
        OSError: If it cannot be written.
    """
    heights = path.with_suffix(".safetensors")
    text, numbers = plate_to_bytes(plate, heights.name)
    if numbers is not None:
        _replace(heights, numbers)
    _replace(path, text)


def plate_to_bytes(plate: Plate, heights: str) -> tuple[bytes, bytes | None]:
    """Return the TOML of a plate, and its heights; None for a plate of a pattern.

    Args:
        plate: The plate.
        heights: Name of the file that the heights will lie in, beside the TOML.
    """
    head: dict[str, str | int] = {"name": plate.name, "note": plate.note, "glass": plate.glass}
    if plate.pattern is None:
        head["heights"] = heights
    else:
        head["cells"] = plate.height_um.shape[0]
    lines = [key_line(k, v) for k, v in head.items()]
    lines += ["", "[bench]", *_entries(plate.bench)]
    if plate.etching is not None:
        lines += ["", "[etching]", *_entries(plate.etching)]
    if plate.pattern is not None:
        kind = next(k for k, pattern in PATTERNS.items() if isinstance(plate.pattern, pattern))
        lines += ["", "[pattern]", key_line("kind", kind), *_entries(plate.pattern)]
    text = ("\n".join(lines) + "\n").encode()
    if plate.pattern is not None:
        return text, None
    numbers = plate.numbers or {HEIGHTS: plate.height_um}
    return text, save({k: v.detach().contiguous() for k, v in numbers.items()})


def _entries(table: Any) -> list[str]:
    return [key_line(k, v) for k, v in asdict(table).items() if v is not None]


def _replace(path: Path, data: bytes) -> None:
    part = path.with_name(path.name + ".part")
    part.write_bytes(data)
    part.replace(path)
