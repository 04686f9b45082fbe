"""`camkit analyse field`: light, detection and recovery over the field, of several lenses."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.judge.analyse.outputs import deliver
from camkit.cli.use.calibrate.outputs import Page, check_page
from camkit.errors import ContractError
from camkit.progress import working


def field(
    name: Annotated[
        str,
        typer.Argument(
            help="A bundle, a lens (.toml, .zmx or a name; lens:NAME where a bundle has it too), "
            "frozen optics (PSF.safetensors+HAZE.safetensors) or a pinhole (pinhole-0.8).",
            metavar="NAME",
        ),
    ],
    lens: Annotated[
        str | None, typer.Option(help="More of them, A,B; those without a sensor get NAME's.")
    ] = None,
    iso: Annotated[float, typer.Option(help="Sensitivity.")] = 100.0,
    bars_px: Annotated[int, typer.Option(min=1, help="Width of the bars.")] = 12,
    fields: Annotated[int, typer.Option(min=2, help="Points from the axis to the corner.")] = 9,
    wavelength_um: Annotated[
        float | None,
        typer.Option(help="Of the points; default: the middle colour of each sensor."),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(help="Folder of sharp pictures: photograph and restore whole frames."),
    ] = None,
    pictures: Annotated[
        int | None, typer.Option(min=1, help="How many of them; default: 1.")
    ] = None,
    frame: Annotated[
        str | None, typer.Option(help="Only WIDTHxHEIGHT about the middle of such frames.")
    ] = None,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Say what arrives of a point over the field, and what that lets be told apart and restored.

    Lenses are traced, which needs torch; bundles and frozen optics do not.
    """
    check_page(page, overwrite=overwrite)
    frame_px = None if frame is None else _frame_px(frame)
    if pictures is not None and data is None:
        raise ContractError("pictures are those of a folder: give --data too, or no --pictures")
    from camkit.report.analysis.field import FieldOptions, measure_field, to_json, to_text
    from camkit.report.analysis.subject import find_subject
    from camkit.report.quality import list_set, read_picture

    first = find_subject(name)
    names = [part.strip() for part in (lens or "").split(",") if part.strip()]
    if len({name, *names}) != 1 + len(names):
        raise ContractError(f"each lens is named once; got {', '.join((name, *names))}")
    subjects = [first, *(find_subject(other, first.sensor) for other in names)]
    options = FieldOptions(
        iso=iso,
        bars_px=bars_px,
        fields=fields,
        wavelength_um=wavelength_um,
        pictures=() if data is None else tuple(map(read_picture, list_set(data, pictures or 1))),
        frame_px=frame_px,
    )
    with working("measuring", len(subjects), unit="lenses") as task:
        found = []
        for number, subject in enumerate(subjects):
            task.count(number)
            found.append(measure_field(subject, options, task.tell))

    def html() -> str:
        from camkit.report.analysis.field_page import field_html

        return field_html(found, options)

    deliver(to_json(found, options), page, html, to_text, as_json=json_)


def _frame_px(text: str) -> tuple[int, int]:
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(side.isdigit() for side in sides):
        raise ContractError(f"--frame takes WIDTHxHEIGHT in pixels; got {text!r}")
    # whole cells of a mosaic
    return int(sides[0]) // 2 * 2, int(sides[1]) // 2 * 2
