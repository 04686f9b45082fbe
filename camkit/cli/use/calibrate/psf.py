"""`camkit calibrate psf`: a bracket of a small light, or an edge, to a frozen PSF."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.cli.use.calibrate.outputs import Page, check_page
from camkit.cli.use.merge import Times
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options
from camkit.errors import ContractError

if TYPE_CHECKING:
    from camkit.calibration.dots import SeenDots
    from camkit.calibration.measured import MeasuredPsf
    from camkit.runtime.merging.survey import Survey


def psf(
    files: Annotated[
        list[Path],
        typer.Argument(help="Linear exposures of a point light, a disc or an edge in the dark."),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="PSF to write (.safetensors).")],
    page: Page = None,
    times: Times = None,
    dark: Annotated[
        list[Path] | None,
        typer.Option(help="Dark frame, at least one per exposure time; may be repeated."),
    ] = None,
    disc_px: Annotated[
        float | None,
        typer.Option(
            help="Diameter in px of a disc light, as a perfect lens would image it; default: a "
            "point."
        ),
    ] = None,
    edge: Annotated[
        bool,
        typer.Option(
            "--edge",
            help="Measure a slanted straight edge; the PSF is taken as rotationally symmetric.",
        ),
    ] = False,
    side_px: Annotated[
        int | None,
        typer.Option(help="Side of the kernels in px, odd; default: as far as light is seen."),
    ] = None,
    pixel_pitch_um: Annotated[
        float | None, typer.Option(help="Pixel pitch in um; default: as the frames state.")
    ] = None,
    depth_m: Annotated[
        float, typer.Option(help="Distance of the light in m ('inf' for infinity).")
    ] = float("inf"),
    dots: Annotated[
        Path | None,
        typer.Option(
            help="PSF (.safetensors) that a plate of dots was designed for, to sum its dots."
        ),
    ] = None,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Merge a bracket of a point light, a disc or an edge into a PSF, every colour of sum 1."""
    if out.suffix.lower() != ".safetensors":
        raise ContractError(f"a PSF is safetensors; expected a name in .safetensors, got {out}")
    if out.exists() and not overwrite:
        raise ContractError(f"{out} exists; add --overwrite or choose another name")
    check_page(page, overwrite=overwrite)
    _check_target(disc_px, dots, edge=edge)
    from camkit.bundle.psf_file import psf_to_bytes, read_psf
    from camkit.calibration.darks import Darks
    from camkit.calibration.dots import dots_psf
    from camkit.calibration.edge_psf import measure_edge
    from camkit.calibration.measured import PsfOptions
    from camkit.calibration.psf import measure_psf
    from camkit.runtime.merging.survey import survey
    from camkit.runtime.output.part_file import atomic_outputs

    designed = None if dots is None else read_psf(dots)
    options = PsfOptions(
        side_px=side_px, pixel_pitch_um=pixel_pitch_um, depth_m=depth_m, disc_px=disc_px
    )
    mosaic_facts = mosaic_options(mosaic, black_level, white_level)
    times_s, dark_times_s = _times(times, files, dark or [])
    bracket = survey(files, times_s, mosaic=mosaic_facts, alike=edge)
    darks = Darks.read(dark, dark_times_s, bracket, mosaic_facts) if dark else None
    measured = (measure_edge if edge else measure_psf)(bracket, options, darks)
    frozen, seen_dots = (measured.psf, None) if designed is None else dots_psf(measured, designed)
    contents = {out: psf_to_bytes(frozen)}
    if page is not None:
        from camkit.report.calibration.psf_page import psf_html

        contents[page] = psf_html(measured).encode()
    for path in contents:
        path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_outputs(*contents) as parts:
        for part, content in zip(parts, contents.values(), strict=True):
            part.write_bytes(content)
    _tell(contents, bracket, measured, seen_dots, as_json=json_)


def _check_target(disc_px: float | None, dots: Path | None, *, edge: bool) -> None:
    """Refuse options of two kinds of light at once.

    Raises:
        ContractError: If it is.
    """
    kinds = {"--disc-px": disc_px is not None, "--edge": edge, "--dots": dots is not None}
    used_kinds = [name for name, is_said in kinds.items() if is_said]
    if len(used_kinds) > 1:
        raise ContractError(f"the light is one thing; use one of {' and '.join(used_kinds)}")


def _times(
    text: str | None, files: list[Path], darks: list[Path]
) -> tuple[tuple[float, ...] | None, tuple[float, ...] | None]:
    """Return the times of frames and dark frames; a list may omit those that files state."""
    if text is None:
        return None, None
    from camkit.runtime.merging.times import stated_times

    try:
        every = stated_times(text, files, darks)
    except ContractError as error:
        try:
            return stated_times(text, files), None
        except ContractError:
            raise error from None
    return every[: len(files)], every[len(files) :]


def _tell(
    files: Iterable[Path],
    bracket: "Survey",
    measured: "MeasuredPsf",
    seen_dots: "SeenDots | None",
    *,
    as_json: bool,
) -> None:
    (x, y), (out, *page) = measured.centre_px, files
    if as_json:
        record: dict[str, Any] = {
            "frames": [frame.path.name for frame in bracket.frames],
            "times_s": [frame.time_s for frame in bracket.frames],
            "centre_px": [round(x, 4), round(y, 4)],
            "side_px": measured.side_px,
            "pixel_pitch_um": measured.psf.pixel_pitch_um,
            "colours": [colour.to_json() for colour in measured.colours],
            "fields": [field.to_json() for field in measured.fields],
            "filled_samples": measured.filled_samples,
            "notes": [*bracket.notes, *measured.notes],
            "out": str(out),
        }
        if seen_dots is not None:
            record["dots"] = seen_dots.to_json()
        if page:
            record["page"] = str(page[0])
        say(json.dumps(record))
        return
    for note in (*bracket.notes, *measured.notes):
        say(f"note: {note}", err=True)
    files_text = ", ".join(map(str, (out, *page)))
    say(f"{files_text}: {measured.side_px} px, the light at ({x:.2f}, {y:.2f})")
    if seen_dots is not None:
        say(
            f"  dots: {seen_dots.share:.1%} of the light in active areas, like the design by "
            f"{seen_dots.likeness:.4f}"
        )
        return
    for field in measured.fields:
        say(
            f"  {field.peak_share:.2%} +- {field.peak_share_error:.2%} within 10 px, "
            f"{field.height_mm:.2f} mm from the middle"
        )
    for colour in measured.colours:
        noise = (
            "" if colour.noise_floor is None else f", noise {colour.noise_floor:.1e} of the peak"
        )
        target = colour.reblurred
        rest = "" if target is None else f", blurred anew {target.rest:.2%} off"
        say(f"  {colour.colour:<5}  {colour.core_share:.2%} within 3 px{noise}{rest}")
