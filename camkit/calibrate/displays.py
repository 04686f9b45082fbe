"""A camera before a display: targets, the display's tone curve, pairs for training."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from camkit.calibrate.result_files import check_result, check_results, paths_of, write_results
from camkit.calibrate.result_folder import Folder
from camkit.calibration.display.camera_file import Illumination, Lens, Tone
from camkit.calibration.display.pairs import Pairs, References, draw_pairs, find_pairs
from camkit.calibration.display.screen import Screen
from camkit.calibration.display.targets import (
    LIST,
    Targets,
    draw_targets,
    levels_of_steps,
    plan_targets,
)
from camkit.calibration.geometry.board import Board
from camkit.calibration.record import to_toml
from camkit.calibration.tone import ToneFacts, levels_of, measure_tone
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.report.pages.calibration.pairs_page import pairs_html
from camkit.report.pages.calibration.targets_page import shrunk, targets_html
from camkit.report.pages.calibration.tone_page import tone_html
from camkit.runtime.batch.sources import expand
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files.in_memory import FilePath, optional_path
from camkit.runtime.output.pixels import png_bytes, tiff_bytes

LEVELS: Final = (0, 16, 32, 48, 64, 96, 128, 160, 192, 224, 255)
SETTINGS: Final = "pairs.toml"
REGISTRATION: Final = "registration.toml"


@checked
def targets(
    screen: str | tuple[int, int],
    out: FilePath,
    pictures: FilePath | Sequence[FilePath] = (),
    *,
    board: str | tuple[int, int] = (9, 6),
    levels: str | Sequence[int] = LEVELS,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> Targets:
    """Write pictures for a display: checkerboard, grey steps, colours, pictures with marks.

    Args:
        screen: (width, height) of the display in px, or "1920x1080".
        out: Folder for the PNG files and their list.
        pictures: Sharp pictures to show, sRGB or Adobe RGB.
        board: (columns, rows) of inner corners of the checkerboard, or "9x6".
        levels: Of the grey steps, 0 to 255.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or the folder holds something else.
        DecodeError: If a picture cannot be read.
    """
    page_file = check_result(page, ".html", overwrite=overwrite)
    paths = paths_of(pictures)
    layout = Screen.read(screen), Board.read(board), levels_of_steps(levels)
    folder = Folder.checked(Path(out), (LIST,), (".",), overwrite=overwrite)
    plan = plan_targets(paths, *layout)
    names = [*(target.file for target in plan.targets), LIST]
    pages = [] if page_file is None else [str(page_file.absolute())]
    with folder.writing([*pages, *names]) as parts:
        small = []
        for part, codes in zip(parts[len(pages) :], draw_targets(plan, paths), strict=False):
            part.write_bytes(png_bytes(codes))
            if pages:
                small.append(shrunk(codes))
        parts[-1].write_text(to_toml(plan.to_record()), encoding="utf-8")
        if pages:
            parts[0].write_text(targets_html(plan, small), encoding="utf-8")
    return plan


@checked
def tone(
    files: FilePath | Sequence[FilePath],
    levels: str | Sequence[float],
    out: FilePath | None = None,
    *,
    mosaic: MosaicOptions | None = None,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> ToneFacts:
    """Measure the luminance of a display at each of its levels.

    Args:
        files: Linear pictures, each of one grey that fills the display.
        levels: Sent to the display, one for each file.
        out: Result to write (.toml); None writes none.
        mosaic: How to read headerless mosaics, or levels in place of a file's.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If a picture cannot be read or used.
    """
    outputs = check_results(out, ".toml", page, overwrite=overwrite)
    paths = paths_of(files)
    facts = measure_tone(paths, levels_of(levels, len(paths)), mosaic)
    write_results(outputs, lambda: to_toml(facts.to_record()).encode(), lambda: tone_html(facts))
    return facts


@checked
def pairs(
    captures: FilePath | Sequence[FilePath],
    geometry: FilePath,
    out: FilePath,
    *,
    targets: FilePath | None = None,
    tone: FilePath | None = None,
    flat: FilePath | None = None,
    most_residual_px: float = 0.5,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> Pairs:
    """Align displayed pictures with their captures, as pairs for `camkit.train(pairs=...)`.

    Args:
        captures: Linear captures of the screen, or folders; the folder of targets may come last.
        geometry: Geometry of the camera (.toml of `geometry`).
        out: Folder to write.
        targets: Folder of `targets`; None for the last of the captures.
        tone: Tone curve of the display (.toml of `tone`); None for sRGB.
        flat: Vignetting (.toml of `flat`); None for none.
        most_residual_px: Largest RMS misalignment of picture and capture.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or the folder holds something else.
        DecodeError: If a file cannot be read, or a capture shows no target.
    """
    page_file = check_result(page, ".html", overwrite=overwrite)
    folders = (".", "capture", "reference")
    folder = Folder.checked(Path(out), (SETTINGS,), folders, overwrite=overwrite)
    shots, target_folder = _split(paths_of(captures), optional_path(targets))
    lens = Lens.read(Path(geometry))
    settings = References(
        folder=target_folder,
        targets=Targets.read(target_folder),
        lens=lens,
        tone=Tone.read(optional_path(tone)),
        flat=Illumination.read(optional_path(flat), lens.size),
        most_residual_px=most_residual_px,
    )
    aligned = find_pairs(shots, settings)
    files = [
        f"{kind}/{pair.target.name}{suffix}"
        for pair in aligned.pairs
        for kind, suffix in (("capture", ".tiff"), ("reference", ".png"))
    ]
    pages = [] if page_file is None else [str(page_file.absolute())]
    with folder.writing([*files, *pages, REGISTRATION, SETTINGS]) as parts:
        for n, (counts, codes) in enumerate(draw_pairs(aligned, settings)):
            parts[2 * n].write_bytes(tiff_bytes(counts))
            parts[2 * n + 1].write_bytes(png_bytes(codes))
        if pages:
            parts[-3].write_text(pairs_html(aligned), encoding="utf-8")
        parts[-2].write_text(to_toml(aligned.to_record()), encoding="utf-8")
        parts[-1].write_text(to_toml(aligned.settings()), encoding="utf-8")
    return aligned


def _split(paths: list[Path], targets: Path | None) -> tuple[list[Path], Path]:
    """Return the captures, those of folders too, and the folder of the targets.

    Raises:
        ContractError: If no folder of targets is named, or no capture.
    """
    if targets is None:
        *paths, targets = paths
        if not targets.is_dir():
            raise ContractError(f"add {option_text('targets')} DIR, or its folder after the files")
    inside = [expand([path]) if path.is_dir() else [path] for path in paths]
    shots = [path for group in inside for path in group]
    if not shots:
        raise ContractError(f"no capture is named beside {targets}")
    return shots, targets
