"""Checkpoints and the files beside them to a bundle: `camkit.export.bundle`, `camkit export`."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Final

from camkit.bundle.psf_file import read_optics_bytes, read_source
from camkit.caller import command_text, option_text
from camkit.errors import ContractError
from camkit.export.parts import (
    HAZE_NAME,
    PLAN_NAME,
    PSF_NAME,
    REPORT_NAME,
    STRESS_HAZE_NAME,
    STRESS_NAME,
    Parts,
)
from camkit.field_types import checked
from camkit.models_def.face.torch_need import require_torch
from camkit.progress import note
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.output.part_file import refuse_existing

NO_PLATE: Final = "none"
RECIPE: Final = ".toml"
FOREIGN: Final = (".onnx", ".pth")
NETWORK_ADD: Final = "camkit network add"


@checked
def bundle(
    checkpoints: FilePath | Sequence[FilePath],
    out: FilePath,
    *,
    psf: FilePath | None = None,
    haze: FilePath | None = None,
    stress_psf: FilePath | None = None,
    stress_haze: FilePath | None = None,
    freeze: FilePath | None = None,
    plan: FilePath | None = None,
    prescription: FilePath | None = None,
    plate: FilePath | None = None,
    version: str = "0.1.0",
    network: bool = True,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Pack checkpoints, PSF, lens or plate into a bundle and verify it (needs torch).

    Args:
        checkpoints: One per network size and role, of one camera; without a network, its recipe.
        out: Bundle to write (.camkit).
        psf: PSF of `camkit.freeze`; None for psf.safetensors beside the first checkpoint, else
            the measured PSF that the recipe names.
        haze: Veiling glare of the optics; None for haze.safetensors beside the PSF, if any.
        stress_psf: Kernels off the design point; None for stress_psf.safetensors beside the
            checkpoint, if any.
        stress_haze: Veiling glare of those kernels; None for stress_haze.safetensors beside them,
            if any.
        freeze: Report of `camkit.freeze`; None for freeze.json beside the checkpoint, if any.
        plan: Calibration of quality "adaptive"; None for plan.json there, if any.
        prescription: Lens (.toml, .zmx); None for the checkpoint's.
        plate: Plate (.toml or name), "none" for no plate; None for the checkpoint's.
        version: Semantic version of the bundle.
        network: False packs a recipe without any network: its filter restores alone.
        overwrite: Whether a file that exists is replaced.

    Returns:
        Path, size, hash, sizes of network and the lines of the check, plain JSON values as
        `camkit export --json` prints them.

    Raises:
        ContractError: If parts are missing or contradict each other, or `out` exists.
        ParityError: If torch and ONNX, or the bundle and its golden cases, disagree.
        UnsupportedError: If torch or what draws the preview is not installed.
    """
    tracing = ("onnxscript",) if network else ()
    require_torch(command_text("export"), "matplotlib", *tracing)
    refuse_existing([Path(out)], overwrite=overwrite)
    several = [checkpoints] if isinstance(checkpoints, str | PathLike) else checkpoints
    paths = tuple(map(Path, several))
    if not paths:
        raise ContractError("export needs at least one checkpoint")
    for path in paths:
        if path.suffix.lower() in FOREIGN:
            raise ContractError(
                f"{path} is no checkpoint of camkit (.pt); a network of your own comes in by "
                f"`{NETWORK_ADD}`"
            )
    _check_first(paths, network=network)
    folder = paths[0].parent
    optics = _usual_file(psf, folder, PSF_NAME)
    stress = _usual_file(stress_psf, folder, STRESS_NAME)
    from camkit.export import assemble

    parts = Parts(
        checkpoints=paths if network else (),
        recipe=None if network else paths[0],
        psf=optics,
        haze=_usual_file(haze, optics and optics.parent, HAZE_NAME),
        stress_psf=stress,
        stress_haze=_usual_file(stress_haze, stress and stress.parent, STRESS_HAZE_NAME),
        prescription=None if prescription is None else Path(prescription),
        plate=None if plate in (None, NO_PLATE) else Path(plate),
        without_plate=plate == NO_PLATE,
        freeze=_usual_file(freeze, folder, REPORT_NAME),
        plan=_usual_file(plan, folder, PLAN_NAME),
        version=version,
    )
    report = assemble.export_bundle(parts, Path(out))
    if optics is not None and parts.freeze is None:
        _note_missing_report(optics)
    return report


def _note_missing_report(psf: Path) -> None:
    """Report that the manifest lacks what freezing found, where `camkit freeze` wrote the PSF."""
    source = read_source(read_optics_bytes(psf, what="PSF"))
    if source is not None:
        note(
            f"{psf.name} is of {source}: give its report by {option_text('freeze')}, or the "
            "bundle states no focal length, F-number, PSF model and block grid of it"
        )


def _check_first(paths: tuple[Path, ...], *, network: bool) -> None:
    """Refuse a recipe in place of checkpoints, and the other way round."""
    are_recipes = [path.suffix.lower() == RECIPE for path in paths]
    if network and any(are_recipes):
        raise ContractError(
            f"{paths[are_recipes.index(True)]} is a recipe; export takes checkpoints of "
            f"`camkit train`, or a recipe with {option_text('network', value=False)}"
        )
    if not network and (len(paths) != 1 or not are_recipes[0]):
        raise ContractError(
            f"{option_text('network', value=False)} takes one recipe ({RECIPE}) in place of "
            f"checkpoints; got {', '.join(path.name for path in paths)}"
        )


def _usual_file(path: FilePath | None, folder: Path | None, name: str) -> Path | None:
    """Return the file that is named, else that of the usual name in a folder, if it exists."""
    if path is not None:
        return Path(path)
    usual = None if folder is None else folder / name
    return usual if usual is not None and usual.is_file() else None
