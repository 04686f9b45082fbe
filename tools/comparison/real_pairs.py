"""Cameras judged on real pairs: developed alone, behind the filter, behind networks.

    python -m tools.comparison.real_pairs PAIRS --recipe RECIPE --bundle NAME=FILE ... -o OUT.json
        [--parts 432,0,768,512] [--crops FOLDER --crop 500,300,160,120] [--methods rl]

PAIRS is a folder as `camkit train --pairs` reads it, whose references are photographs from the same
place; the parts of its settings are those that were trained on, so what is judged is `--parts`.
Every candidate is compared with the reference as the pair's alignment lays it: one homography, one
gain of each colour and its fall towards the corners, the same for all. Values are codes by the tone
curve of the pairs. Pixels within 8 px of light that clipped, in one of the two, are left out, and
16 px at the border. Errors of gains are those of a jackknife over tiles of 64 px.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from camkit.arrays import FloatArray
from camkit.bundle.reader import open_bundle
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning.aligned_pairs import NamedPair, align_pairs
from camkit.models_def.kinds.bayer.fine_tuning.photographed import widened
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.training.kind import read_recipe
from camkit.report.bench.machine import describe_machine
from camkit.runtime.job.choices import known_options
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.signal.tone_curve import CURVES, Tone, read_tone
from tools.tables.records import to_compact_json

FILTER: Final = "wiener"
BORDER_PX: Final = 16
TILE_PX: Final = 64
LEAST_TILE_PX: Final = 64
"""Pixels that a tile must hold to count in a jackknife."""
TOP_CODE: Final = 255
DIGITS: Final = 5
IN_PLACE: Final = ("vignetting", "undistort")
"""Options without which a picture lies and shines as its capture does."""
Rectangle = tuple[int, int, int, int]
FloatGrid = NDArray[np.float64]


def main(words: Sequence[str] | None = None) -> None:
    """Judge, print a table and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pairs", type=Path)
    parser.add_argument("--recipe", type=Path, required=True)
    parser.add_argument("--bundle", action="append", required=True, help="NAME=FILE; repeatable")
    parser.add_argument("--methods", nargs="*", default=(), help="further classical ones, as rl")
    parser.add_argument("--parts", nargs="*", type=rectangle, default=(), help="x0,y0,x1,y1")
    parser.add_argument("--crops", type=Path, help="folder for crops at 100 %%")
    parser.add_argument("--crop", nargs="*", type=rectangle, default=(), help="x,y,width,height")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    bundles = dict(named_file(text) for text in arguments.bundle)
    results = []
    for one in judged_pairs(arguments.pairs, arguments.recipe, arguments.parts):
        candidates = restored(one, bundles, arguments.methods)
        rows = table_of(one, candidates)
        print_rows(one.pair.name, rows)
        results.append({"pair": one.pair.name, "parts": one.parts, "rows": rows})
        if arguments.crops is not None:
            write_crops(one, candidates, arguments.crops, arguments.crop)
    record = {"machine": describe_machine(), "results": results}
    arguments.output.write_text(to_compact_json(record, DIGITS), encoding="utf-8")


def rectangle(text: str) -> Rectangle:
    """Read four numbers separated by commas."""
    a, b, c, d = (int(word) for word in text.split(","))
    return a, b, c, d


def named_file(text: str) -> tuple[str, Path]:
    """Read NAME=FILE."""
    name, _, path = text.partition("=")
    return name, Path(path)


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedPair:
    """A pair with what is judged of it.

    Attributes:
        pair: Capture and reference, aligned.
        tone: Curve by which values are compared.
        codes: (3, h, w) codes of the reference as it lies on the capture, 0..1.
        counts: (h, w) what is judged.
        parts: Rectangles that it lies in.
    """

    pair: NamedPair
    tone: Tone
    codes: FloatGrid
    counts: NDArray[np.bool_]
    parts: tuple[Rectangle, ...]


