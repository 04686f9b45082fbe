"""The contrast that methods leave of slanted edges, at five places of the sensor.

    python -m tools.comparison.edge_contrast duet OLD.camkit --levels 0.3 0.4 -o weak.json

An edge along the rows and one along the columns are photographed through the bundle's own PSF and
restored as `camkit process` does it, in sensor geometry. Contrast is the spectrum of the slope of
linear green over that of the sharp edge (ISO 12233): above 1 is sharpening that the scene has not.
It is not scaled to 1 at frequency 0. Copies of the same edge that differ in noise are averaged.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.colorimetry import apply_matrix
from camkit.psf import depth_name
from camkit.report.bench.machine import describe_machine
from camkit.report.edge_profile import edge_waves, sort_samples
from camkit.report.quality import FIELD_SHARES, crop_origin
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation, SimulationOptions
from camkit.runtime.twin.simulate import photograph as simulate_capture
from camkit.scenes.slanted_edge import ANGLE_RAD, LEVELS, slanted_edge
from tools.capture.simulated import captured, color_sensor, rec709_of
from tools.tables.records import markdown_table, to_compact_json

FloatGrid = NDArray[np.float64]

SIDE_PX: Final = 512
"""Of a capture: further than any of our networks sees, and more than a block of the bank."""
SEEN_PX: Final = 128
REACH_PX: Final = 40
ISO: Final = 100.0
CORNER: Final = (1, 1)
CYCLES_PER_PX: Final = np.linspace(0.02, 0.5, 25)
SHOWN_CYCLES: Final = (0.1, 0.25, 0.5)
DIRECTIONS: Final = {"rows": False, "columns": True}
DIGITS: Final = 4
HEADS: Final = (
    "camera",
    "distance",
    "method",
    *(f"at {cycles:g}" for cycles in SHOWN_CYCLES),
    "up to",
    "climbs",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shots:
    """Edges to photograph.

    Attributes:
        levels: Linear, of the dark and the bright side.
        draws: Of the noise.
    """

    levels: tuple[float, float]
    draws: int


def main(words: list[str] | None = None) -> None:
    """Measure, write and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("bundle", nargs="+", help="built-in names or files")
    parser.add_argument("--levels", type=float, nargs=2, default=LEVELS, help="linear")
    parser.add_argument("--draws", type=int, default=4, help="of the noise, averaged")
    parser.add_argument("-o", "--output", type=Path, required=True, help="JSON")
    options = parser.parse_args(words)
    low, high = options.levels
    shots = Shots(levels=(low, high), draws=options.draws)
    rows = [
        row for name in options.bundle for row in measure(open_bundle(find_bundle(name)), shots)
    ]
    record = {
        "levels": shots.levels,
        "draws": shots.draws,
        "iso": ISO,
        "field_shares": FIELD_SHARES,
        "cycles_per_px": CYCLES_PER_PX.tolist(),
        "machine": describe_machine(),
        "rows": rows,
    }
    options.output.parent.mkdir(parents=True, exist_ok=True)
    text = to_compact_json(record, DIGITS).replace('{"camera"', '\n{"camera"')
    options.output.write_text(text + "\n", encoding="utf-8")
    print(markdown_table(HEADS, [_cells(row) for row in rows]))


def measure(bundle: Bundle, shots: Shots) -> Iterator[dict[str, Any]]:
    """Yield a row for every distance and method: contrast by direction, and its extremes."""
    ways = {"wiener": Options(method="wiener", undistort=False)}
    ways |= {size: Options(size=size, undistort=False) for size in bundle.manifest.sizes}
    for depth_mm in bundle.psf.depths_mm.tolist():
        for method, options in ways.items():
            pipeline = Pipeline(bundle, options)
            curves = {
                name: _contrasts(bundle, pipeline, name, depth_mm, shots) for name in DIRECTIONS
            }
            both = np.stack(list(curves.values()))
            yield {
                "camera": f"{bundle.manifest.name} {bundle.manifest.version}",
                "distance": depth_name(depth_mm),
                "method": method,
                "largest": float(both.max()),
                "rise": float((both - np.minimum.accumulate(both, axis=-1)).max()),
                "contrast": {name: curve.tolist() for name, curve in curves.items()},
            }


def _contrasts(
    bundle: Bundle, pipeline: Pipeline, direction: str, depth_mm: float, shots: Shots
) -> FloatGrid:
    """Return the contrast (place, frequency) of an edge along rows or columns."""
    along_columns = DIRECTIONS[direction]
    scene = slanted_edge(SIDE_PX, SIDE_PX, along_columns=along_columns, levels=shots.levels)
    bins = sort_samples(_distances(along_columns), REACH_PX)
    waves = edge_waves(bins, CYCLES_PER_PX)
    contrasts = []
    for share in FIELD_SHARES:
        simulations = [_simulation(bundle, scene, share, depth_mm, i) for i in range(shots.draws)]
        pictures = [_restored(pipeline, simulation) for simulation in simulations]
        sharp = apply_matrix(rec709_of(color_sensor(bundle)), simulations[0].clean)[1]
        restored, reference = (
            np.abs(waves @ bins.means(_middle(plane)))
            for plane in (np.mean(pictures, axis=0), sharp)
        )
        contrasts.append(restored / reference)
    return np.stack(contrasts)


def _distances(along_columns: bool) -> FloatGrid:
    """Return how far (h, w) the middles of the pixels that are looked at lie from the edge."""
    y, x = np.mgrid[:SEEN_PX, :SEEN_PX] - (SEEN_PX - 1) / 2
    across, along = (x, y) if along_columns else (y, x)
    return np.asarray(across * np.cos(ANGLE_RAD) - along * np.sin(ANGLE_RAD))


def _simulation(
    bundle: Bundle, scene: FloatArray, share: float, depth_mm: float, seed: int
) -> Simulation:
    sensor = color_sensor(bundle)
    whole = (sensor.width_px, sensor.height_px)
    options = SimulationOptions(
        iso=ISO,
        seed=seed,
        origin_px=crop_origin((SIDE_PX, SIDE_PX), whole, share, CORNER),
        depth_mm=depth_mm,
        distort=False,
    )
    return simulate_capture(scene, bundle, options)


def _restored(pipeline: Pipeline, simulation: Simulation) -> FloatArray:
    green: FloatArray = pipeline.start(captured(pipeline, simulation)).fill()[1]
    return green


def _middle(plane: FloatArray) -> FloatArray:
    cut = (SIDE_PX - SEEN_PX) // 2
    return plane[cut:-cut, cut:-cut]


def _cells(row: dict[str, Any]) -> list[str]:
    """Return a line of the table: means over places and directions, and the extremes."""
    means = np.mean(list(row["contrast"].values()), axis=(0, 1))
    at = [means[np.abs(CYCLES_PER_PX - cycles).argmin()] for cycles in SHOWN_CYCLES]
    numbers = [f"{value:.2f}" for value in (*at, row["largest"], row["rise"])]
    return [row["camera"], row["distance"], row["method"], *numbers]


if __name__ == "__main__":
    main()
