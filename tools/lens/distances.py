"""A camera for several distances at each of them: told the distance, and not told.

    python -m tools.lens.distances trio-edof --before OLD.camkit --data DATA/test

Pictures are photographed at every distance, on the axis, half-way out and in the corner, through
the lens as designed and three fabricated copies in turn, traced for that distance. Rows are PSNR
in dB on sRGB values; gains are paired, with the standard error over pictures. `untold` methods get
no distance, `told` ones have it (`--depth-m`); how far off what a bundle finds by itself is stands
below, in 1/m.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.colorimetry import encode_srgb
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.quality import (
    BORDER_PX,
    FABRICATION_SEEDS,
    Shot,
    expose,
    list_set,
    psnr,
    read_picture,
)
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation
from camkit.units import MM_PER_M
from tools.capture.simulated import captured

DESIGNED: Final = None
LENSES: Final = (DESIGNED, *FABRICATION_SEEDS[:3])
POSITIONS: Final = (0, 2, 4)
"""Of `camkit.report.quality.FIELD_SHARES`: axis, half-way, corner."""
UNTOLD, TOLD = "untold", "told"
PAIRS: Final = tuple(
    (f"{size} {UNTOLD}", other)
    for size in ("S", "M")
    for other in (
        "developed",
        f"filter {UNTOLD}",
        f"{size} {TOLD}",
        f"{size} {UNTOLD} before",
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """A method of a bundle, told the distance or not."""

    name: str
    bundle: Bundle
    options: dict[str, str]
    told: bool = False

    def restore(self, simulation: Simulation, depth_mm: float) -> tuple[np.ndarray, float | None]:
        """Return the picture, and the distance in m that was found."""
        told = {"depth_m": depth_mm / MM_PER_M} if self.told else {}
        options = Options(undistort=False, threads=1, **self.options, **told)  # type: ignore[arg-type]
        pipeline = Pipeline(self.bundle, options)
        made = pipeline.start(captured(pipeline, simulation))
        return encode_srgb(made.fill()), made.sections.get("distance", {}).get("median_m")


def main() -> None:
    """Photograph, restore and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bundle")
    parser.add_argument("--before", help="the bundle as it was")
    parser.add_argument("--data", type=Path, required=True, help="folder of the sets")
    parser.add_argument("--sets", default="kodak_odd,bsd100_half_a")
    parser.add_argument("--per-set", type=int, default=12)
    parser.add_argument("--depths-m", type=float, nargs="+", default=[0.5, 0.7, 1.0, 1.5])
    parser.add_argument("--iso", type=float, default=200.0)
    parser.add_argument("--work-dir", type=Path, default=Path("runs/distances"))
    parser.add_argument("--out", type=Path, help="also write all numbers as JSON")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    bundle = open_bundle(find_bundle(Path(arguments.bundle)))
    ways = list(_ways(bundle, ""))
    if arguments.before is not None:
        ways += _ways(open_bundle(find_bundle(Path(arguments.before))), " before")
    rows: list[dict[str, Any]] = []
    errors: dict[float, list[float]] = defaultdict(list)
    for shot, depth_mm, seed in _shots(arguments):
        lens = (
            bundle.frozen_optics
            if seed is DESIGNED
            else fabricated_optics(bundle, seed, cache_folder=arguments.work_dir, depth_mm=depth_mm)
        )
        seen = expose(shot, read_picture(shot.picture), bundle, lens, depth_mm=depth_mm)
        row = {"picture": shot.picture.name, "depth_m": depth_mm / MM_PER_M, "copy": seed}
        for way in ways:
            picture, found_m = way.restore(seen.simulation, depth_mm)
            row[way.name] = _psnr_db(picture, seen.sharp)
            if found_m is not None and way.options["method"] == "wiener":
                errors[depth_mm].append(1 / found_m - MM_PER_M / depth_mm)
        rows.append(row)
    print("\n".join(_table(rows, [way.name for way in ways])))
    for depth_mm, found in errors.items():
        size = np.abs(found)
        print(
            f"{depth_mm / MM_PER_M:g} m: distance found off by {np.median(size):.2f} / m (median), "
            f"{np.quantile(size, 0.9):.2f} / m (nine of ten)"
        )
    if arguments.out is not None:
        off = {f"{d / MM_PER_M:g}": np.round(e, 4).tolist() for d, e in errors.items()}
        arguments.out.write_text(json.dumps({"captures": rows, "errors_per_m": off}, indent=1))


def _ways(bundle: Bundle, suffix: str) -> Iterator[Way]:
    def way(name: str, *, told: bool, **options: str) -> Way:
        said = "" if name == "developed" else f" {TOLD if told else UNTOLD}"
        return Way(name=f"{name}{said}{suffix}", bundle=bundle, options=options, told=told)

    if not suffix:
        yield way("developed", told=False, method="develop")
    for told in (False, True):
        yield way("filter", told=told, method="wiener")
        for size in bundle.manifest.sizes:
            yield way(size, told=told, method="net", size=size)


def _shots(arguments: argparse.Namespace) -> Iterator[tuple[Shot, float, int | None]]:
    pictures = [
        (name, path)
        for name in arguments.sets.split(",")
        for path in list_set(arguments.data / name, arguments.per_set)
    ]
    turn = 0
    for number, (name, path) in enumerate(pictures):
        for position in POSITIONS:
            for depth_m in arguments.depths_m:
                seed = LENSES[(turn + number) % len(LENSES)]
                turn += 1
                shot = Shot(
                    set_name=name,
                    picture=path,
                    number=number,
                    position=position,
                    iso=arguments.iso,
                    psf="bundle" if seed is DESIGNED else "fresh",
                )
                yield shot, depth_m * MM_PER_M, seed


def _psnr_db(picture: np.ndarray, sharp: np.ndarray) -> float:
    inner = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    return round(psnr(*(np.clip(p[inner], 0, 1, dtype=np.float64) for p in (sharp, picture))), 3)


def _table(rows: list[dict[str, Any]], names: list[str]) -> Iterator[str]:
    depths = sorted({row["depth_m"] for row in rows})
    yield f"| {len(rows)} captures | " + " | ".join(f"{d:g} m" for d in depths) + " | mean |"
    yield "|---" * (len(depths) + 2) + "|"
    for name in names:
        levels = [np.mean([r[name] for r in rows if r["depth_m"] == d]) for d in depths]
        cells = [f"{level:.2f}" for level in (*levels, np.mean(levels))]
        yield f"| {name} | " + " | ".join(cells) + " |"
    for name, other in PAIRS:
        if not {name, other} <= set(names):
            continue
        cells = []
        for chosen in [[r for r in rows if r["depth_m"] == d] for d in depths] + [rows]:
            by_picture = defaultdict(list)
            for row in chosen:
                by_picture[row["picture"]].append(row[name] - row[other])
            gains = [np.mean(gain) for gain in by_picture.values()]
            error = np.std(gains, ddof=1) / np.sqrt(len(gains)) if len(gains) > 1 else np.nan
            cells.append(f"{np.mean(gains):+.2f} +- {error:.2f}")
        yield f"| {name} - {other} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