def judged_pairs(
    folder: Path, recipe_path: Path, parts: Sequence[Rectangle]
) -> Iterator[JudgedPair]:
    """Yield the aligned pairs of a folder.

    Args:
        folder: Of pairs whose references are photographs.
        recipe_path: Of their camera.
        parts: What is judged; empty for all.

    Raises:
        ContractError: If the recipe is of another kind, or the folder is not as described.
    """
    recipe = read_recipe(recipe_path)
    if not isinstance(recipe, BayerRecipe):
        raise ContractError(f"{recipe_path} is no recipe of a camera for photographs")
    for one in align_pairs(folder, recipe, None):
        settings, pair = one.settings, one.pair
        height, width = pair.clipped.shape
        tone = settings.tone or CURVES[0]
        curve = read_tone(tone if tone in CURVES else one.file.parents[1] / tone)
        light, counts = pair.warped((0, 0), (width, height))
        counts &= ~widened(pair.clipped | ~counts)
        inner = np.zeros_like(counts)
        inner[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX] = True
        allowed = inner if not parts else np.zeros_like(counts)
        for x0, y0, x1, y1 in parts:
            allowed[y0:y1, x0:x1] = inner[y0:y1, x0:x1]
        yield JudgedPair(
            pair=one,
            tone=curve,
            codes=coded(light, curve),
            counts=counts & allowed,
            parts=tuple(parts),
        )


def coded(light: FloatArray, tone: Tone) -> FloatGrid:
    """Return the codes 0..1 of light by a curve; what is brighter than white is white."""
    codes = np.arange(TOP_CODE + 1) / TOP_CODE
    return np.interp(np.clip(light, 0, 1), tone.light_at(codes), codes)


def restored(
    one: JudgedPair, bundles: Mapping[str, Path], methods: Sequence[str]
) -> dict[str, FloatGrid]:
    """Return (3, h, w) codes of every candidate: without network from the first bundle.

    Args:
        one: The pair.
        bundles: Name -> bundle of the same camera and filter; its network is the candidate.
        methods: Classical methods beside the filter.
    """
    settings = one.pair.settings
    common: dict[str, Any] = {
        "color": "camera",
        "threads": 1,
        "tone": one.tone,
        "halves": settings.pair_of_halves,
        "depth_m": settings.depth_m,
        "iso": settings.iso,
        "noise": settings.noise or None,
    }
    first = next(iter(bundles.values()))
    ways = {name: (first, name) for name in (DEVELOP, FILTER, *methods)}
    ways |= {name: (path, "net") for name, path in bundles.items()}
    candidates = {}
    for name, (path, method) in ways.items():
        bundle = open_bundle(path)
        if method == "net" and not bundle.manifest.sizes:
            continue
        admitted = known_options(bundle.manifest.stages)
        way: dict[str, Any] = {option: False for option in IN_PLACE if option in admitted}
        if method == "net":
            way["size"] = bundle.manifest.sizes[0]
        pipeline = Pipeline(bundle, Options(method=method, **common, **way))
        light = pipeline.start(pipeline.read(one.pair.file)).fill()
        candidates[name] = coded(light, one.tone)
    return candidates


def table_of(one: JudgedPair, candidates: Mapping[str, FloatGrid]) -> list[dict[str, Any]]:
    """Return a row a candidate: dB, SSIM, gains with errors over the filter and the row before."""
    squares = {name: tile_errors(one, codes) for name, codes in candidates.items()}
    rows, last = [], DEVELOP
    for name, codes in candidates.items():
        gain, error = gain_db(squares[name], squares[FILTER])
        step, step_error = gain_db(squares[name], squares[last])
        last = name
        row = {
            "name": name,
            "psnr_db": round(psnr_db(squares[name]), DIGITS - 1),
            "by_colour_db": [
                round(float(-10 * np.log10(mean_square(one, codes, colour))), DIGITS - 1)
                for colour in range(3)
            ],
            "ssim": round(similarity(one, codes), DIGITS),
            "gain_db": round(gain, DIGITS - 1),
            "gain_error_db": round(error, DIGITS - 1),
            "step_db": round(step, DIGITS - 1),
            "step_error_db": round(step_error, DIGITS - 1),
            "tiles": int((squares[name][:, 1] >= LEAST_TILE_PX).sum()),
            "pixels": int(one.counts.sum()),
        }
        rows.append(row)
    return rows


