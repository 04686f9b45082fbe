"""`camkit lens peak`: how much light lies near the peak of a point, and how far haze reaches."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json
from camkit.cli.say import say
from camkit.progress import working

if TYPE_CHECKING:
    from camkit.models_def.optics.prescription import Lens

PitchUm = Annotated[float, typer.Option(min=0.1, help="Pixel pitch in um.")]
ToolRadiusUm = Annotated[
    float | None,
    typer.Option(
        min=0, help="Nose radius in um of the tool that cuts the grooves; default: the file's."
    ),
]
WithWaves = Annotated[
    bool,
    typer.Option(
        "--waves",
        help="Also compute the peaks of three fields by wave optics, in every colour (minutes).",
    ),
]


def peak(
    file: Annotated[Path, typer.Argument(help="Lens file (.toml, .zmx or .json).", metavar="FILE")],
    pitch_um: PitchUm = 5.96,
    waves: WithWaves = False,
    tool_radius_um: ToolRadiusUm = None,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure the light of a point near its peak and the reach of veiling glare (needs torch).

    The fields are those of the file and the middles between them.
    """
    from camkit.cli.design.design_time import require_torch

    require_torch("camkit lens peak")
    import torch

    torch.set_num_threads(1)
    from camkit.models_def.optics.lens_file.lens_file import read_noted_lens
    from camkit.models_def.optics.thin.report import to_text, with_tool

    lens, notes = read_noted_lens(file, glass or (), catalogue, configuration)
    if tool_radius_um is not None:
        lens = with_tool(lens, tool_radius_um)
    record = measured(lens, lens.field_angles_rad, pitch_um, waves=waves)
    if json_:
        say(json.dumps(record | {"notes": list(notes)}))
        return
    for note in notes:
        say(f"{file.name}: {note}", err=True)
    say(to_text(record))


def measured(
    lens: "Lens", field_angles_rad: Sequence[float], pitch_um: float, *, waves: bool
) -> dict[str, Any]:
    """Return the report on a lens as JSON values; waves at the first, middle and last field."""
    from camkit.models_def.optics.thin.report import report_peaks, to_json, with_midpoints

    fields = with_midpoints(field_angles_rad)
    wave_fields = sorted({0, len(fields) // 2, len(fields) - 1}) if waves else []
    with working("measuring peaks", unit="peaks", is_even=not waves) as task:
        peaks = report_peaks(
            lens,
            fields,
            pitch_um,
            wave_fields_rad=[fields[i] for i in wave_fields],
            progress=task.count,
        )
    return to_json(peaks)
