"""Captures of duet from pictures: their blur measured, and other captures restored by it.

    python -m tools.blur.duet_blur --photos FOLDER --judged FOLDER --work-dir FOLDER -o NAME

`--photos` are pictures whose captures are measured, each at its own place of the sensor; `--judged`
are others, photographed at three places and restored. Writes NAME.json and prints tables.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.psf_file import read_psf, write_psf
from camkit.bundle.reader import find_bundle, open_bundle
from camkit.calibration.measured import WAVELENGTHS_UM
from camkit.colorimetry import encode_srgb
from camkit.psf import FrozenPsf
from camkit.report.bench.machine import describe_machine
from camkit.runtime.bank.psf import FieldKernels, color_kernels
from camkit.runtime.files.picture import read_scene
from tools.blur.transfer_error import compare_transfers, with_true_places
from tools.tables.records import markdown_table, to_compact_json

CAMERA: Final = "duet"
KINDS: Final = ("city", "objects", "text")
"""Pictures with straight borders, by the beginning of their names."""
COLUMNS: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
ROWS: Final = (0.0, 0.5, 1.0)
EXPOSURE: Final = 0.8
ISO: Final = 100.0
HEIGHTS_MM: Final = (2.0, 5.0, 9.0, 12.5, 16.0, 19.0)
PLACES: Final = (0.0, 0.5, 1.0)
"""Of judged captures, from the middle to the corner."""
BORDER_PX: Final = 48
DIGITS: Final = 4


def main(words: Sequence[str] | None = None) -> None:
    """Measure, compare, restore, and write the record."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--photos", type=Path, help="pictures to measure on")
    parser.add_argument("--judged", type=Path, required=True, help="pictures to restore")
    parser.add_argument("--most", type=int, default=12, help="judged pictures; default: 12")
    parser.add_argument("--psf", type=Path, help="measured before, in place of measuring")
    parser.add_argument("--work-dir", type=Path, required=True, help="keeps captures and bundles")
    parser.add_argument("-o", "--output", type=Path, required=True, help="without suffix")
    arguments = parser.parse_args(words)
    folder = arguments.work_dir
    folder.mkdir(parents=True, exist_ok=True)
    bundle = open_bundle(find_bundle(CAMERA))
    truth = color_kernels(bundle.psf, *bundle.manifest.light_sensor.response_arrays())
    record: dict[str, Any] = {"machine": describe_machine()}
    measured = None if arguments.psf is None else read_psf(arguments.psf)
    if measured is None:
        captures = photograph_all(arguments.photos, folder / "captures")
        result = camkit.calibrate.blur(captures, folder / "measured.safetensors", overwrite=True)
        measured, record["measured"] = result.psf, result.to_record()
    errors = [compare_transfers(measured, truth, height) for height in HEIGHTS_MM]
    record["transfer"] = [
        {
            "height_mm": one.height_mm,
            "moved_px": one.moved_px,
            "errors": one.errors.tolist(),
            "size": one.size.tolist(),
        }
        for one in errors
    ]
    psfs = {
        "developed": _point(bundle.psf),
        "photographs": with_true_places(measured, truth),
        "truth": _as_measured(truth, bundle.psf),
    }
    bundles = {name: _bundle(folder, name, psf) for name, psf in psfs.items()}
    pictures = sorted(arguments.judged.glob("*.jpg"))[: arguments.most]
    record["restored"] = restored(pictures, bundles, folder)
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    text = to_compact_json(record, DIGITS)
    arguments.output.with_suffix(".json").write_text(text + "\n", encoding="utf-8")
    print(tables(record))


