"""Lens and sensor measured on photographs: PSF, noise, vignetting, distortion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from camkit.bundle.psf_file import psf_to_bytes, read_psf
from camkit.calibrate.result_files import check_results, paths_of, write_results
from camkit.calibration.darks import Darks
from camkit.calibration.dots import SeenDots, dots_psf
from camkit.calibration.edge_psf import measure_edge
from camkit.calibration.flat.illumination_fit import FlatFacts, measure_flat
from camkit.calibration.geometry.board import Board
from camkit.calibration.geometry.corner_file import is_corner_file, read_corners
from camkit.calibration.geometry.geometry import Geometry, calibrate_corners, calibrate_geometry
from camkit.calibration.measured import MeasuredPsf, PsfOptions
from camkit.calibration.noise.sensor_noise import NoiseFacts, measure_sensor
from camkit.calibration.psf import measure_psf
from camkit.calibration.record import to_toml
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.psf import FrozenPsf
from camkit.report.pages.calibration.flat_page import flat_html
from camkit.report.pages.calibration.geometry_page import geometry_html
from camkit.report.pages.calibration.noise_page import noise_html
from camkit.report.pages.calibration.psf_page import psf_html
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.merging.survey import Survey, survey
from camkit.runtime.merging.times import stated_times

Times = tuple[float, ...] | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PsfFacts:
    """The result of `psf`.

    Attributes:
        psf: One field, one depth; three colours as wavelengths, or that of the plate of dots.
        bracket: The frames.
        measured: The light that was measured.
        dots: The dots of a plate; None for none.
    """

    psf: FrozenPsf
    bracket: Survey
    measured: MeasuredPsf
    dots: SeenDots | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """The notes for people."""
        return (*self.bracket.notes, *self.measured.notes)

    def to_record(self) -> dict[str, Any]:
        """Return plain values; those of dots are in `dots.to_json()`."""
        x, y = self.measured.centre_px
        return {
            "frames": [frame.path.name for frame in self.bracket.frames],
            "times_s": [frame.time_s for frame in self.bracket.frames],
            "centre_px": [round(x, 4), round(y, 4)],
            "side_px": self.measured.side_px,
            "pixel_pitch_um": self.measured.psf.pixel_pitch_um,
            "colours": [colour.to_json() for colour in self.measured.colours],
            "fields": [field.to_json() for field in self.measured.fields],
            "filled_samples": self.measured.filled_samples,
            "notes": list(self.notes),
        }


@checked
def psf(
    files: FilePath | Sequence[FilePath],
    out: FilePath | None = None,
    *,
    times_s: FilePath | Sequence[float] | None = None,
    darks: FilePath | Sequence[FilePath] = (),
    disc_px: float | None = None,
    edge: bool = False,
    side_px: int | None = None,
    pixel_pitch_um: float | None = None,
    depth_m: float = float("inf"),
    dots: FilePath | None = None,
    mosaic: MosaicOptions | None = None,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> PsfFacts:
    """Merge a bracket of a point light, a disc or an edge into a PSF, every colour of sum 1.

    Args:
        files: Linear exposures of the light in the dark.
        out: PSF to write (.safetensors); None writes none.
        times_s: Exposure times of the files, then of the darks, or a list of NAME SECONDS; None
            for those that the files state.
        darks: Dark frames, at least one per exposure time.
        disc_px: Diameter of a disc light, as a perfect lens would image it; None for a point.
        edge: Measure a slanted straight edge; the PSF is taken as rotationally symmetric.
        side_px: Side of the kernels, odd; None for as far as light is seen.
        pixel_pitch_um: None for what the frames state.
        depth_m: Distance of the light.
        dots: PSF (.safetensors) that a plate of dots was designed for, to sum its dots.
        mosaic: How to read headerless mosaics, or levels in place of a file's.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If a frame cannot be read or used.
    """
    outputs = check_results(out, ".safetensors", page, overwrite=overwrite)
    targets = {"disc_px": disc_px is not None, "edge": edge, "dots": dots is not None}
    names = [option_text(name) for name, is_set in targets.items() if is_set]
    if len(names) > 1:
        raise ContractError(f"the light is one thing; use one of {' and '.join(names)}")
    designed = None if dots is None else read_psf(Path(dots))
    options = PsfOptions(
        side_px=side_px, pixel_pitch_um=pixel_pitch_um, depth_m=depth_m, disc_px=disc_px
    )
    frames, dark_frames = paths_of(files), paths_of(darks)
    frame_times, dark_times = _times(times_s, frames, dark_frames)
    bracket = survey(frames, frame_times, mosaic=mosaic, alike=edge)
    dark = Darks.read(dark_frames, dark_times, bracket, mosaic) if dark_frames else None
    measured = (measure_edge if edge else measure_psf)(bracket, options, dark)
    kernels, seen_dots = (measured.psf, None) if designed is None else dots_psf(measured, designed)
    write_results(outputs, lambda: psf_to_bytes(kernels), lambda: psf_html(measured))
    return PsfFacts(psf=kernels, bracket=bracket, measured=measured, dots=seen_dots)


@checked
def noise(
    darks: Sequence[FilePath],
    flats: Sequence[FilePath],
    out: FilePath | None = None,
    *,
    iso: float | None = None,
    mosaic: MosaicOptions | None = None,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> NoiseFacts:
    """Measure gain, read noise and fixed patterns of a sensor from pairs of RAW frames.

    Args:
        darks: Dark frames, two per ISO.
        flats: Evenly lit frames, two per level, two levels or more per ISO.
        out: Result to write (.toml); None writes none.
        iso: ISO speed of files that state none.
        mosaic: How to read headerless mosaics, or levels in place of a file's.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If a frame cannot be read or used.
    """
    outputs = check_results(out, ".toml", page, overwrite=overwrite)
    if iso is not None and not 0 < iso < float("inf"):
        raise ContractError(f"{option_text('iso')} must be > 0; got {iso:g}")
    facts = measure_sensor(paths_of(darks), paths_of(flats), mosaic, iso)
    write_results(outputs, lambda: to_toml(facts.to_record()).encode(), lambda: noise_html(facts))
    return facts


@checked
def flat(
    files: FilePath | Sequence[FilePath],
    out: FilePath | None = None,
    *,
    shift_px: Sequence[str | tuple[float, float]] | None = None,
    turn_deg: Sequence[float] | None = None,
    pixel_pitch_um: float | None = None,
    mosaic: MosaicOptions | None = None,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> FlatFacts:
    """Measure the vignetting of a lens, separated from an uneven display by several poses.

    Args:
        files: Linear pictures of one display or wall, with the camera moved in between.
        out: Result to write (.toml); None writes none.
        shift_px: (x, y) of the display for each picture, right and down; None for no shifts.
        turn_deg: Clockwise turn of the display for each picture; None for what the files state.
        pixel_pitch_um: None for what the pictures state.
        mosaic: How to read headerless mosaics, or levels in place of a file's.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If a picture cannot be read or used.
    """
    outputs = check_results(out, ".toml", page, overwrite=overwrite)
    facts = measure_flat(
        paths_of(files), shift_px, turn_deg, pixel_pitch_um=pixel_pitch_um, mosaic=mosaic
    )
    write_results(outputs, lambda: to_toml(facts.to_record()).encode(), lambda: flat_html(facts))
    return facts


@checked
def geometry(
    pictures: FilePath | Sequence[FilePath],
    out: FilePath | None = None,
    *,
    board: str | tuple[int, int] | None = None,
    square_mm: float | None = None,
    focal_px: float | None = None,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> Geometry:
    """Measure focal length, optical centre and distortion from photographs of a checkerboard.

    Args:
        pictures: Photographs of the board at one lens and focus setting, or corners (.json).
        out: Result to write (.toml); None writes none.
        board: (columns, rows) of inner corners, or "9x6"; None for a corner file's.
        square_mm: Side of a square, to measure the distance of the board.
        focal_px: Nominal focal length, kept if the pictures do not determine it.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If a picture cannot be read, or boards are not found.
    """
    outputs = check_results(out, ".toml", page, overwrite=overwrite)
    paths = paths_of(pictures)
    facts = _geometry(paths, board, square_mm, focal_px)
    write_results(
        outputs, lambda: to_toml(facts.to_record()).encode(), lambda: geometry_html(facts)
    )
    return facts


def _geometry(
    pictures: list[Path],
    board: str | tuple[int, int] | None,
    square_mm: float | None,
    focal_px: float | None,
) -> Geometry:
    if not is_corner_file(pictures):
        if board is None:
            raise ContractError(
                f"{option_text('board')} is needed: COLUMNSxROWS of its inner corners, like 9x6"
            )
        return calibrate_geometry(pictures, Board.read(board, square_mm), focal_px)
    corners = read_corners(pictures[0])
    expected = Board.read(str(corners.board) if board is None else board, square_mm)
    if str(expected) != str(corners.board):
        raise ContractError(
            f"{pictures[0]} holds corners of a board of {corners.board}, not {expected}"
        )
    if square_mm is not None:
        corners = replace(corners, board=expected)
    return calibrate_corners(corners, focal_px)


def _times(
    times_s: FilePath | Sequence[float] | None, files: list[Path], darks: list[Path]
) -> tuple[Times, Times]:
    """Return the times of frames and dark frames; a list may omit those that files state."""
    if times_s is None:
        return None, None
    try:
        every = stated_times(times_s, files, darks)
    except ContractError as error:
        try:
            return stated_times(times_s, files), None
        except ContractError:
            raise error from None
    return every[: len(files)], every[len(files) :]
