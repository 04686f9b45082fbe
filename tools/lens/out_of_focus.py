"""What is out of focus stays so: widths of edges before and after recovery (figure 3.12, above).

    python -m tools.lens.out_of_focus --bundle open.camkit --data SHARP BLURRED -o DIR

Two kinds of edge, dark to bright, are photographed on the axis and restored by the camera, which
knows of nothing but what is in focus:

    disc    blurred before the camera by an even disc of so many pixels: a background that another
            lens would show with this width
    depth   as near as that and sharp itself: the plate, focused far away, is traced for it

The width of an edge is the way from 10 to 90 % of its rise, between the levels 256 px to its sides.
Haze is wider than that window and makes slopes of the levels, so the capture's own width says how
far the haze carries, and only what is recovered can be held against the scene's.

Writes focus.json, focus.png (widths and profiles) and focus-picture.png, the middle of the first
picture before the second one, which is blurred by a disc, into DIR.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.thin.freezing import HazyGrid, freeze_hazy
from camkit.report.analysis.recovery import filled
from camkit.report.figure import GRID_COLOR, MARKS, field_color, new_figure, to_png
from camkit.report.quality import read_picture
from camkit.runtime.twin.light import Light
from camkit.runtime.twin.truth import light_sensor
from camkit.units import MM_PER_M
from tools.hdr.record import in_one_line
from tools.lens.cameras import (
    decibels,
    light_through,
    open_camera,
    restored,
    square_error,
    truth_of,
    ways_of,
)
from tools.lens.picture_strip import draw_strip

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DISCS_PX: Final = (0.0, 16.0, 32.0, 64.0, 115.0)
DEPTHS_M: Final = (4.0, 2.0, 1.0, 0.5)
LEVELS: Final = (0.15, 0.6)
EDGE_PX: Final = (1152, 320)
"""Width and height of the frame of an edge."""
ROWS_PX: Final = 64
"""Left out above and below."""
REACH_PX: Final = 256
LEVEL_PX: Final = 32
"""Of the samples at the end of the reach that say what the level is."""
SHARES: Final = (0.1, 0.9)
FIELDS: Final = 5
RAYS: Final = 4000
FRAME_PX: Final = (1152, 768)
PICTURE_DISC_PX: Final = 115.0
SHRINK: Final = 3

Line = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Edge:
    """An edge, before and after.

    Attributes:
        kind: `disc` or `depth`.
        size: Diameter in pixels, or distance in metres.
        scene_px: Its width as a perfect camera in focus shows it.
        widths_px: Way -> its width.
    """

    kind: str
    size: float
    scene_px: float
    widths_px: dict[str, float]


@in_one_line
def main() -> None:
    """Photograph, restore, measure, draw, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", required=True, help="the camera of the plate")
    parser.add_argument("--lens", type=Path, default=Path("thin-plate"), help="of that plate")
    parser.add_argument("--data", type=Path, nargs=2, required=True, help="sharp, blurred")
    parser.add_argument("--discs-px", type=float, nargs="+", default=DISCS_PX)
    parser.add_argument("--depths-m", type=float, nargs="*", default=DEPTHS_M)
    parser.add_argument("--frame", type=int, nargs=2, metavar=("W", "H"), default=FRAME_PX)
    parser.add_argument("-o", "--out-dir", type=Path, required=True)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    lens = read_lens(chosen.lens)
    sharp, far = (filled(read_picture(path), *chosen.frame) for path in chosen.data)
    with TemporaryDirectory() as folder:
        bundle = open_camera(chosen.bundle, Path(folder))
        profiles: dict[tuple[str, float], dict[str, Line]] = {}
        for disc in chosen.discs_px:
            light = light_through(bundle, edge_scene(disc))
            profiles["disc", disc] = looks(bundle, light, disc)
        for depth in chosen.depths_m:
            near = replace(lens, object_distance_mm=depth * MM_PER_M)
            sensor = light_sensor(bundle.manifest)
            optics: FrozenOptics
            optics, _ = freeze_hazy(near, sensor, HazyGrid(fields=FIELDS, rays=RAYS))
            light = light_through(bundle, edge_scene(0.0), optics=optics)
            profiles["depth", depth] = looks(bundle, light, 0.0)
        edges = [measured(*key, lines) for key, lines in profiles.items()]
        row, db = shown(bundle, before_background(sharp, far, PICTURE_DISC_PX))
    told = {
        "reach_px": REACH_PX,
        "edges": [asdict(edge) for edge in edges],
        "picture": {"disc_px": PICTURE_DISC_PX, "psnr_db": db},
    }
    chosen.out_dir.mkdir(parents=True, exist_ok=True)
    (chosen.out_dir / "focus.json").write_text(json.dumps(told, indent=1) + "\n", "utf-8")
    (chosen.out_dir / "focus.png").write_bytes(to_png(draw(edges, profiles)))
    strip = draw_strip({"": row}, shrink=SHRINK)
    (chosen.out_dir / "focus-picture.png").write_bytes(to_png(strip))
    print(to_text(edges))


