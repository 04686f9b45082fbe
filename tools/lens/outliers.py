"""Patches by their error, and the worst beside the truth: figure 3.10 re-made.

    python -m tools.lens.outliers thin-plate supervised=FILE.camkit --data PICTURES -o outliers.png

Every camera is NAME, FILE or LABEL=FILE; what is measured is that of `camkit analyse
hallucination`, whose page shows all of it for one camera. Here the methods that end with a network
stand side by side: how many patches have which l1, l2 and perceptual error, and under that the
`--worst` patches of each that its captures deny most (largest excess), truth, capture and result.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.errors import CamkitError, ContractError
from camkit.report.analysis.hallucination import WORST, Method, Options, analyse
from camkit.report.analysis.hallucination_page import crop_picture
from camkit.report.figure import GRID_COLOR, field_color, new_figure, to_png
from camkit.report.stress.scene import stress_scenes
from tools.lens.field_drawings import write_few_colours

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ERRORS: Final = ("l1", "l2", "perceptual")
BINS: Final = 40
WIDTH_IN: Final = 9.0
HISTOGRAMS_IN: Final = 2.4


def main() -> int:
    """Measure the cameras, draw."""
    chosen = parse()
    found: dict[str, Method] = {}
    try:
        for word in chosen.cameras:
            before, named, after = word.partition("=")
            bundle = open_bundle(find_bundle(after if named else before))
            label = before if named else bundle.manifest.name
            if label in found:
                raise ContractError(f"two cameras are called {label}; say LABEL=FILE")
            scenes = stress_scenes(bundle, chosen.pictures, chosen.data)
            report = analyse(bundle, scenes, Options(iso=chosen.iso))
            found[label] = report.method(report.control.method)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    write_few_colours(to_png(draw(found, chosen.worst)), chosen.out)
    return 0


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cameras", nargs="+", metavar="[LABEL=]FILE")
    parser.add_argument("--data", type=Path, required=True, help="sharp pictures")
    parser.add_argument("--pictures", type=int, default=5)
    parser.add_argument("--iso", type=float, default=100.0)
    parser.add_argument(
        "--worst",
        type=int,
        default=4,
        choices=range(1, WORST + 1),
        metavar="N",
        help="patches of each camera",
    )
    parser.add_argument("-o", "--out", type=Path, default=Path("outliers.png"))
    return parser.parse_args()


def draw(found: Mapping[str, Method], worst: int) -> "Figure":
    """Draw histograms of `ERRORS`, and a row of the worst patches of every method.

    Args:
        found: Name -> method.
        worst: Patches of a row.
    """
    # a patch is three squares wide, and has a title
    row_in = WIDTH_IN / worst / 3 + 0.35
    heights = [HISTOGRAMS_IN] + [row_in] * len(found)
    figure = new_figure(WIDTH_IN, sum(heights))
    grid = figure.add_gridspec(len(heights), len(ERRORS) * worst, height_ratios=heights)
    for place, error in enumerate(ERRORS):
        panel = figure.add_subplot(grid[0, place * worst : (place + 1) * worst])
        values = {name: method.values(error) for name, method in found.items()}
        edges = np.histogram_bin_edges(np.concatenate(list(values.values())), BINS).tolist()
        for number, (name, one) in enumerate(values.items()):
            color = field_color(number)
            panel.hist(one, edges, histtype="step", color=color, label=name, linewidth=1)
        panel.set_xlabel(error, fontsize=8)
        panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
        panel.tick_params(labelsize=7)
        if place == 0:
            panel.set_ylabel("patches", fontsize=8)
            panel.legend(fontsize=6, frameon=False)
    for row, (name, method) in enumerate(found.items(), start=1):
        for place, crop in enumerate(method.worst[:worst]):
            sides = slice(place * len(ERRORS), (place + 1) * len(ERRORS))
            panel = figure.add_subplot(grid[row, sides])
            panel.set_axis_off()
            panel.imshow(crop_picture(crop)[..., ::-1], interpolation="nearest")
            panel.set_title(f"{name}, excess {crop.patch.values['excess']:.1f}", fontsize=6)
    return figure


if __name__ == "__main__":
    raise SystemExit(main())
