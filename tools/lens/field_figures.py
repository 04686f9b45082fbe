"""Cameras over the field, side by side: figures 3.7 and 3.9 re-made.

    python -m tools.lens.field_figures thin-plate=PSF.safetensors+HAZE.safetensors \
        al2550-a=PSF.safetensors+HAZE.safetensors --data PICTURES --out-dir OUT

Each is NAME or NAME=WHAT, WHAT as `camkit analyse field` takes it: a bundle is restored by its
network, frozen optics by the filter alone. Where WHAT says no field angles, the lens of that NAME
does. Whole frames of the first `--pictures` pictures are photographed, restored and compared by
rings of the sensor; PNGs, `field.json` and a table (`field.md`) are written into OUT.

`better` is the better one of capture and result in every ring: filtering without a peak is worse
than nothing. `psf` shows light as pixels have it (square root) and as cells of 16 pixels have it
(three decades); `board` is a chequered board as captured; `crops` are cut from the first picture.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.errors import CamkitError
from camkit.models_def.optics.lens_file.lens_file import built_in_lenses, read_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.report.analysis.field import FieldOptions, LensField, measure_field, to_json
from camkit.report.analysis.frozen_image import sensor_heights_mm
from camkit.report.analysis.point_image import Band, PointImage, band_of
from camkit.report.analysis.recovery import restored, zones_of
from camkit.report.analysis.subject import Subject, find_subject, ideal_angle_rad
from camkit.report.quality import list_set, read_picture
from camkit.report.stress.rig import INPUT, Rig, usual_sizes
from camkit.runtime.bank.haze import hazy_kernels
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from camkit.runtime.twin.truth import light_sensor, picture_scale
from camkit.units import to_degrees
from tools.comparison.compact_json import to_compact_json
from tools.lens import field_drawings

DIGITS: Final = 5
PLACES: Final = (0.0, 0.3, 0.5, 0.7, 0.95)
"""Of the half diagonal, where crops are cut."""

Array = NDArray[np.float64]
Crops = dict[str, list[FloatArray]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What is known of one camera.

    Attributes:
        found: Over the field.
        wide: By field, light in cells about the middle, (n, n); empty for optics without a haze.
        cell_px: Side of these cells.
        crops: `TRUTH` or the name of a method -> crops (3, s, s) of the first picture by place.
        board: Crops of a board as captured, by place.
    """

    found: LensField
    wide: Sequence[Array]
    cell_px: int
    crops: Crops
    board: Sequence[FloatArray]

    @property
    def degrees(self) -> list[float]:
        """Return the field angles."""
        angles = [point.image.field_angle_rad for point in self.found.points]
        return [float("nan") if angle is None else to_degrees(angle) for angle in angles]


def main() -> int:
    """Measure the cameras, draw and write."""
    chosen = parse()
    chosen.out_dir.mkdir(parents=True, exist_ok=True)
    try:
        pictures = tuple(map(read_picture, list_set(chosen.data, chosen.pictures)))
        options = FieldOptions(
            iso=chosen.iso, fields=chosen.fields, pictures=pictures, frame_px=chosen.frame
        )
        shown = [show(word, options, chosen.crop_px, chosen.board_px) for word in chosen.cameras]
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    write(shown, options, chosen.out_dir)
    return 0


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cameras", nargs="+", metavar="NAME[=WHAT]")
    parser.add_argument("--data", type=Path, required=True, help="folder of sharp pictures")
    parser.add_argument("--pictures", type=int, default=1)
    parser.add_argument("--iso", type=float, default=100.0)
    parser.add_argument("--fields", type=int, default=9, help="from the axis to the corner")
    parser.add_argument("--frame", type=int, nargs=2, metavar=("W", "H"), help="the middle only")
    parser.add_argument("--crop-px", type=int, default=160)
    parser.add_argument("--board-px", type=int, default=24, help="side of a square of the board")
    parser.add_argument("--out-dir", type=Path, default=Path("out/field"))
    return parser.parse_args()


def show(word: str, options: FieldOptions, crop_px: int, board_px: int) -> Shown:
    """Measure a camera, and keep what is drawn of it."""
    name, _, what = word.partition("=")
    with TemporaryDirectory() as folder:
        given = find_subject(what or name)
        bundle = given.camera(Path(folder))
        subject = replace(
            given,
            name=name,
            images=lambda band, fields: with_angles(given.images(band, fields), name, bundle),
            camera=lambda _: bundle,
        )
        crops: Crops = {}

        def watch(method: str, frame: FloatArray) -> None:
            if len(crops.get(method, ())) < len(PLACES):  # of the first picture
                crops[method] = cut(frame, crop_px)

        found = measure_field(subject, options, print, watch)
        wide, cell_px = wide_images(bundle, subject, options.fields)
        board = cut(photographed_board(bundle, options, board_px), crop_px)
    return Shown(found=found, wide=wide, cell_px=cell_px, crops=crops, board=board)


def with_angles(images: Sequence[PointImage], name: str, bundle: Bundle) -> list[PointImage]:
    """Return the images with field angles, by the lens of that name where nobody knows them."""
    if name not in built_in_lenses() or any(i.field_angle_rad is not None for i in images):
        return list(images)
    efl_mm = paraxial_data(read_lens(Path(name))).efl_mm
    return [
        replace(
            image, field_angle_rad=ideal_angle_rad(bundle.psf.distortion, image.height_mm, efl_mm)
        )
        for image in images
    ]