def photograph_all(pictures: Path, folder: Path) -> list[Path]:
    """Return captures of pictures, each at its own place; those that are there are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    places = [(x, y) for x in COLUMNS for y in ROWS]
    pictures_of_kinds = sorted(f for kind in KINDS for f in pictures.glob(f"{kind}_*.jpg"))
    captures = []
    for number, picture in enumerate(pictures_of_kinds):
        capture = folder / f"{picture.stem}.dng"
        captures.append(capture)
        if not capture.exists():
            origin = _origin(picture, places[number * 4 % len(places)])
            camkit.simulate(
                picture, CAMERA, capture, iso=ISO, seed=number, origin_px=origin, exposure=EXPOSURE
            )
    return captures


def restored(
    pictures: Sequence[Path], bundles: Mapping[str, Path], folder: Path
) -> list[dict[str, Any]]:
    """Return the PSNR of sRGB values of every capture restored by every bundle."""
    pipelines = {
        name: camkit.load(path, method="wiener", threads=1) for name, path in bundles.items()
    }
    rows = []
    for number, picture in enumerate(pictures):
        place = PLACES[number % len(PLACES)]
        capture = folder / f"judged-{picture.stem}.dng"
        shot = camkit.simulate(
            picture,
            CAMERA,
            capture,
            iso=ISO,
            seed=1000 + number,
            origin_px=_origin(picture, (0.5 + place / 2, 0.5 + place / 2)),
            truth=capture.with_suffix(".exr"),
            overwrite=True,
        )
        assert shot.truth is not None
        scores = {
            name: _psnr(np.asarray(one.process(capture).image), shot.truth)
            for name, one in pipelines.items()
        }
        rows.append({"picture": picture.stem, "place": place, **scores})
        print(rows[-1], flush=True)
    return rows


def tables(record: Mapping[str, Any]) -> str:
    """Return the record as tables in Markdown."""
    transfer = [
        (
            f"{one['height_mm']:g}",
            *(
                f"{error:.3f} of {size:.3f}"
                for error, size in zip(one["errors"], one["size"], strict=True)
            ),
        )
        for one in record["transfer"]
    ]
    names = ("developed", "photographs", "truth")
    rows = [
        (str(place), *(f"{_mean(record['restored'], name, place):.2f}" for name in names))
        for place in PLACES
    ]
    rows.append(("all", *(f"{_mean(record['restored'], name):.2f}" for name in names)))
    return "\n\n".join(
        [
            markdown_table(("height, mm", "red", "green", "blue"), transfer),
            markdown_table(("place", *names), rows),
        ]
    )


def _mean(rows: Sequence[Mapping[str, Any]], name: str, place: float | None = None) -> float:
    values = [row[name] for row in rows if place is None or row["place"] == place]
    return float(np.mean(values)) if values else float("nan")


def _origin(picture: Path, place: tuple[float, float]) -> tuple[int, int]:
    """Return the place of a picture on the sensor, from its one corner to the other."""
    extent = open_bundle(find_bundle(CAMERA)).manifest.sensor.known_extent
    height, width = read_scene(picture).shape[-2:]
    x, y = place
    return (
        int(x * (extent.width_px - width)) // 2 * 2,
        int(y * (extent.height_px - height)) // 2 * 2,
    )


def _as_measured(kernels: FieldKernels, psf: FrozenPsf) -> FrozenPsf:
    """Return the camera's kernels of each colour in the form of a measured PSF."""
    values = kernels.kernels[:, None, ::-1]
    return FrozenPsf(
        kernels=np.ascontiguousarray(values),
        field_heights_mm=kernels.field_heights_mm,
        depths_mm=psf.depths_mm,
        wavelengths_um=np.array(WAVELENGTHS_UM),
        pixel_pitch_um=psf.pixel_pitch_um,
        distortion=psf.distortion,
        relative_illumination=np.ones(kernels.field_heights_mm.size),
    )


def _point(psf: FrozenPsf) -> FrozenPsf:
    """Return kernels that blur nothing."""
    kernels = np.zeros((2, 1, 3, 3, 3), dtype=np.float32)
    kernels[..., 1, 1] = 1
    return FrozenPsf(
        kernels=kernels,
        field_heights_mm=np.array([0.0, psf.field_heights_mm[-1]]),
        depths_mm=psf.depths_mm,
        wavelengths_um=np.array(WAVELENGTHS_UM),
        pixel_pitch_um=psf.pixel_pitch_um,
        distortion=psf.distortion,
        relative_illumination=np.ones(2),
    )


def _bundle(folder: Path, name: str, psf: FrozenPsf) -> Path:
    file, path = folder / f"{name}-placed.safetensors", folder / f"{name}.camkit"
    write_psf(file, psf)
    camkit.calibrate.bundle(CAMERA, path, psf=file, overwrite=True)
    return path


def _psnr(image: FloatArray, truth: FloatArray) -> float:
    inner = (..., slice(BORDER_PX, -BORDER_PX), slice(BORDER_PX, -BORDER_PX))
    coded = [encode_srgb(np.clip(one[inner], 0, 1).astype(np.float32)) for one in (image, truth)]
    return float(-10 * np.log10(np.square(coded[0] - coded[1]).mean()))


if __name__ == "__main__":
    main()
