"""`camkit lens tolerance`: what fabrication costs, and what to tighten first."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import working

if TYPE_CHECKING:
    from camkit.models_def.optics.tolerance.errors import Tolerances


def tolerance(
    file: Annotated[
        Path,
        typer.Argument(help="Lens file (.toml, .zmx, .json) or built-in name.", metavar="FILE"),
    ],
    errors: Annotated[
        Path | None,
        typer.Option(
            help="File with a \\[tolerance] table; default: the lens file's, else built-in values."
        ),
    ] = None,
    samples: Annotated[
        int, typer.Option(min=1, help="Number of Monte-Carlo samples of the fabricated lens.")
    ] = 50,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of errors, patches and noise.")] = 1,
    data: Annotated[
        Path | None, typer.Option(help="Folder of sharp pictures; default: procedural scenes.")
    ] = None,
    pitch_um: Annotated[float, typer.Option(min=0.1, help="Pixel pitch in um.")] = 6.0,
    noise: Annotated[
        float, typer.Option(min=0, help="Standard deviation of the noise (1.0 = white level).")
    ] = 0.01,
    rays: Annotated[int, typer.Option(min=2, help="Number of rays through the pupil.")] = 512,
    ranking: Annotated[
        bool,
        typer.Option(
            "--ranking/--no-ranking",
            help="Judge every single error at both limits too, which takes most of the time.",
        ),
    ] = True,
    out_dir: Annotated[
        Path | None,
        typer.Option("-o", "--out-dir", help="Folder for NAME-tolerance.png, .svg and .json."),
    ] = None,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Simulate fabrication errors of a lens: yield after restoration, sensitivities (needs torch).

    Without -o and --json the chart is written to the current folder.
    """
    from camkit.cli.design.design_time import refuse_existing, require_torch
    from camkit.report.judge_need import require_judge

    require_torch("camkit lens tolerance")
    folder = out_dir if out_dir is not None or json_ else Path()
    if folder is not None:
        require_judge()
    import torch

    # the arrays are small: more threads mostly wait for each other
    torch.set_num_threads(1)
    from camkit.models_def.design.tolerance import ToleranceRun, run_tolerance
    from camkit.models_def.optics.lens_file.lens_file import read_noted_lens
    from camkit.report.pages.lens.yield_chart import chart_paths, to_json, to_text, write_tolerance

    if folder is not None:
        refuse_existing(chart_paths(folder, file.stem), overwrite=overwrite)
    lens, notes = read_noted_lens(file, glass or (), catalogue, configuration)
    for note in notes:
        say(f"{file.name}: {note}", err=True)
    run = ToleranceRun(
        copies=samples,
        seed=seed,
        pictures=data,
        pitch_um=pitch_um,
        noise=noise,
        rays=rays,
        ranking=ranking,
    )
    with working(f"judging {lens.name} as designed", unit="samples") as task:

        def watch(done: int, total: int) -> None:
            if done == 0:
                task.tell("judging Monte-Carlo samples")
                task.begin(0)
            task.count(done, total)

        task.least_share = 0.0  # all samples take equally long
        result = run_tolerance(lens, _tolerances(file, errors), run, watch)
    written = () if folder is None else write_tolerance(result, folder, file.stem)
    if json_:
        say(json.dumps(to_json(result), allow_nan=False))
        return
    say(to_text(result))
    for path in written:
        say(str(path))


def _tolerances(file: Path, errors: Path | None) -> "Tolerances":
    from camkit.models_def.optics.tolerance.error_table import read_tolerances
    from camkit.models_def.optics.tolerance.errors import Tolerances

    if errors is not None:
        tolerances = read_tolerances(errors)
        if tolerances is None:
            raise ContractError(f"{errors} has no [tolerance] table; see docs/guides/tolerance.md")
        return tolerances
    of_lens = read_tolerances(file) if file.suffix.lower() == ".toml" else None
    return of_lens or Tolerances()