def wide_images(bundle: Bundle, subject: Subject, fields: int) -> tuple[list[Array], int]:
    """Return the light of points in cells, core and haze, and the side of a cell in pixels."""
    if not bundle.manifest.has_haze:
        return [], 1
    band: Band = band_of(subject.sensor)
    response = band.wavelengths_um, band.weights[None]
    depth_mm = bundle.reference_depth_mm
    kernels = hazy_kernels(bundle.psf, bundle.haze, *response, depth_mm=depth_mm)
    heights_mm = sensor_heights_mm(subject.sensor, fields)
    made = [np.asarray(kernels.coarse.at(0.0, float(h))[0], np.float64) for h in heights_mm]
    return made, kernels.cell_px


def cut(frame: FloatArray, side_px: int) -> list[FloatArray]:
    """Return copies of crops from the middle of a frame (3, h, w) along its diagonal."""
    _, height, width = frame.shape
    side = min(side_px, height, width)
    found = []
    for place in PLACES:
        top, left = (
            int(np.clip(length / 2 * (1 - place) - side / 2, 0, length - side))
            for length in (height, width)
        )
        found.append(frame[:, top : top + side, left : left + side].copy())
    return found


def photographed_board(bundle: Bundle, options: FieldOptions, side_px: int) -> FloatArray:
    """Return the picture (3, h, w) of a capture of a chequered board that fills the frame, sRGB."""
    sensor, scale = light_sensor(bundle.manifest), picture_scale(bundle.manifest)
    extent = sensor.known_extent
    width, height = options.frame_px or (extent.width_px, extent.height_px)
    y, x = (np.arange(scale * side) // (scale * side_px) for side in (height, width))
    board = (0.8 * ((y[:, None] + x) % 2)).astype(np.float32)
    made = photograph(
        np.broadcast_to(board, (3, *board.shape)).copy(),
        bundle,
        SimulationOptions(
            iso=options.iso, scale=scale, depth_mm=bundle.reference_depth_mm, distort=False
        ),
    )
    method = next(
        method
        for method in Rig(bundle, usual_sizes(bundle.manifest)).methods
        if method.name == INPUT
    )
    return encode_srgb(restored(method.pipeline, made))


def write(shown: Sequence[Shown], options: FieldOptions, folder: Path) -> None:
    """Write figures, numbers and the table."""
    numbers = to_json([one.found for one in shown], options)
    for one in shown:
        numbers["lenses"][one.found.subject.name]["better_db"] = better(one.found, options)
    text = to_compact_json(numbers, DIGITS)
    (folder / "field.json").write_text(text + "\n", encoding="utf-8")
    table = "\n".join(table_of(numbers["lenses"]))
    (folder / "field.md").write_text(table + "\n", encoding="utf-8")
    print(table)
    field_drawings.write_figures(shown, folder)


def better(found: LensField, options: FieldOptions) -> float | None:
    """Return dB over the frame where every ring shows the better one of capture and result."""
    zones = [point.psnr_db for point in found.points]
    if all(zone is None for zone in zones):
        return None
    extent = found.subject.sensor.known_extent
    sensor_px = extent.width_px, extent.height_px
    width, height = options.frame_px or sensor_px
    window = SensorWindow(
        size_px=(width, height),
        origin_px=((sensor_px[0] - width) // 2, (sensor_px[1] - height) // 2),
        sensor_size_px=sensor_px,
        pitch_um=extent.pixel_pitch_um,
    )
    heights_mm = np.maximum.accumulate([point.image.height_mm for point in found.points])
    count = np.bincount(zones_of(window, 1, heights_mm).ravel(), minlength=len(zones))
    square = sum(
        n * 10 ** (-max(zone[0], zone[2]) / 10)
        for n, zone in zip(count, zones, strict=True)
        if zone is not None
    )
    return float(-10 * np.log10(square / count.sum()))


def table_of(lenses: dict[str, Any]) -> list[str]:
    """Return the table: dB by ring, the better one of capture and result last."""
    names = list(lenses)
    lines = [
        "| mm | "
        + " | ".join(f"{name}: degrees, capture, result, better" for name in names)
        + " |",
        "|---" * (1 + len(names)) + "|",
    ]
    for ring in zip(*(lenses[name]["fields"] for name in names), strict=True):
        cells = [_cell(field) for field in ring]
        lines.append(f"| {ring[0]['height_mm']:.1f} | " + " | ".join(cells) + " |")
    whole = []
    for name in names:
        overall, best = lenses[name]["psnr_db"], lenses[name]["better_db"]
        said = "" if overall is None else f"{overall['before']:.1f} {overall['after']:.1f}"
        whole.append(said if best is None else f"{said} **{best:.1f}**")
    return [*lines, "| frame | " + " | ".join(whole) + " |"]


def _cell(field: dict[str, Any]) -> str:
    angle, found = field["field_angle_deg"], field["psnr_db"]
    said = "?" if angle is None else f"{angle:.1f}"
    if found is None:
        return said
    before, after = found["before"], found["after"]
    return f"{said}: {before:.1f} {after:.1f} **{max(before, after):.1f}**"


if __name__ == "__main__":
    raise SystemExit(main())
