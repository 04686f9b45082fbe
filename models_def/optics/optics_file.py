"""Optics by their file: a lens, a plate, or a PSF that was measured."""

from collections.abc import Sequence
from pathlib import Path

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.plate import is_plate, read_plate
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
from camkit.models_def.optics.freezable_optics import Optics
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.measured import MEASURED, read_measured


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
    is_other = path.suffix.lower() == MEASURED or is_plate(path)
    words = {"glass": glass or None, "catalogue": catalogue, "configuration": configuration}
    useless = [option_text(word) for word, value in words.items() if value is not None]
    if is_other and useless:
        raise ContractError(f"{path.name} is no lens; leave {', '.join(useless)} out")
    if path.suffix.lower() == MEASURED:
        return read_measured(path)
    if is_other:
        return PlateOptics(plate=read_plate(path))
    return LensOptics(lens=read_lens(path, glass, catalogue, configuration))
