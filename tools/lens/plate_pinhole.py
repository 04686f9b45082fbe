"""The open plate, recovered, beside a pinhole that is exposed as long (figure 3.12, below).

    python -m tools.lens.plate_pinhole --bundle open.camkit --data PICTURE --tune PICTURE -o DIR

A pinhole of 0.8 mm has no haze and a small share of the light, for the same time. It is shown as
developed, behind two well-known denoisers, and by the filter that knows its blur and its noise.
The denoisers are non-local means (OpenCV) and total variation (Chambolle, scikit-image), on linear
light, of which they keep the mean; the strength of each, in units of the noise that is found, is
that of the largest PSNR on the picture of `--tune`, for every time anew. A camera is whatever
`camkit analyse field` knows by a name.

Writes pinhole.png and pinhole.json into DIR.
"""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import cv2
import numpy as np
import torch
from skimage import restoration

from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.report.analysis.recovery import filled
from camkit.report.analysis.subject import PINHOLE
from camkit.report.figure import to_png
from camkit.report.quality import read_picture
from tools.hdr.record import in_one_line
from tools.lens.cameras import (
    decibels,
    light_through,
    open_camera,
    passed_light,
    restored,
    setting_of,
    square_error,
    truth_of,
    ways_of,
)
from tools.lens.picture_strip import draw_strip

FRAME_PX: Final = (1152, 768)
TUNE_PX: Final = (384, 256)
TIMES: Final = (1.0, 1 / 16)
"""Of the time in which white fills the pixels behind the open plate at ISO 100."""
STRENGTHS: Final = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
SHRINK: Final = 5
"""For the strip."""
_REACH: Final = 4.0
_TOP: Final = 65535
_PATCH_PX: Final = 7
_SEARCH_PX: Final = 21
_TV_ROUNDS: Final = 200
_MEDIAN: Final = 0.6745
"""Of the absolute values of a normal distribution, in deviations."""

Denoiser = Callable[[FloatArray, float], FloatArray]


