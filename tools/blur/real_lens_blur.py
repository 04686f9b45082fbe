"""Photographs of a real lens at f/4, restored by what they show of it, against f/20.

    python -m tools.blur.real_lens_blur --data FOLDER --tone CURVE.toml --work-dir FOLDER -o NAME

FOLDER holds 1500_f4_l.png and so on (LinYark/Sdirt, commit 5fa8ff5, MIT). Judged is the PSNR of
coded values where nothing clips, a gain for each colour and its fall over the field fitted alike.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

import camkit
from camkit.arrays import FloatArray
from camkit.cli.app import run
from camkit.report.bench.machine import describe_machine
from camkit.runtime.raw import read_capture
from camkit.runtime.signal.halves import mean_of_halves
from camkit.runtime.signal.tone_curve import Tone, read_tone
from tools.tables.records import to_compact_json

PITCH_UM: Final = 46.875
SIZE_PX: Final = (768, 512)
DEPTH_M: Final = 1.5
REACHES_PX: Final = (None, 7.0, 9.0, 11.0)
METHODS: Final = ("wiener", "rl")
HALVES: Final = ("_l", "_r")
CLIPPED_PX: Final = 7
BORDER_PX: Final = 16
DIGITS: Final = 4
RECIPE: Final = """name = "photographs"
object_distance_mm = 1500.0

[sensor]
type = "planes"
channels = ["R", "G", "B"]
width_px = 768
height_px = 512
pixel_pitch_um = 46.875
black_level = 0.0
white_level = 65535.0
full_well_e = 200000.0
noise = [{ iso = 100.0, gain_e_per_dn = 3.051804, read_noise_e = 3.0 }]

[wiener]
block_px = 256
overlap_px = 96
prior_scale = 0.0003
prior_exponent = 2.5
clip_iterations = 3

[lens]
psf = "PSF"

[networks.S]
network = "lean_s"
config = { bias = true }
"""


def main(words: Sequence[str] | None = None) -> None:
    """Measure, restore, judge, and write the record."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="the photographs")
    parser.add_argument("--tone", type=Path, required=True, help="the maker's curve")
    parser.add_argument("--work-dir", type=Path, required=True, help="keeps the bundles")
    parser.add_argument("-o", "--output", type=Path, required=True, help="without suffix")
    arguments = parser.parse_args(words)
    arguments.work_dir.mkdir(parents=True, exist_ok=True)
    tone = read_tone(arguments.tone)
    judge = _Judge(arguments.data, tone)
    wide = arguments.data / "1500_f4_l.png"
    record: dict[str, Any] = {
        "machine": describe_machine(),
        "counted": float(judge.counted.mean()),
        "untouched": judge.psnr(judge.wide),
        "rows": [],
    }
    for reach_px in REACHES_PX:
        psf = arguments.work_dir / f"lens-{reach_px or 0:g}.safetensors"
        result = camkit.calibrate.blur(
            [wide],
            psf,
            tone=arguments.tone,
            halves=HALVES,
            pixel_pitch_um=PITCH_UM,
            reach_px=reach_px,
            depth_m=DEPTH_M,
            overwrite=True,
        )
        bundle = _bundle(psf)
        for method in METHODS:
            pipeline = camkit.load(
                bundle,
                method=method,
                tone=arguments.tone,
                halves=HALVES,
                undistort=False,
                vignetting=False,
            )
            restored = np.asarray(pipeline.process(wide).image)
            row = {
                "reach_px": result.reach_px,
                "is_chosen": reach_px is None,
                "edges": result.edges,
                "sharp": result.sharp,
                "held_out": result.held_out.to_json(),
                "method": method,
                "psnr": judge.psnr(restored),
            }
            record["rows"].append(row)
            print(row, flush=True)
    text = to_compact_json(record, DIGITS)
    arguments.output.with_suffix(".json").write_text(text + "\n", encoding="utf-8")


class _Judge:
    """The picture at f/20, and where it counts."""

    def __init__(self, data: Path, tone: Tone) -> None:
        self._tone = np.array(tone.light)
        self.wide, wide_clipped = _mean(data, "1500_f4", tone)
        self._sharp, clipped = _mean(data, "1500_f20", tone)
        self.counted = ~ndimage.binary_dilation(wide_clipped | clipped, iterations=CLIPPED_PX)
        self.counted[:BORDER_PX] = self.counted[-BORDER_PX:] = False
        self.counted[:, :BORDER_PX] = self.counted[:, -BORDER_PX:] = False
        width, height = SIZE_PX
        y, x = np.mgrid[:height, :width]
        self._square = (y - (height - 1) / 2) ** 2 + (x - (width - 1) / 2) ** 2

    def psnr(self, picture: FloatArray) -> float:
        """Return the PSNR of coded values in dB."""
        errors = []
        for mine, sharp in zip(picture, self._sharp, strict=True):
            light, truth = mine[self.counted], sharp[self.counted]
            table = np.stack([light, light * self._square[self.counted] / 1e5], axis=1)
            gains = np.linalg.lstsq(table, truth, rcond=None)[0]
            errors.append(np.square(self._codes(table @ gains) - self._codes(truth)).mean())
        return float(-10 * np.log10(np.mean(errors)))

    def _codes(self, light: FloatArray) -> FloatArray:
        return np.asarray(np.interp(light, self._tone, np.linspace(0, 1, self._tone.size)))


def _mean(data: Path, name: str, tone: Tone) -> tuple[FloatArray, NDArray[np.bool_]]:
    files = [data / f"{name}{half}.png" for half in HALVES]
    left, right = (read_capture(file, tone=tone) for file in files)
    capture = mean_of_halves(left, right, (files[0].name, files[1].name))
    clipped = capture.saturated_rows(0, capture.height).max(axis=0)
    return capture.linear_rows(0, capture.height), clipped


def _bundle(psf: Path) -> Path:
    recipe, bundle = psf.with_suffix(".toml"), psf.with_suffix(".camkit")
    recipe.write_text(RECIPE.replace("PSF", psf.name), encoding="utf-8")
    bundle.unlink(missing_ok=True)
    run(["export", str(recipe), "--no-network", "-o", str(bundle)])
    return bundle


if __name__ == "__main__":
    main()
