"""`camkit lens convert`: a lens file in the other format, scaled or stopped where asked."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, GlassFiles, Json, Overwrite
from camkit.cli.say import say

if TYPE_CHECKING:
    from camkit.models_def.optics.prescription import Lens


def convert(
    source: Annotated[Path, typer.Argument(help="Lens file (.toml or .zmx).", metavar="IN")],
    out: Annotated[Path, typer.Argument(help="Lens file to write (.toml or .zmx).", metavar="OUT")],
    efl_mm: Annotated[
        float | None, typer.Option(help="Focal length in mm to scale the lens to.")
    ] = None,
    f_number: Annotated[
        float | None, typer.Option(help="F-number to stop the lens down to, after scaling.")
    ] = None,
    glass: GlassFiles = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write a lens in the other format and report on stderr what is lost (needs torch).

    A finite object distance is scaled with the lens.
    """
    from camkit.cli.design.design_time import refuse_existing, require_torch

    require_torch("camkit lens convert")
    refuse_existing([out], overwrite=overwrite)
    from camkit.models_def.optics.lens_file.lens_file import (
        read_noted_lens,
        ready_for_lens,
        write_lens,
    )
    from camkit.models_def.optics.scaling import scale_to_efl, with_f_number

    ready_for_lens(out)
    lens, notes = read_noted_lens(source, glass or ())
    if efl_mm is not None:
        lens = scale_to_efl(lens, efl_mm)
    if f_number is not None:
        lens = with_f_number(lens, f_number)
        notes = (*notes, *_clipped(lens))
    if out.suffix.lower() == ".zmx" and any(surface.vary for surface in lens.surfaces):
        notes = (*notes, "what `vary` names stays behind: OUT is all fixed")
    write_lens(lens, out)
    for note in notes:
        say(f"{source.name}: {note}", err=True)
    if json_:
        record = {"lens": lens.name, "surfaces": len(lens.surfaces), "out": str(out)}
        say(json.dumps({**record, "notes": list(notes)}))
    else:
        say(f"{out}: {lens.name}, {len(lens.surfaces)} surfaces")


def _clipped(lens: "Lens") -> list[str]:
    """Return whether rims that stayed cut the beam on the axis."""
    import torch

    from camkit.models_def.optics.analysis.sampling import Pupil
    from camkit.models_def.optics.analysis.spots import spot_diagram
    from camkit.models_def.optics.trace import Fate

    waves = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    fate = spot_diagram(lens, torch.zeros(1, dtype=torch.float64), waves, Pupil()).fate
    cut = int((fate == Fate.VIGNETTED).sum())
    if not cut:
        return []
    return [f"rims stay and cut {cut} of {fate.numel()} rays on the axis: open them in the file"]
