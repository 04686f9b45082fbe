"""A plate as a file: `PLATE.toml` says what it is and stands before, its heights lie beside it.

name = "four-lines"
glass = "SILICA"
heights = "four-lines.safetensors"     # height_um (cells, cells), float32, as designed

[bench]                                # aperture, lens, sensor: the fields of geometry.Bench
diameter_mm = 9.162
focal_length_mm = 50.0
focus_mm = 5000.0

[etching]                              # how the heights are made; without it as designed
range_um = 0.3
levels = 16
"""

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.fabrication import Etching
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.toml_table import key_line, read_table, section
from camkit.units import UM_PER_MM

MAX_CELLS: Final = 16_384
HEIGHTS: Final = "height_um"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Head:
    """The keys of a file that are no tables."""

    name: str
    glass: str
    heights: str
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
    """

    name: str
    glass: str
    bench: Bench
    height_um: Tensor
    etching: Etching | None = None
    note: str = ""

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
        """Give the side of a cell."""
        return UM_PER_MM * self.bench.diameter_mm / self.height_um.shape[0]

    @property
    def made_um(self) -> Tensor:
        """Give the heights as they are made."""
        return self.height_um if self.etching is None else self.etching.etched(self.height_um)

    def index(self, wavelength_um: float) -> float:
        """Give the index of its glass."""
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
        """Give the PSF (side, side) of the plate, or of its lens without it; see `plate_psf`."""
        height_um = torch.zeros_like(self.height_um) if bare else self.made_um
        return plate_psf(
            height_um,
            self.index(wavelength_um),
            wavelength_um,
            bench=self.bench,
            grid=grid,
            depth_mm=depth_mm,
        )


def is_plate(path: Path) -> bool:
    """Tell whether a file is that of a plate: TOML that speaks of a bench."""
    if path.suffix.lower() != ".toml" or not path.is_file():
        return False
    return "bench" in read_table(path, "optics")


def read_plate(path: Path) -> Plate:
    """Read a plate.

    Raises:
        ContractError: If the file, or that of its heights, is missing, damaged or no plate.
    """
    table = read_table(path, "plate")
    parts = {key: table.pop(key, None) for key in ("bench", "etching")}
    head = section(f"plate {path}", _Head, table)
    if parts["bench"] is None:
        raise ContractError(f"plate {path} lacks the table [bench]")
    etching = parts["etching"]
    return Plate(
        name=head.name,
        note=head.note,
        glass=head.glass,
        bench=section("bench", Bench, parts["bench"]),
        etching=None if etching is None else section("etching", Etching, etching),
        height_um=_read_heights(path, head.heights),
    )


def _read_heights(plate: Path, name: str) -> Tensor:
    """Read the heights beside a plate.

    Raises:
        ContractError: If they cannot be.
    """
    if Path(name).name != name:
        raise ContractError(f"plate {plate}: heights lie beside it, not at {name!r}")
    path = plate.with_name(name)
    try:
        tensors = load(path.read_bytes())
    except OSError as error:
        raise ContractError(f"cannot read the heights {path}: {error.strerror}") from error
    except (SafetensorError, ValueError) as error:
        raise ContractError(f"{path} is no safetensors file: {error}") from error
    if set(tensors) != {HEIGHTS}:
        raise ContractError(f"{path} holds {', '.join(sorted(tensors))}; wanted is {HEIGHTS}")
    return tensors[HEIGHTS]


def write_plate(plate: Plate, path: Path) -> None:
    """Write a plate and, beside it under the same name, its heights.

    Raises:
        OSError: If it cannot be written.
    """
    heights = path.with_suffix(".safetensors")
    head = {"name": plate.name, "note": plate.note, "glass": plate.glass, "heights": heights.name}
    lines = [key_line(k, v) for k, v in head.items()]
    bench = {k: v for k, v in asdict(plate.bench).items() if v is not None}
    lines += ["", "[bench]", *(key_line(k, v) for k, v in bench.items())]
    if plate.etching is not None:
        lines += ["", "[etching]", *(key_line(k, v) for k, v in asdict(plate.etching).items())]
    heights.write_bytes(save({HEIGHTS: plate.height_um.detach().contiguous()}))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
