"""How well whole frames are restored behind a haze: level and detail, middle and rim, by zones.

    python -m tools.lens.whole_frames thin-plate --data PICTURES --out-dir out/frames

Every picture is repeated, every second one mirrored, until it fills the frame, and photographed
through a fabricated copy of the lens that no training saw, haze included. The capture is developed
only (`develop`), freed of its haze (`haze`), restored by the filter alone (`wiener`), and by every
network. More bundles of the same camera, `SEED=FILE`, add their networks: of other seeds, say.

dB are of sRGB, mean over the pictures. `level` is the error of the means of blocks of 64 px and
`detail` all that is left: together they are the whole error. `rim` is what lies within --rim-px of
the border of the frame, one radius of the PSF, where light from outside comes in; `inside` the
rest. Zones are fifths of the half diagonal. `--pedestal-percent P` asks what a lost dark frame
costs: P % of all light of a point in the bundle, laid evenly over the cells of its haze, was black
and falls on no capture. What is finished is in the journal of the folder and not done again.
"""

import argparse
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.sensor import BayerSensor
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.errors import CamkitError, ContractError
from camkit.haze import without_pedestal
from camkit.models_def.training.pictures import list_pictures
from camkit.report.analysis.recovery import filled, restored
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.quality import read_picture
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, simulate
from camkit.runtime.twin.truth import light_sensor, true_picture
from tools.comparison.compact_json import to_compact_json
from tools.lens.cameras import decibels
from tools.lens_table import kept

BLOCK_PX: Final = 64
RIM_PX: Final = 900
ZONES: Final = 5
COPY_SEED: Final = 7007
"""Of the fabrication; recipes have others."""
SIMPLE: Final = ("develop", "haze", "wiener")
MEASURES: Final = ("db", "level", "detail", "inside", "rim")
DIGITS: Final = 5
Entry = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """One way to restore.

    Attributes:
        name: As the table has it.
        bundle: Of the camera.
        options: How.
    """

    name: str
    bundle: Bundle
    options: Options


def main() -> None:
    """Photograph, restore, print."""
    chosen = parse()
    try:
        named = named_bundles(chosen.bundles)
        ways = list(ways_of(named))
        first = next(iter(named.values()))
        pictures = list_pictures(chosen.data)[: chosen.pictures]
        frame = tuple(chosen.frame) if chosen.frame else None
        sources = {"copy": chosen.copy, "frame": frame, "rim": chosen.rim_px}
        if chosen.pedestal_percent:
            sources["pedestal_percent"] = chosen.pedestal_percent
        rows: dict[str, list[Entry]] = {}
        share = chosen.pedestal_percent / 100
        through = cache(
            lambda: without_black(copy_of(first, chosen.copy, chosen.out_dir / "copies"), share)
        )
        for path in pictures:
            for iso in chosen.iso:
                made = cache(lambda p=path, i=iso: shoot(p, first, through(), i, frame))
                for way in ways:
                    key = digest(way, path, iso, sources)
                    entry = kept(chosen.out_dir, key, lambda w=way, m=made: judge(w, m(), chosen))
                    entry |= {"picture": path.stem, "iso": iso}
                    rows.setdefault(way.name, []).append(entry)
                    print(f"{path.stem} ISO {iso:g} {way.name}: {entry['db']:.2f} dB", flush=True)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    report = {"bundle": first.path.name, **sources, "rows": rows}
    written = chosen.out_dir / "whole_frames.json"
    written.write_text(to_compact_json(report, DIGITS) + "\n", encoding="utf-8")
    said = table(rows, chosen.iso)
    written.with_suffix(".md").write_text(said, encoding="utf-8")
    print(said)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bundles", nargs="+", metavar="BUNDLE")
    parser.add_argument("--data", type=Path, required=True, help="folder of pictures")
    parser.add_argument("--pictures", type=int, help="only the first so many")
    parser.add_argument("--iso", type=float, nargs="+", default=(100.0, 1600.0))
    parser.add_argument("--copy", type=int, default=COPY_SEED, help="seed of its errors")
    parser.add_argument("--pedestal-percent", type=percent, default=0.0, help="0 to 100")
    parser.add_argument("--frame", type=int, nargs=2, metavar=("W", "H"), help="about the middle")
    parser.add_argument("--rim-px", type=int, default=RIM_PX)
    parser.add_argument("--out-dir", type=Path, default=Path("out/whole-frames"))
    chosen = parser.parse_args()
    chosen.out_dir.mkdir(parents=True, exist_ok=True)
    return chosen


def named_bundles(words: Sequence[str]) -> dict[str, Bundle]:
    """Open the bundles of the command line: a name or a file, or NAME=FILE.

    Raises:
        ContractError: If two have the same name; one without is named by nothing.
    """
    found: dict[str, Bundle] = {}
    for word in words:
        name, _, file = word.rpartition("=")
        if name in found:
            raise ContractError(f"{word}: give it a name of its own, NAME={file}")
        found[name] = open_bundle(find_bundle(file))
    return found


def ways_of(named: Mapping[str, Bundle]) -> Iterator[Way]:
    """Yield the ways of the first bundle, then the networks of the others."""
    for number, (name, bundle) in enumerate(named.items()):
        for method in SIMPLE if number == 0 else ():
            yield Way(name=method, bundle=bundle, options=options(method=method))
        for size in bundle.manifest.sizes:
            label = f"{size} {name}".strip()
            yield Way(name=label, bundle=bundle, options=options(size=size))


