"""`camkit lens convert`: a lens file in another format, scaled or stopped where asked."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json, Overwrite
from camkit.cli.say import say

if TYPE_CHECKING:
    from camkit.models_def.optics.prescription import Lens

STATEFUL: Final = (".toml", ".zmx")
"""Formats that hold configurations."""


def convert(
    source: Annotated[Path, typer.Argument(help="Lens file (.toml, .zmx or .json).", metavar="IN")],
    target: Annotated[
        Path | None,
        typer.Argument(help="File to write: .toml, .zmx, .json (optiland), .csv.", metavar="OUT"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="File to write, in place of OUT.")
    ] = None,
    efl_mm: Annotated[
        float | None, typer.Option(help="Focal length in mm to scale the lens to.")
    ] = None,
    f_number: Annotated[
        float | None, typer.Option(help="F-number to stop the lens down to, after scaling.")
    ] = None,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write a lens in another format and report on stderr what is lost (needs torch).

    A finite object distance is scaled with the lens. A table (.csv) holds the sag of every surface.
    All configurations go to .toml and .zmx, unless --configuration or --f-number takes one.
    """
    from camkit.cli.design.design_time import refuse_existing, require_torch
    from camkit.errors import ContractError

    require_torch("camkit lens convert")
    if (target is None) == (out is None):
        raise ContractError("name one file to write: OUT or --out")
    path = target or out or Path()
    refuse_existing([path], overwrite=overwrite)
    from camkit.models_def.optics.lens_file.lens_file import (
        read_configured_lens,
        read_noted_lens,
        ready_for_lens,
        write_lens,
    )
    from camkit.models_def.optics.lens_file.states import plain_lens
    from camkit.models_def.optics.scaling import scale_to_efl, with_f_number
    from camkit.models_def.optics.thin.lens_sag import write_lens_sag

    is_table = path.suffix.lower() == ".csv"
    if is_table:
        path.parent.mkdir(parents=True, exist_ok=True)
    else:
        ready_for_lens(path)
    has_states = path.suffix.lower() in STATEFUL and configuration is None and f_number is None
    files = source, glass or (), catalogue
    lens, notes = (
        read_configured_lens(*files) if has_states else read_noted_lens(*files, configuration)
    )
    if efl_mm is not None:
        lens = scale_to_efl(lens, efl_mm, measured=plain_lens(lens))
    if f_number is not None:
        lens = with_f_number(lens, f_number)
        notes = (*notes, *_clipped(lens, is_scaled=efl_mm is not None))
    notes = (*notes, *_left_behind(lens, path.suffix.lower()))
    if is_table:
        notes = (*notes, *write_lens_sag(lens, path))
    else:
        write_lens(lens, path)
    for note in notes:
        say(f"{source.name}: {note}", err=True)
    record = {**_record(lens), "out": str(path), "notes": list(notes)}
    say(json.dumps(record) if json_ else _text(record))


def _record(lens: "Lens") -> dict[str, Any]:
    from camkit.models_def.optics.lens_file.states import plain_lens
    from camkit.models_def.optics.paraxial import paraxial_data

    efl_mm = paraxial_data(plain_lens(lens)).efl_mm
    return {
        "lens": lens.name,
        "surfaces": len(lens.surfaces),
        "efl_mm": efl_mm if math.isfinite(efl_mm) else None,
        "configurations": [state.name for state in lens.configurations],
    }


def _text(record: dict[str, Any]) -> str:
    efl_mm = record["efl_mm"]
    efl = "afocal" if efl_mm is None else f"EFL {efl_mm:.4g} mm"
    return f"{record['out']}: {record['lens']}, {record['surfaces']} surfaces, {efl}"


def _left_behind(lens: "Lens", suffix: str) -> list[str]:
    """Return what of a lens a format does not hold."""
    notes = []
    if suffix == ".zmx" and lens.configurations:
        names = [state.name for state in lens.configurations]
        if names != [str(number) for number in range(1, len(names) + 1)]:
            listed_names = ", ".join(names)
            notes.append(
                f"configurations are numbered in OUT, their names stay behind: {listed_names}"
            )
    if suffix != ".toml" and any(surface.vary for surface in lens.surfaces):
        notes.append("what `vary` names stays behind: OUT is all fixed")
    return notes


def _clipped(lens: "Lens", *, is_scaled: bool) -> list[str]:
    """Return whether rims that were not opened cut the beam on the axis."""
    import torch

    from camkit.models_def.optics.analysis.sampling import Pupil
    from camkit.models_def.optics.analysis.spots import spot_diagram
    from camkit.models_def.optics.trace import Fate

    waves = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    fate = spot_diagram(lens, torch.zeros(1, dtype=torch.float64), waves, Pupil()).fate
    cut = int((fate == Fate.VIGNETTED).sum())
    if not cut:
        return []
    scaled = "scaled with the lens, " if is_scaled else ""
    return [
        f"rims are {scaled}not opened for the new F-number: they cut {cut} of {fate.numel()} rays "
        "on the axis; open them in the file"
    ]