def edge_scene(disc_px: float) -> FloatArray:
    """Return an edge (3, h, w) that rises between the middle columns, blurred by an even disc."""
    width, height = EDGE_PX
    low, high = LEVELS
    rise = disc_rise(np.arange(width, dtype=np.float64) - (width - 1) / 2, disc_px)
    line = (low + (high - low) * rise).astype(np.float32)
    return np.ascontiguousarray(np.broadcast_to(line, (3, height, width)))


def disc_rise(at_px: Line, disc_px: float) -> Line:
    """Return how much of an even disc lies on the bright side of a straight edge, 0..1.

    Args:
        at_px: Of the middle of the disc from the edge.
        disc_px: Its diameter; 0 for a point.
    """
    if disc_px == 0:
        return np.asarray((at_px > 0) + 0.5 * (at_px == 0), np.float64)
    x = np.clip(2 * at_px / disc_px, -1, 1)
    return np.asarray(0.5 + (x * np.sqrt(1 - x * x) + np.arcsin(x)) / np.pi)


def looks(bundle: Bundle, light: Light, disc_px: float) -> dict[str, Line]:
    """Return the profile of green of an edge: of the scene, developed, and as restored."""
    middle = slice(ROWS_PX, EDGE_PX[1] - ROWS_PX)
    found = {"scene": edge_scene(disc_px)[1, middle].mean(axis=0, dtype=np.float64)}
    for way in ("develop", *ways_of(bundle)):
        picture = restored(bundle, light, 1.0, way)
        found[way] = picture[1, middle].mean(axis=0, dtype=np.float64)
    return found


def measured(kind: str, size: float, profiles: dict[str, Line]) -> Edge:
    """Measure the widths of an edge."""
    widths = {way: round(edge_width_px(line), 2) for way, line in profiles.items()}
    return Edge(kind=kind, size=size, scene_px=widths.pop("scene"), widths_px=widths)


def edge_width_px(line: Line) -> float:
    """Return the way from 10 to 90 % of the rise of a profile about its middle.

    Args:
        line: (n,), n even, the edge between the middle samples. The levels are the means of the
            outer samples within the reach; crossings are the last before and the first behind
            which the rise stays on its side, linear between samples.
    """
    middle = line.size // 2
    reach = min(REACH_PX, middle)
    cut = line[middle - reach : middle + reach]
    low, high = cut[:LEVEL_PX].mean(), cut[-LEVEL_PX:].mean()
    rise = (cut - low) / (high - low)
    below, above = SHARES
    first = _crossing(rise, below)
    last = rise.size - 1 - _crossing(1 - rise[::-1], 1 - above)
    return float(last - first)


def _crossing(rise: Line, level: float) -> float:
    """Return where a rise first passes a level for good, on its way to one half."""
    half = int(np.argmax(rise >= 0.5))
    under = np.flatnonzero(rise[:half] < level)
    last = int(under[-1]) if under.size else 0
    step = rise[last + 1] - rise[last]
    return last + float(np.clip((level - rise[last]) / step, 0, 1)) if step > 0 else float(last)


