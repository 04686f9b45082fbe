"""`camkit lens show`: a lens on one page."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import working

if TYPE_CHECKING:
    from camkit.models_def.optics.prescription import Lens
    from camkit.report.pages.lens.lens_pupil import PupilChoice
    from camkit.report.pages.lens.spot_charts import OtherLens

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
    compare: Annotated[
        Path | None,
        typer.Option(help="Lens whose spots are drawn above those of FILE, to one scale."),
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
    if compare is not None and json_ and out_dir is None:
        raise ContractError("--compare is drawn on the page: add --out-dir, or leave --json out")
    folder, name = _page_place(file, out_dir if out_dir is not None or json_ else Path())
    if folder is not None:
        refuse_existing([page_path(folder, name)], overwrite=overwrite)
    read = partial(read_configured_lens, glass=glass or (), catalogue=catalogue)
    with one_torch_thread():
        with working(f"reading {file.name}"):
            configured, notes = read(file)
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
        other = (
            None
            if compare is None
            else _other_lens(compare, plain_lens(read(compare)[0], configuration), choose)
        )
        with working("drawing the page"):
            written = [] if folder is None else write_lens_page(facts, folder, name, other)
    if json_:
        say(json.dumps(to_json(facts), allow_nan=False))
        return
    for note in facts.notes:
        say(f"{file.name}: {note}", err=True)
    for path in written:
        say(str(path))


def _page_place(file: Path, out_dir: Path | None) -> tuple[Path | None, str]:
    """Return the folder of the page, None for none, and its name."""
    if out_dir is not None and out_dir.suffix.lower() == PAGE and not out_dir.is_dir():
        return out_dir.parent, out_dir.stem
    return out_dir, file.stem


def _other_lens(file: Path, lens: "Lens", choose: "Callable[[Lens], PupilChoice]") -> "OtherLens":
    """Measure a lens whose spots are drawn too."""
    from camkit.report.pages.lens.lens_facts import analyse
    from camkit.report.pages.lens.spot_charts import OtherLens

    with working(f"measuring {lens.name}"):
        return OtherLens(name=file.stem, facts=analyse(lens, choose(lens), image=False))
