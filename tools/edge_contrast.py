"""The contrast of a camera's pictures after recovery: slanted edges through the whole runtime.

    python -m tools.edge_contrast duet duet-joint trio-edof --out-dir out/contrast

An edge of 4 : 1 (`--levels`) along the rows and one along the columns of the sensor are
photographed through the bundle's PSF at five places between middle and corner and at every
distance that the PSF knows, and processed as `camkit process` does it, in sensor geometry.
Contrast is that of green against the sharp edge (ISO 12233, `tools.design.edge`).
Writes `contrast.json` and `contrast.png`, and prints a Markdown table.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import torch
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.colorimetry import apply_matrix
from camkit.contracts import depth_name
from camkit.report.quality import FIELD_SHARES, crop_origin
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from tools.capture.simulated import captured, color_sensor, rec709_of
from tools.design.edge import (
    ACROSS,
    LEVELS,
    Across,
    EdgeContrast,
    edge_contrast,
    slanted_edge,
)
from tools.design.table import MOST_CONTRAST, worst_of_curves

Plane = NDArray[np.floating[Any]]

SIDE_PX: Final = 512
"""Of a capture: further than any of our networks sees, and more than a block of the bank."""
SEEN_PX: Final = 128
ISO: Final = 100.0
CORNER: Final = (1, 1)
ROUNDING: Final = 4
ALONG: Final[dict[Across, str]] = {"tangential": "rows", "sagittal": "columns"}
"""Which way the edge runs: places lie on a diagonal, so neither follows the field."""
LINES: Final[dict[Across, str]] = {"tangential": "-", "sagittal": "--"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shots:
    """What is photographed.

    Attributes:
        levels: Linear, of the dark and the bright side of an edge.
        draws: Of the noise; the pictures are averaged.
    """

    levels: tuple[float, float]
    draws: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One method of one camera at one distance.

    Attributes:
        bundle: Its name.
        depth: Of the edges.
        method: Size of the network, or `wiener`.
        curves: For an edge along the rows (`tangential`) and along the columns (`sagittal`):
            contrast (place, frequency).
    """

    bundle: str
    depth: str
    method: str
    curves: dict[Across, EdgeContrast]

    @property
    def worst(self) -> tuple[float, float, float]:
        """Return the largest contrast, the largest rise, and the share of curves that only fall."""
        return worst_of_curves(list(self.curves.values()))

    def mean_at(self, cycles_per_px: float) -> float:
        """Return the mean contrast over places and directions, at the nearest frequency."""
        found = []
        for curve in self.curves.values():
            nearest = int((curve.cycles_per_px - cycles_per_px).abs().argmin())
            found.append(float(curve.contrast[..., nearest].mean()))
        return float(np.mean(found))

    def line(self) -> str:
        """Return the row of the table."""
        means = " | ".join(f"{self.mean_at(cycles):.2f}" for cycles in (0.1, 0.25, 0.5))
        largest, rise, falls = self.worst
        return (
            f"| {self.bundle} | {self.depth} | {self.method} | {means} "
            f"| {largest:.2f} | {rise:.2f} | {falls:.0%} |"
        )


