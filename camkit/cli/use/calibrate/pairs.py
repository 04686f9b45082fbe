"""`camkit calibrate pairs`: captures of shown pictures to pairs for training."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.cli.use.calibrate.folder import Folder
from camkit.cli.use.calibrate.outputs import Page, check_page, file_names
from camkit.errors import ContractError

if TYPE_CHECKING:
    from camkit.calibration.display.pairs import Pairs

SETTINGS = "pairs.toml"
REGISTRATION = "registration.toml"


def pairs(
    captures: Annotated[
        list[Path],
        typer.Argument(
            help="Linear captures of the screen, or folders; the --targets folder may come last.",
        ),
    ],
    geometry: Annotated[
        Path, typer.Option(help="Geometry of the camera (.toml of `camkit calibrate geometry`).")
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder to write, for `camkit train --pairs`.")
    ],
    targets: Annotated[
        Path | None,
        typer.Option(help="Folder of `camkit calibrate targets`; default: the last argument."),
    ] = None,
    tone: Annotated[
        Path | None,
        typer.Option(
            help="Tone curve of the display (.toml of `camkit calibrate tone`); default: sRGB."
        ),
    ] = None,
    flat: Annotated[
        Path | None,
        typer.Option(help="Vignetting (.toml of `camkit calibrate flat`); default: none."),
    ] = None,
    most_residual_px: Annotated[
        float, typer.Option(help="Largest RMS misalignment of picture and capture in px.")
    ] = 0.5,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Align displayed pictures with their captures, as pairs for `camkit train --pairs`."""
    check_page(page, overwrite=overwrite)
    owned_parts = (".", "capture", "reference")
    folder = Folder.checked(out, (SETTINGS,), owned_parts, overwrite=overwrite)
    shots, shown_in = _split(captures, targets)
    from camkit.calibration.display.camera_file import Illumination, Lens, Tone
    from camkit.calibration.display.pairs import References, draw_pairs, find_pairs
    from camkit.calibration.display.targets import Targets
    from camkit.calibration.record import to_toml
    from camkit.runtime.output.pixels import png_bytes, tiff_bytes

    lens = Lens.read(geometry)
    references = References(
        folder=shown_in,
        targets=Targets.read(shown_in),
        lens=lens,
        tone=Tone.read(tone),
        flat=Illumination.read(flat, lens.size),
        most_residual_px=most_residual_px,
    )
    aligned = find_pairs(shots, references)
    names = [pair.target.name for pair in aligned.pairs]
    files = [f"{kind}/{n}{end}" for n in names for kind, end in (("capture", ".tiff"), ("reference", ".png"))]  # noqa: E501 # fmt: skip
    pages = [] if page is None else [str(page.absolute())]
    with folder.writing([*files, *pages, REGISTRATION, SETTINGS]) as parts:
        for n, (counts, codes) in enumerate(draw_pairs(aligned, references)):
            parts[2 * n].write_bytes(tiff_bytes(counts))
            parts[2 * n + 1].write_bytes(png_bytes(codes))
        if pages:
            parts[-3].write_text(_html(aligned), encoding="utf-8")
        parts[-2].write_text(to_toml(aligned.to_record()), encoding="utf-8")
        parts[-1].write_text(to_toml(aligned.settings()), encoding="utf-8")
    _tell(aligned, out, page, as_json=json_)


def _split(files: list[Path], targets: Path | None) -> tuple[list[Path], Path]:
    """Return the captures, those of folders too, and the folder of the targets.

    Raises:
        ContractError: If nothing says what was shown.
    """
    from camkit.runtime.batch.sources import expand

    if targets is None:
        *files, targets = files
        if not targets.is_dir():
            raise ContractError("add --targets DIR, or its folder after the files")
    inside = [expand([path]) if path.is_dir() else [path] for path in files]
    shots = [path for paths in inside for path in paths]
    if not shots:
        raise ContractError(f"no capture is named beside {targets}")
    return shots, targets


def _tell(result: "Pairs", out: Path, page: Path | None, *, as_json: bool) -> None:
    if as_json:
        extra = {} if page is None else {"page": str(page)}
        say(json.dumps({**result.to_record(), "out": str(out), **extra}, allow_nan=False))
        return
    for note in result.notes:
        say(f"note: {note}", err=True)
    say(f"{file_names(out, page)}: {len(result.pairs)} pairs at ISO {result.iso:g}")
    worst = max(result.pairs, key=lambda pair: pair.residual_px)
    say(f"  at worst {worst.residual_px:.3f} px RMS, in {worst.path.name}")
    if result.primaries is not None:
        say(f"  colours of the display to {100 * result.primaries.residual:.2g} % of white")


def _html(result: "Pairs") -> str:
    from camkit.report.calibration.pairs_page import pairs_html

    return pairs_html(result)
