"""Optics by their file: a lens, a plate, or a PSF that was measured."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.plate import is_plate, read_plate
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
from camkit.models_def.optics.freezable_optics import Optics
from camkit.models_def.optics.lens_file.lens_file import read_configured_lens, read_lens
from camkit.models_def.optics.lens_file.states import configuration_name, plain_lens
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.measured import MEASURED, read_measured
from camkit.models_def.optics.prescription import Lens
from camkit.progress import note

ALL: Final = "all"


def read_optics(
    path: Path,
    glass: Sequence[Path | str] = (),
    catalogue: str | None = None,
    configuration: str | int | None = None,
) -> Optics:
    """Read optics: .safetensors as a measured PSF, TOML with a table [bench] as a plate.

    A bundle is read for its plate; anything else is a lens (`read_lens`).

    Args:
        path: The file, or the name of a built-in lens or plate.
        glass: Of a lens, see `read_noted_lens`.
        catalogue: Of a lens, see `read_noted_lens`.
        configuration: Of a lens, see `read_noted_lens`.

    Raises:
        ContractError: If glasses or a configuration are given for other optics than a lens.
        BundleError: If a PSF is missing or damaged, or a bundle is.
        CamkitError: If a lens is wrong, see `read_lens`, or a plate, see `read_plate`.
    """
    is_other = _is_other(path)
    words = {"glass": glass or None, "catalogue": catalogue, "configuration": configuration}
    useless = [option_text(word) for word, value in words.items() if value is not None]
    if is_other and useless:
        raise ContractError(f"{path.name} is no lens; leave {', '.join(useless)} out")
    if path.suffix.lower() == MEASURED:
        return read_measured(path)
    if is_other:
        return PlateOptics(plate=read_plate(path))
    return LensOptics(lens=read_lens(path, glass, catalogue, configuration))


def read_states(
    path: Path,
    glass: Sequence[Path | str] = (),
    catalogue: str | None = None,
    configurations: str | Sequence[str | int] = ALL,
) -> tuple[LensOptics, ...]:
    """Read a lens in several configurations.

    Args:
        path: The file, or the name of a built-in lens.
        glass: See `read_noted_lens`.
        catalogue: See `read_noted_lens`.
        configurations: Names or numbers in the order wanted; "all" for all, the usual one first.

    Raises:
        ContractError: If the optics are no lens, it has no configurations, or there is no such one.
        CamkitError: If the lens is wrong, see `read_lens`.
    """
    if _is_other(path):
        raise ContractError(f"{path.name} is no lens; leave {option_text('configurations')} out")
    lens, notes = read_configured_lens(path, glass, catalogue)
    for line in notes:
        note(f"{path.name}: {line}")
    names = state_names(lens, configurations)
    return tuple(LensOptics(lens=plain_lens(lens, name)) for name in names)


def state_names(lens: Lens, configurations: str | Sequence[str | int]) -> list[str]:
    """Return the names of several configurations of a lens, see `read_states`.

    Raises:
        ContractError: If the lens has none, or there is no such one.
    """
    if not lens.configurations:
        raise ContractError(
            f"{lens.name} has no configurations; leave {option_text('configurations')} out"
        )
    choices: Sequence[str | int | None]
    if configurations == ALL:
        choices = [None, *(state.name for state in lens.configurations)]
    else:
        choices = [configurations] if isinstance(configurations, str) else configurations
    # the usual one comes twice
    return list(dict.fromkeys(configuration_name(lens, choice) for choice in choices))


def _is_other(path: Path) -> bool:
    """Return whether a file is that of other optics than a lens."""
    return path.suffix.lower() == MEASURED or is_plate(path)