def mean_square(one: JudgedPair, codes: FloatGrid, colour: int) -> float:
    """Return the mean square error of one colour where the pair is judged."""
    gap = (codes - one.codes)[colour][one.counts]
    return float(np.mean(gap**2))


def tile_errors(one: JudgedPair, codes: FloatGrid) -> FloatGrid:
    """Return (tile, 2): sums of squared errors over colours, and how many pixels are judged."""
    square = np.where(one.counts, ((codes - one.codes) ** 2).mean(0), 0.0)
    rows = []
    for y in range(0, square.shape[0], TILE_PX):
        for x in range(0, square.shape[1], TILE_PX):
            here = np.s_[y : y + TILE_PX, x : x + TILE_PX]
            rows.append((square[here].sum(), one.counts[here].sum()))
    return np.array(rows, dtype=np.float64)


def psnr_db(tiles: FloatGrid) -> float:
    """Return the PSNR over all tiles."""
    total, count = tiles.sum(0)
    return float(-10 * np.log10(total / count))


def gain_db(tiles: FloatGrid, others: FloatGrid) -> tuple[float, float]:
    """Return the gain in PSNR over another candidate, and its error by a jackknife over tiles."""
    is_large = tiles[:, 1] >= LEAST_TILE_PX
    tiles, others = tiles[is_large], others[is_large]
    gain = psnr_db(tiles) - psnr_db(others)
    count = len(tiles)
    if count < 2:
        return gain, float("nan")
    keep = ~np.eye(count, dtype=bool)
    left_out = np.array([psnr_db(tiles[k]) - psnr_db(others[k]) for k in keep])
    error = np.sqrt((count - 1) / count * ((left_out - left_out.mean()) ** 2).sum())
    return gain, float(error)


def similarity(one: JudgedPair, codes: FloatGrid) -> float:
    """Return the mean SSIM where the pair is judged (Wang et al. 2004, Gaussian of 1.5 px)."""
    _, full = structural_similarity(
        one.codes,
        codes,
        data_range=1.0,
        channel_axis=0,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )
    return float(full.mean(0)[one.counts].mean())


def print_rows(name: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Print a table."""
    print(f"{name}: {rows[0]['pixels']} pixels in {rows[0]['tiles']} tiles")
    for row in rows:
        gain = f"{row['gain_db']:+6.2f} +- {row['gain_error_db']:.2f}"
        step = f"{row['step_db']:+6.2f} +- {row['step_error_db']:.2f}"
        print(f"  {row['name']:<16}{row['psnr_db']:7.2f} dB {gain} {step}  SSIM {row['ssim']:.4f}")


def write_crops(
    one: JudgedPair,
    candidates: Mapping[str, FloatGrid],
    folder: Path,
    crops: Sequence[Rectangle],
) -> None:
    """Write every crop of all candidates, the reference last, side by side at 100 %."""
    folder.mkdir(parents=True, exist_ok=True)
    for x, y, width, height in crops:
        here = np.s_[:, y : y + height, x : x + width]
        strip = [codes[here] for codes in (*candidates.values(), one.codes)]
        gap = np.ones((3, height, 4))
        joined = np.concatenate([part for one in strip for part in (one, gap)][:-1], axis=2)
        name = f"{one.pair.name.replace('/', '_')}-{x}-{y}.png"
        pixels = np.rint(TOP_CODE * joined).astype(np.uint8)[::-1].transpose(1, 2, 0)
        cv2.imwrite(str(folder / name), np.ascontiguousarray(pixels))
        (folder / f"{name}.json").write_text(json.dumps([*candidates, "reference"]))


if __name__ == "__main__":
    main()
