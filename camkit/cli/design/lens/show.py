"""`camkit lens show`: a lens on one page."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json, Overwrite
from camkit.cli.say import say
from camkit.progress import working

PAGE: Final = ".html"


def show(
    file: Annotated[
        Path,
        typer.Argument(help="Lens file (.toml, .zmx, .json) or built-in name.", metavar="FILE"),
    ],
    pupil: Annotated[
        str | None,
        typer.Option(
            help="Definition of the pupil: paraxial, chief or stop.",
            show_default="paraxial; stop where that is wrong",
        ),
    ] = None,
    sampling: Annotated[
        str | None,
        typer.Option(
            help="Pupil sampling: hexapolar:RINGS, gauss:RxA, radau:RxA, grid:SIDE or "
            "fibonacci:RAYS.",
            show_default="the first that has converged",
        ),
    ] = None,
    out_dir: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out-dir", help="Folder for NAME.html and its pictures, or the page (.html)."
        ),
    ] = None,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Draw and measure a lens: layout, spots, fans, PSFs, MTF, curves, sums (needs torch).

    Of a lens with configurations one is shown, beside a table of all.
    Without -o and --json NAME.html and its pictures are written to the current folder.
    """
    from camkit.cli.design.design_time import refuse_existing, require_torch
    from camkit.report.judge_need import require_judge

    require_torch("camkit lens show")
    if out_dir is not None or not json_:
        require_judge()
    from camkit.models_def.optics.analysis.sampling import DEFAULT_SAMPLING, Pupil
    from camkit.models_def.optics.analysis.state_facts import state_facts
    from camkit.models_def.optics.lens_file.lens_file import read_configured_lens
    from camkit.models_def.optics.lens_file.states import plain_lens
    from camkit.models_def.torch_threads import one_torch_thread
    from camkit.report.pages.lens.lens_facts import analyse
    from camkit.report.pages.lens.lens_json import to_json
    from camkit.report.pages.lens.lens_page import write_lens_page
    from camkit.report.pages.lens.lens_pupil import choose_pupil
    from camkit.report.pages.page import page_path

    asked_pupil = Pupil(definition=pupil or "stop", sampling=sampling or DEFAULT_SAMPLING)  # type: ignore[arg-type]
    folder, name = out_dir if out_dir is not None or json_ else Path(), file.stem
    if folder is not None and folder.suffix.lower() == PAGE and not folder.is_dir():
        folder, name = folder.parent, folder.stem
    if folder is not None:
        refuse_existing([page_path(folder, name)], overwrite=overwrite)
    with one_torch_thread():
        with working(f"reading {file.name}"):
            configured, notes = read_configured_lens(file, glass or (), catalogue)
            lens = plain_lens(configured, configuration)
        with working(f"measuring {lens.name}"):
            choose = partial(
                choose_pupil,
                definition=asked_pupil.definition if pupil else None,
                sampling=sampling,
            )
            choice = choose(lens)
            facts = analyse(lens, choice, notes)
            states = state_facts(
                configured, lambda one: (choice if one == lens else choose(one)).pupil
            )
            facts = replace(facts, states=states)
        with working("drawing the page"):
            written = [] if folder is None else write_lens_page(facts, folder, name)
    if json_:
        say(json.dumps(to_json(facts), allow_nan=False))
        return
    for note in facts.notes:
        say(f"{file.name}: {note}", err=True)
    for path in written:
        say(str(path))