def main() -> None:
    """Measure, write, draw and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("bundle", nargs="+", help="built-in names or files")
    parser.add_argument("--out-dir", type=Path, default=Path("out/contrast"))
    parser.add_argument(
        "--levels", type=float, nargs=2, default=LEVELS, help="linear, of the dark and bright side"
    )
    parser.add_argument("--draws", type=int, default=4, help="of the noise, averaged")
    options = parser.parse_args()
    low, high = options.levels
    shots = Shots(levels=(low, high), draws=options.draws)
    rows = []
    print(
        "| camera | distance | method | at 0.1 | at 0.25 | at 0.5 | up to | climbs | only falls |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in options.bundle:
        for row in measure(open_bundle(find_bundle(name)), shots):
            rows.append(row)
            print(row.line(), flush=True)
    options.out_dir.mkdir(parents=True, exist_ok=True)
    write(rows, shots, options.out_dir / "contrast.json")
    draw(rows, options.out_dir / "contrast.png")


def measure(bundle: Bundle, shots: Shots) -> list[Row]:
    """Measure every method of a bundle at every distance."""
    pipelines = {"wiener": Pipeline(bundle, Options(method="wiener", undistort=False))}
    for size in bundle.manifest.sizes:
        pipelines[size] = Pipeline(bundle, Options(size=size, undistort=False))
    rows = []
    for depth_mm in bundle.psf.depths_mm.tolist():
        found = {across: _edges(bundle, pipelines, across, depth_mm, shots) for across in ACROSS}
        for method in pipelines:
            curves = {across: found[across][method] for across in ACROSS}
            depth = depth_name(depth_mm)
            rows.append(Row(bundle=bundle.manifest.name, depth=depth, method=method, curves=curves))
    return rows


def _edges(
    bundle: Bundle, pipelines: dict[str, Pipeline], across: Across, depth_mm: float, shots: Shots
) -> dict[str, EdgeContrast]:
    """Return the contrast (place, frequency) that each method leaves."""
    sensor = color_sensor(bundle)
    scene = slanted_edge(SIDE_PX, across, shots.levels).float().numpy()
    matrix = rec709_of(sensor)
    truth = scene[1]
    shown: dict[str, list[Plane]] = {method: [] for method in pipelines}
    for share in FIELD_SHARES:
        origin = crop_origin((SIDE_PX, SIDE_PX), (sensor.width_px, sensor.height_px), share, CORNER)
        sums = {method: np.zeros((SIDE_PX, SIDE_PX)) for method in pipelines}
        for seed in range(shots.draws):
            taken = SimulationOptions(
                iso=ISO, seed=seed, origin_px=origin, depth_mm=depth_mm, distort=False
            )
            simulation = photograph(scene, bundle, taken)
            truth = apply_matrix(matrix, simulation.clean)[1]
            for method, pipeline in pipelines.items():
                restored = pipeline.start(captured(pipeline, simulation)).fill()
                sums[method] += restored[1] / shots.draws
        for method, picture in sums.items():
            shown[method].append(_middle(picture))
    sharp = torch.from_numpy(_middle(truth))
    return {
        method: edge_contrast(torch.from_numpy(np.stack(pictures)), sharp, across)
        for method, pictures in shown.items()
    }


def _middle(plane: Plane) -> Plane:
    cut = (SIDE_PX - SEEN_PX) // 2
    return np.ascontiguousarray(plane[cut:-cut, cut:-cut])


def write(rows: Sequence[Row], shots: Shots, path: Path) -> None:
    """Write all curves as JSON."""
    found = [
        {
            "bundle": row.bundle,
            "depth": row.depth,
            "method": row.method,
            **dict(zip(("largest", "rise", "falling"), row.worst, strict=True)),
            "cycles_per_px": next(iter(row.curves.values())).cycles_per_px.tolist(),
            "contrast": {
                ALONG[across]: np.round(curve.contrast.numpy(), ROUNDING).tolist()
                for across, curve in row.curves.items()
            },
        }
        for row in rows
    ]
    content = {
        "field_shares": FIELD_SHARES,
        "iso": ISO,
        "levels": shots.levels,
        "draws": shots.draws,
        "rows": found,
    }
    path.write_text(json.dumps(content) + "\n", encoding="utf-8")


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw a row of panels per camera and distance, a panel per place."""
    mpl.use("agg")
    from matplotlib import pyplot as plt

    groups = list(dict.fromkeys((row.bundle, row.depth) for row in rows))
    figure, panels = plt.subplots(
        len(groups),
        len(FIELD_SHARES),
        figsize=(3 * len(FIELD_SHARES), 2.4 * len(groups)),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for (bundle, depth), line in zip(groups, panels, strict=True):
        of_group = [row for row in rows if (row.bundle, row.depth) == (bundle, depth)]
        for place, panel in enumerate(line):
            for index, row in enumerate(of_group):
                for across, curve in row.curves.items():
                    label = row.method if across == "tangential" else None
                    style = {"color": f"C{index}", "linestyle": LINES[across], "label": label}
                    panel.plot(curve.cycles_per_px, curve.contrast[place], **style)
            panel.axhline(MOST_CONTRAST, color="0.7", linewidth=0.8)
            panel.set_title(f"{bundle}, {depth}, {FIELD_SHARES[place]:.0%}", fontsize=8)
    panels[0, 0].legend(fontsize=7)
    figure.supxlabel("cycles per pixel")
    figure.supylabel("contrast after recovery")
    figure.savefig(path, dpi=80)
    plt.close(figure)


if __name__ == "__main__":
    main()