def before_background(sharp: FloatArray, far: FloatArray, disc_px: float) -> FloatArray:
    """Return a picture within an ellipse, before another one that is blurred by an even disc."""
    side = 2 * int(np.ceil(disc_px / 2)) + 1
    place = np.arange(side) - side // 2
    kernel = (np.hypot(place[:, None], place) <= disc_px / 2).astype(np.float32)
    blurred = np.stack([cv2.filter2D(p, -1, kernel / kernel.sum()) for p in far])
    _, height, width = sharp.shape
    y, x = np.indices((height, width))
    inside = np.hypot((x / width - 0.5) / 0.28, (y / height - 0.5) / 0.4) < 1
    return np.asarray(np.where(inside, sharp, blurred), np.float32)


def shown(bundle: Bundle, scene: FloatArray) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Return a scene, what is developed and what is restored of it, and their dB."""
    light = light_through(bundle, scene)
    truth = truth_of(bundle, light)
    row, db = {"scene": truth}, dict[str, float]()
    for way in ("develop", *ways_of(bundle)):
        picture = restored(bundle, light, 1.0, way)
        db[way] = round(decibels(square_error(picture, truth)), 3)
        row[f"{way}, {db[way]:.1f} dB"] = picture
    return row, db


def draw(edges: Sequence[Edge], profiles: dict[tuple[str, float], dict[str, Line]]) -> "Figure":
    """Draw widths against the scene's, and the profiles of the nearest and the widest edge."""
    figure = new_figure(8.4, 3.0)
    widths, *lines = figure.subplots(1, 3)
    discs = [edge for edge in edges if edge.kind == "disc"]
    ways = list(discs[0].widths_px)
    for number, way in enumerate(ways):
        at = [edge.scene_px for edge in discs]
        widths.plot(
            at,
            [edge.widths_px[way] for edge in discs],
            marker=MARKS[number],
            color=field_color(number),
            linewidth=1,
            markersize=4,
            label=way,
        )
    most = max(edge.scene_px for edge in discs)
    widths.plot([0, most], [0, most], ":", color="black", linewidth=0.8, label="as the scene")
    widths.set_xlabel("width of the scene's edge, px", fontsize=8)
    widths.set_ylabel("width, px", fontsize=8)
    widths.set_title("blurred by a disc", fontsize=8)
    last = {key[0]: key for key in profiles}
    for panel, (kind, size) in zip(lines, last.values(), strict=False):
        said = f"disc of {size:g} px" if kind == "disc" else f"at {size:g} m, traced"
        _draw_profiles(panel, profiles[kind, size], said)
    for panel in (widths, *lines):
        panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
        panel.tick_params(labelsize=7)
        panel.legend(fontsize=6, frameon=False)
    return figure


def _draw_profiles(panel: "Axes", lines: dict[str, Line], title: str) -> None:
    for number, (way, line) in enumerate(lines.items()):
        at = np.arange(line.size) - (line.size - 1) / 2
        near = np.abs(at) <= REACH_PX
        color = "black" if way == "scene" else field_color(number - 1)
        style = ":" if way == "scene" else "-"
        panel.plot(at[near], line[near], style, color=color, linewidth=1, label=way)
    panel.set_xlabel("px from the edge", fontsize=8)
    panel.set_title(title, fontsize=8)


def to_text(edges: Sequence[Edge]) -> str:
    """Return the widths as a table in Markdown."""
    ways = list(edges[0].widths_px)
    lines = [f"| edge | scene, px | {', px | '.join(ways)}, px |", "|---|---|" + "---|" * len(ways)]
    for edge in edges:
        unit = "disc of {:g} px" if edge.kind == "disc" else "at {:g} m"
        cells = " | ".join(f"{edge.widths_px[way]:.1f}" for way in ways)
        lines.append(f"| {unit.format(edge.size)} | {edge.scene_px:.1f} | {cells} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
