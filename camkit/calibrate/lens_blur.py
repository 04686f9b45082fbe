"""The blur of a lens from ordinary photographs: `camkit calibrate blur`."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from camkit.bundle.psf_file import psf_to_bytes
from camkit.calibrate.result_files import check_results, paths_of, write_results
from camkit.calibration.blur.blur_facts import PhotoBlur
from camkit.calibration.blur.blur_measurement import BlurOptions, measure_blur
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.report.pages.calibration.blur_page import blur_html
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.raw import read_capture
from camkit.runtime.signal.halves import (
    mean_of_halves,
    read_halves,
    right_half,
    without_right_halves,
)
from camkit.runtime.signal.tone_curve import Tone, read_tone


@checked
def blur(
    files: FilePath | Sequence[FilePath],
    out: FilePath | None = None,
    *,
    tone: FilePath | None = None,
    halves: str | tuple[str, str] | None = None,
    pixel_pitch_um: float | None = None,
    reach_px: float | None = None,
    depth_m: float = float("inf"),
    mosaic: MosaicOptions | None = None,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> PhotoBlur:
    """Measure the PSF of a lens over the field on straight edges in photographs.

    Args:
        files: RAW or developed photographs of one camera and lens at one setting.
        out: PSF to write (.safetensors); None writes none.
        tone: How codes of developed pictures become light: "srgb", "linear", or a file of `tone`.
        halves: What tells the files of both halves of dual pixels apart, such as "_l,_r".
        pixel_pitch_um: None for what the photographs state.
        reach_px: To both sides of an edge, how far nothing else may be; None chooses it by the
            blur of the photographs.
        depth_m: Distance of the scenes.
        mosaic: How to read headerless mosaics, or levels in place of a file's.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If photographs cannot be read, do not belong together, or show too few edges.
    """
    outputs = check_results(out, ".safetensors", page, overwrite=overwrite)
    options = BlurOptions(pixel_pitch_um=pixel_pitch_um, reach_px=reach_px, depth_m=depth_m)
    curve = None if tone is None else read_tone(tone)
    texts = read_halves(halves) if isinstance(halves, str) else halves
    paths = without_right_halves(paths_of(files), texts)
    if not paths:
        raise ContractError("give photographs")
    photos = [(path.name, partial(_read, path, curve, texts, mosaic)) for path in paths]
    result = measure_blur(photos, options)
    write_results(
        outputs, lambda: psf_to_bytes(result.psf, result.uncertainty), lambda: blur_html(result)
    )
    return result


def _read(
    path: Path, tone: Tone | None, halves: tuple[str, str] | None, mosaic: MosaicOptions | None
) -> Capture:
    read = partial(read_capture, mosaic=mosaic, tone=tone)
    if halves is None:
        return read(path)
    other = right_half(path, halves)
    return mean_of_halves(read(path), read(other), (path.name, other.name))