@in_one_line
def main() -> None:
    """Tune, photograph, restore, draw, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", required=True, help="the camera of the open plate")
    parser.add_argument("--lens", type=Path, default=Path("thin-plate"), help="of that plate")
    parser.add_argument("--pinhole", default="pinhole-0.8", help="pinhole-DIAMETER[@DISTANCE]")
    parser.add_argument("--data", type=Path, required=True, help="a picture")
    parser.add_argument("--tune", type=Path, required=True, help="another picture")
    parser.add_argument("--frame", type=int, nargs=2, metavar=("W", "H"), default=FRAME_PX)
    parser.add_argument("--times", type=float, nargs="+", default=TIMES)
    parser.add_argument("-o", "--out-dir", type=Path, required=True)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    hole = PINHOLE.fullmatch(chosen.pinhole)
    if hole is None or not float(hole["diameter"]) > 0:
        raise ContractError(f"a pinhole is pinhole-DIAMETER[@DISTANCE] in mm; got {chosen.pinhole}")
    share = (float(hole["diameter"]) / 2) ** 2 / passed_light(read_lens(chosen.lens))
    scene = filled(read_picture(chosen.data), *chosen.frame)
    other = filled(read_picture(chosen.tune), *np.minimum(TUNE_PX, chosen.frame))
    with TemporaryDirectory() as folder:
        plate = open_camera(chosen.bundle, Path(folder) / "plate")
        pinhole = open_camera(chosen.pinhole, Path(folder) / "pinhole")
        tuned = {time: tune(pinhole, other, time * share) for time in chosen.times}
        rows = {}
        for time in chosen.times:
            shown, truth = pictures(plate, scene, time)
            beside, _ = pictures(pinhole, scene, time * share, tuned[time])
            rows[time] = {f"plate {way}": picture for way, picture in shown.items()} | {
                f"pinhole {way}": picture for way, picture in beside.items()
            }
            for way, picture in rows[time].items():
                print(f"time {time:g}, {way}: {_db(picture, truth):.2f} dB", flush=True)
    told = {
        "frame_px": list(chosen.frame),
        "pinhole": chosen.pinhole,
        "pinhole_light": round(share, 7),
        "rows": [
            {
                "time": time,
                "plate": recorded(time),
                "pinhole": recorded(time * share),
                "strengths": tuned[time],
                "psnr_db": {way: round(_db(p, truth), 3) for way, p in row.items()},
            }
            for time, row in rows.items()
        ],
    }
    chosen.out_dir.mkdir(parents=True, exist_ok=True)
    (chosen.out_dir / "pinhole.json").write_text(json.dumps(told, indent=1) + "\n", "utf-8")
    strip = {
        f"time {entry['time']:g}": chosen_for_strip(rows[entry["time"]], truth, entry)
        for entry in told["rows"]
    }
    (chosen.out_dir / "pinhole.png").write_bytes(to_png(draw_strip(strip, shrink=SHRINK)))


def pictures(
    bundle: Bundle, scene: FloatArray, exposure: float, strengths: dict[str, float] | None = None
) -> tuple[dict[str, FloatArray], FloatArray]:
    """Return what a camera makes of a scene, way by way, and the truth; linear Rec.709.

    Args:
        bundle: The camera.
        scene: (3, h, w) linear Rec.709.
        exposure: See `cameras.setting_of`.
        strengths: Of the denoisers behind the developed picture; None for none.
    """
    light = light_through(bundle, scene)
    found: dict[str, FloatArray] = {"developed": restored(bundle, light, exposure, "develop")}
    found |= {way: restored(bundle, light, exposure, way) for way in ways_of(bundle)}
    for name, strength in (strengths or {}).items():
        found[name] = denoised(found["developed"], name, strength)
    return found, truth_of(bundle, light)


def recorded(exposure: float) -> dict[str, float]:
    """Return ISO and share of the white level of an exposure as plain JSON values."""
    setting = setting_of(exposure)
    return {"iso": round(setting.iso, 1), "white": round(setting.exposure, 5)}


def tune(bundle: Bundle, scene: FloatArray, exposure: float) -> dict[str, float]:
    """Return the strength of every denoiser that has the largest PSNR on a scene."""
    light = light_through(bundle, scene)
    truth, developed = truth_of(bundle, light), restored(bundle, light, exposure, "develop", seed=1)
    found = {}
    for name in DENOISERS:
        by_strength = {s: _db(denoised(developed, name, s), truth) for s in STRENGTHS}
        found[name] = max(by_strength, key=lambda s: by_strength[s])
    return found


def denoised(picture: FloatArray, name: str, strength: float) -> FloatArray:
    """Return a picture (3, h, w), linear, behind a denoiser.

    Args:
        picture: Noise and all; negative values are kept.
        name: One of `DENOISERS`.
        strength: In units of the noise that is found.
    """
    sigma = max(noise_of(picture), 1e-6)
    return DENOISERS[name](picture.astype(np.float32), strength * sigma)


def _non_local_means(picture: FloatArray, sigma: float) -> FloatArray:
    """Return Buades's mean of like patches, by OpenCV on 16 bits."""
    scale = _TOP / (2 * _REACH)
    levels = np.clip((picture + _REACH) * scale, 0, _TOP).astype(np.uint16)
    smooth = cv2.fastNlMeansDenoising(
        np.ascontiguousarray(levels.transpose(1, 2, 0)),
        h=[sigma * scale] * 3,
        templateWindowSize=_PATCH_PX,
        searchWindowSize=_SEARCH_PX,
        normType=cv2.NORM_L1,
    )
    return np.asarray(smooth.transpose(2, 0, 1) / scale - _REACH, np.float32)


def _total_variation(picture: FloatArray, sigma: float) -> FloatArray:
    """Return Chambolle's least total variation, by scikit-image."""
    smooth = restoration.denoise_tv_chambolle(
        picture, weight=sigma, max_num_iter=_TV_ROUNDS, channel_axis=0
    )
    return np.asarray(smooth, np.float32)


DENOISERS: Final[dict[str, Denoiser]] = {
    "non-local means": _non_local_means,
    "total variation": _total_variation,
}


def noise_of(picture: FloatArray) -> float:
    """Return the deviation of the noise of a picture (3, h, w), by its finest differences."""
    rows = picture[:, 1:] - picture[:, :-1]
    both = rows[:, :, 1:] - rows[:, :, :-1]
    return float(np.median(np.abs(both)) / _MEDIAN / 2)


def chosen_for_strip(
    row: dict[str, FloatArray], truth: FloatArray, entry: dict[str, Any]
) -> dict[str, FloatArray]:
    """Return the scene, the plate's capture and recovery, the pinhole's capture, its best two."""
    db: dict[str, float] = entry["psnr_db"]
    best = max((f"pinhole {name}" for name in DENOISERS), key=lambda way: db[way])
    recovered = "plate network" if "plate network" in row else "plate filter"
    ways = ("plate developed", recovered, "pinhole developed", best, "pinhole filter")
    kept = {"scene": truth}
    return kept | {f"{way}\n{db[way]:.1f} dB": row[way] for way in ways}


def _db(picture: FloatArray, truth: FloatArray) -> float:
    return decibels(square_error(picture, truth))


if __name__ == "__main__":
    main()