def options(**chosen: str) -> Options:
    """Return options of the geometry of the sensor, on one thread."""
    return Options(**chosen, undistort=False, vignetting=False, threads=1)  # type: ignore[arg-type]


def copy_of(bundle: Bundle, seed: int, folder: Path) -> FrozenOptics:
    """Freeze a fabricated copy of the lens of a bundle, haze included, or find it in a folder.

    Raises:
        ContractError: If the bundle is of another kind, or holds no prescription.
    """
    sensor = light_sensor(bundle.manifest)
    if not bundle.manifest.has_haze or not isinstance(sensor, BayerSensor):
        raise ContractError(f"{bundle.path.name} is no camera with a mosaic and a haze")
    return fabricated_optics(bundle, seed, cache_folder=folder)


def without_black(optics: FrozenOptics, share: float) -> FrozenOptics:
    """Take off the haze of optics what is black of it, a share of all light of a point."""
    haze = optics.haze
    if haze is None or not share:
        return optics
    kernels = without_pedestal(haze.kernels, haze.core_share, share)
    return replace(optics, haze=replace(haze, kernels=kernels))


def percent(word: str) -> float:
    """Read a number of the command line from 0 to 100."""
    value = float(word)
    if not 0 <= value <= 100:
        raise argparse.ArgumentTypeError(f"0 to 100; got {word}")
    return value


def shoot(
    path: Path,
    bundle: Bundle,
    optics: FrozenOptics,
    iso: float,
    frame: tuple[int, ...] | None,
) -> Simulation:
    """Photograph a picture through the optics of a copy, on the sensor of a bundle."""
    extent = light_sensor(bundle.manifest).known_extent
    width, height = frame or (extent.width_px, extent.height_px)
    return simulate(
        filled(read_picture(path), width, height),
        bundle.manifest.sensor,
        optics.psf,
        SimulationOptions(iso=iso, distort=False, vignette=False),
        haze=optics.haze,
    )


def judge(way: Way, made: Simulation, chosen: argparse.Namespace) -> Entry:
    """Restore a capture and compare it with the truth; see the head of this file."""
    pipeline = Pipeline(way.bundle, way.options)
    apart = encode_srgb(restored(pipeline, made))
    apart -= encode_srgb(true_picture(made.clean, light_sensor(way.bundle.manifest)))
    return measures(apart, chosen.rim_px)


def measures(apart: FloatArray, rim_px: int) -> Entry:
    """Return `MEASURES` and the zones of a difference of sRGB values (3, h, w)."""
    square = np.square(apart).mean(axis=0, dtype=np.float32)
    height, width = square.shape
    level = level_square(apart)
    whole = float(square.mean(dtype=np.float64))
    y, x = np.arange(height)[:, None], np.arange(width)[None]
    reach = np.minimum(np.minimum(y, height - 1 - y), np.minimum(x, width - 1 - x))
    radius = 2 * np.hypot(y - (height - 1) / 2, x - (width - 1) / 2) / np.hypot(height, width)
    zone = np.minimum((radius * ZONES).astype(np.intp), ZONES - 1)
    return {
        "db": decibels(np.array(whole)),
        "level": decibels(np.array(level)),
        "detail": decibels(np.array(whole - level)),
        "inside": part(square, reach >= rim_px),
        "rim": part(square, reach < rim_px),
        "zones": [part(square, zone == number) for number in range(ZONES)],
    }


def level_square(apart: FloatArray) -> float:
    """Return the mean square of the means of blocks, those at the far borders smaller."""
    _, height, width = apart.shape
    total = 0.0
    for top in range(0, height, BLOCK_PX):
        band = apart[:, top : top + BLOCK_PX].sum(axis=1, dtype=np.float64)
        sums = np.add.reduceat(band, np.arange(0, width, BLOCK_PX), axis=1)
        columns = np.diff(np.append(np.arange(0, width, BLOCK_PX), width))
        rows = min(BLOCK_PX, height - top)
        total += float((np.square(sums) / (rows * columns)).sum())
    return total / apart.size


def part(square: FloatArray, where: Any) -> float | None:
    """Return the dB of a part of a frame; None where there is none."""
    held = square[where]
    return decibels(held) if held.size else None


def table(rows: Mapping[str, Sequence[Entry]], isos: Sequence[float]) -> str:
    """Return the table as Markdown, a part for every ISO."""
    heads = [*MEASURES, *(f"zone {number + 1}" for number in range(ZONES))]
    lines = []
    for iso in isos:
        lines += [f"ISO {iso:g}", "", f"| | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
        for name, entries in rows.items():
            held = [[*(e[m] for m in MEASURES), *e["zones"]] for e in entries if e["iso"] == iso]
            cells = [mean_of([row[column] for row in held]) for column in range(len(heads))]
            lines.append(f"| {name} | {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


def mean_of(values: Sequence[float | None]) -> str:
    """Return the mean of what is known, as the table has it."""
    known = [value for value in values if value is not None]
    return f"{np.mean(known):.2f}" if known else ""


def digest(way: Way, path: Path, iso: float, sources: Mapping[str, Any]) -> str:
    """Return a hash of all that decides an entry."""
    held = hashlib.sha256(way.bundle.path.read_bytes()).hexdigest()
    seen = hashlib.sha256(path.read_bytes()).hexdigest()
    told = [held, way.name, way.options.method, seen, iso, dict(sources)]
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


if __name__ == "__main__":
    main()
