"""Read or write a lens by the suffix of its file; a built-in one by its name.

.toml is camkit's own format, .zmx that of lens catalogues, .json that of optiland or DeepLens.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from camkit.bundle.states.lens_state import usual_note
from camkit.caller import option_text
from camkit.errors import CamkitError, ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.glass.agf import read_agf
from camkit.models_def.optics.glass.catalogue import GlassCatalogue, preferred_catalogues
from camkit.models_def.optics.lens_file.deeplens_reader import KEY as DEEPLENS_KEY
from camkit.models_def.optics.lens_file.deeplens_reader import parse_deeplens
from camkit.models_def.optics.lens_file.json_table import read_json_table
from camkit.models_def.optics.lens_file.optiland_reader import KEY as OPTILAND_KEY
from camkit.models_def.optics.lens_file.optiland_reader import parse_optiland
from camkit.models_def.optics.lens_file.optiland_writer import write_optiland
from camkit.models_def.optics.lens_file.states import (
    configuration_name,
    plain_lens,
)
from camkit.models_def.optics.lens_file.zmx_glass import GLASS_RULES, GlassRule
from camkit.models_def.optics.lens_file.zmx_reader import ZmxLens, read_zmx
from camkit.models_def.optics.lens_file.zmx_writer import write_zmx
from camkit.models_def.optics.prescription import Lens, read_prescription, write_prescription

SUFFIXES: Final = (".toml", ".zmx", ".json")
KERNELS: Final = (".npy", ".npz", ".mat", ".exr", ".png", ".tif", ".tiff", ".txt")
"""Files that people have kernels in."""
PRESCRIPTIONS: Final = Path(__file__).resolve().parents[2] / "prescriptions"

_log = logging.getLogger(__name__)


def read_lens(
    path: Path,
    glass: Sequence[Path | str] = (),
    catalogue: str | None = None,
    configuration: str | int | None = None,
) -> Lens:
    """Read a lens; what of a file of another program is left out is logged as a warning.

    Args:
        path: .toml, .zmx or .json, in small or capital letters, or the name of a built-in lens.
        glass: See `read_noted_lens`.
        catalogue: See `read_noted_lens`.
        configuration: See `read_noted_lens`.

    Raises:
        UnsupportedError: If the suffix is another, or a file holds what camkit lacks.
        ContractError: If the lens is wrong or a glass unknown.
        DecodeError: If a file is damaged.
    """
    lens, notes = read_noted_lens(path, glass, catalogue, configuration)
    for note in notes:
        _log.warning("%s: %s", path.name, note)
    return lens


def read_noted_lens(
    path: Path,
    glass: Sequence[Path | str] = (),
    catalogue: str | None = None,
    configuration: str | int | None = None,
) -> tuple[Lens, tuple[str, ...]]:
    """Read a lens in one configuration, and what of its file it does not carry, one line each.

    Args:
        path: As of `read_lens`.
        glass: Catalogues (.agf) of the user, and at most one of `names` and `numbers`: what holds
            where a line of a .zmx file has both (`GlassRule`).
        catalogue: Catalogues of camkit that are asked first for a name that several have, in this
            order, with commas between them: schott,hikari.
        configuration: Name of one, or its number from 1; None for the usual one, which is noted.
    """
    file = _LensFile.of(path, glass, catalogue)
    if file.suffix == ".zmx":
        prescription = file.read_zmx(choice=configuration, every=False)
        return prescription.lens, prescription.notes
    lens, notes = file.read()
    if lens.configurations and configuration is None:
        names = [state.name for state in lens.configurations]
        notes = (*notes, usual_note(names, configuration_name(lens)))
    return plain_lens(lens, configuration), notes


def read_configured_lens(
    path: Path, glass: Sequence[Path | str] = (), catalogue: str | None = None
) -> tuple[Lens, tuple[str, ...]]:
    """Read a lens with all its configurations, and notes; see `read_noted_lens`."""
    file = _LensFile.of(path, glass, catalogue)
    if file.suffix == ".zmx":
        prescription = file.read_zmx(choice=None, every=True)
        return prescription.lens, prescription.notes
    return file.read()


@dataclass(frozen=True, slots=True, kw_only=True)
class _LensFile:
    """A lens file and the glasses that are looked up for it."""

    path: Path
    suffix: str
    catalogues: Sequence[GlassCatalogue]
    preferred: Sequence[GlassCatalogue]
    rule: GlassRule

    @classmethod
    def of(cls, path: Path, glass: Sequence[Path | str], catalogue: str | None) -> "_LensFile":
        """Find a file; see `read_noted_lens`."""
        path = _built_in(path)
        rules = [rule for rule in GLASS_RULES if rule in map(str, glass)]
        if len(rules) > 1:
            raise ContractError(f"{option_text('glass')} takes one of {' and '.join(rules)}")
        return cls(
            path=path,
            catalogues=[read_agf(Path(file)) for file in glass if str(file) not in GLASS_RULES],
            preferred=preferred_catalogues(catalogue),
            suffix=_suffix(path),
            rule=rules[0] if rules else "nearest",
        )

    def read_zmx(self, *, choice: str | int | None, every: bool) -> ZmxLens:
        """Read a .zmx file in one or every configuration."""
        return read_zmx(
            self.path, self.catalogues, self.rule, self.preferred, choice=choice, every=every
        )

    def read(self) -> tuple[Lens, tuple[str, ...]]:
        """Read another file, with all its configurations."""
        if self.suffix == ".toml":
            return read_prescription(self.path, self.catalogues, self.preferred), ()
        return _read_json(self.path, self.catalogues, self.preferred)


def _read_json(
    path: Path, catalogues: Sequence[GlassCatalogue], preferred: Sequence[GlassCatalogue]
) -> tuple[Lens, tuple[str, ...]]:
    table = read_json_table(path)
    readers = {OPTILAND_KEY: parse_optiland, DEEPLENS_KEY: parse_deeplens}
    reader = next((reader for key, reader in readers.items() if key in table), None)
    if reader is None:
        raise DecodeError(
            f"{path.name}: no lens file of optiland ({OPTILAND_KEY}) or DeepLens ({DEEPLENS_KEY})"
        )
    try:
        return reader(table, catalogues, preferred, name=path.stem)
    except CamkitError as error:
        raise type(error)(f"{path.name}: {error}") from error


def ready_for_lens(path: Path) -> None:
    """Refuse a file that no lens can be written to, before any work; make its folder.

    Raises:
        UnsupportedError: If the suffix is none of `SUFFIXES`.
    """
    _suffix(path)
    path.parent.mkdir(parents=True, exist_ok=True)


def write_lens(lens: Lens, path: Path) -> None:
    """Write a lens in the format of the suffix: camkit's own, .zmx, or optiland's JSON."""
    writers = {".toml": write_prescription, ".zmx": write_zmx, ".json": write_optiland}
    writers[_suffix(path)](lens, path)


def built_in_lenses() -> tuple[str, ...]:
    """Return the names of the lenses that come with camkit."""
    return tuple(sorted(path.stem for path in PRESCRIPTIONS.glob("*.toml")))


def find_lens(name: str, folder: Path | None = None, *, with_states: bool = False) -> Lens:
    """Return the lens that a recipe names: a built-in one, or that of a file.

    Args:
        name: Name of a built-in lens, or path (.toml, .zmx or .json) relative to
            `folder`.
        folder: Of the recipe; None for the working directory.
        with_states: Whether it comes with all its configurations, and not in the usual one.

    Raises:
        ContractError: If there is neither, or the lens is wrong.
    """
    if name in built_in_lenses():
        path = PRESCRIPTIONS / f"{name}.toml"
    else:
        path = (folder or Path()) / name
    if not path.is_file():
        names = ", ".join(built_in_lenses())
        raise ContractError(
            f"no lens {name!r}: give a path (.toml, .zmx, .json), or one of {names}"
        )
    return read_configured_lens(path)[0] if with_states else read_lens(path)


def _built_in(path: Path) -> Path:
    is_name = not path.is_file() and str(path) in built_in_lenses()
    return PRESCRIPTIONS / f"{path}.toml" if is_name else path


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix == ".safetensors":
        raise UnsupportedError(
            f"{path.name} is a PSF and no lens: a recipe names it as psf in [lens]"
        )
    if suffix in KERNELS:
        raise UnsupportedError(
            f"{path.name} is no lens file ({' or '.join(SUFFIXES)}); if it holds kernels of a PSF, "
            "convert it by `camkit psf import`"
        )
    if suffix not in SUFFIXES:
        raise UnsupportedError(
            f"a lens file ends in {' or '.join(SUFFIXES)}; got {path.name}: rename or convert it, "
            f"or name one of {', '.join(built_in_lenses())}"
        )
    return suffix
