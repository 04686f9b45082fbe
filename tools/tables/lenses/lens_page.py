"""Lenses compared after recovery: the tables and the picture.

A report is what `lens_table` measures: settings, and for every lens `capture` (and `front`)
with `db` and `ssim` (depth, field), `contrast`, what became of its light, and `recovered`, the
same for every seed. Over one depth quality is told by field, over several by depth.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.report.figure import field_color, new_figure, to_png
from tools.tables.lenses.slanted_edge import ACROSS, EdgeContrast
from tools.tables.records import markdown_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel

Entry = dict[str, Any]
MOST_CONTRAST: Final = 1.05
_SHOWN: Final = 4
_VIEWS: Final = ("PSF", "captured", "recovered")


def worst_contrast(entries: Sequence[Entry]) -> tuple[float, float, float]:
    """Return the largest contrast, the largest rise, and the share of curves that only fall."""
    curves = [
        EdgeContrast(
            cycles_per_px=torch.tensor(entry["contrast"]["cycles_per_px"]),
            contrast=torch.tensor(entry["contrast"][across]),
        )
        for entry in entries
        for across in ACROSS
    ]
    return (
        max(float(c.largest.max()) for c in curves),
        max(float(c.rise.max()) for c in curves),
        float(np.mean([float(c.falls.double().mean()) for c in curves])),
    )


def mean_and_spread(entries: Sequence[Entry], what: str) -> tuple[float, float]:
    """Return mean and standard deviation over seeds of `db` or `ssim`."""
    means = [float(np.mean(entry[what])) for entry in entries]
    return float(np.mean(means)), float(np.std(means))


def lens_table(report: Entry) -> str:
    """Return the page as Markdown: quality, where it is reached, what lenses do, contrast."""
    lenses: dict[str, Entry] = report["lenses"]
    parts = [
        f"Recipe {report['recipe']}, front {report['front']}, network {report['network']}, "
        f"{report['steps']} steps, F/{report['f_number']:g}, focused at "
        f"{report['object_mm']:g} mm.",
        _quality(lenses),
        *_places(report, "db", "PSNR, dB", 2),
        *_places(report, "ssim", "SSIM", 3),
        _light(lenses),
        _contrast(lenses),
    ]
    side = report["recovered_px"]
    wide = [name for name, entry in lenses.items() if entry["window_px"] > side]
    if wide and report["front"] == "wiener":
        parts.append(
            f"The Wiener filter sees {side} px: too few for the PSFs of {', '.join(wide)}, which "
            "it mars. Take --front none, or a recipe with larger patches."
        )
    return "\n\n".join(parts) + "\n"


def _quality(lenses: Mapping[str, Entry]) -> str:
    rows = []
    for name, entry in lenses.items():
        db, ssim = (mean_and_spread(entry["recovered"], what) for what in ("db", "ssim"))
        front = f"{np.mean(entry['front']['db']):.2f}" if "front" in entry else "-"
        captured = (
            f"{np.mean(entry['capture']['db']):.2f}",
            f"{np.mean(entry['capture']['ssim']):.3f}",
        )
        recovered = f"{db[0]:.2f} ± {db[1]:.2f}", f"{ssim[0]:.3f} ± {ssim[1]:.3f}"
        rows.append([name, *captured, front, *recovered])
    head = ["lens", "captured, dB", "SSIM", "front alone, dB", "recovered, dB", "SSIM"]
    return markdown_table(head, rows)


def _names_of_places(report: Entry) -> list[str]:
    if len(report["depths_mm"]) > 1:
        return [f"{depth:g} mm" for depth in report["depths_mm"]]
    return [f"{angle:.3g}°" for angle in report["field_angles_deg"]]


def _places(report: Entry, what: str, title: str, digits: int) -> list[str]:
    deep = len(report["depths_mm"]) > 1
    rows = []
    for name, entry in report["lenses"].items():
        found = [np.mean(e[what], axis=1 if deep else 0) for e in entry["recovered"]]
        mean = np.mean(found, axis=0)
        spread = [np.ptp(mean)] if deep else []
        rows.append([name, *(f"{value:.{digits}f}" for value in (*mean, *spread))])
    head = ["lens", *_names_of_places(report), *(["spread"] if deep else [])]
    return [f"Recovered, {title}:", markdown_table(head, rows)]


def _light(lenses: Mapping[str, Entry]) -> str:
    rows = [
        [
            name,
            str(entry["window_px"]),
            f"{np.min(entry['held']):.0%}",
            f"{np.min(entry['arriving']):.0%}",
            f"{np.max(entry['rms_um']):.0f}",
        ]
        for name, entry in lenses.items()
    ]
    head = ["lens", "window, px", "least light in it", "least rays that arrive", "widest RMS, µm"]
    return markdown_table(head, rows)


def _contrast(lenses: Mapping[str, Entry]) -> str:
    rows = []
    for name, entry in lenses.items():
        for view, entries in (("captured", [entry]), ("recovered", entry["recovered"])):
            largest, rise, falls = worst_contrast(entries)
            verdict = "yes" if largest <= MOST_CONTRAST else "no"
            rows.append([name, view, f"{largest:.3f}", verdict, f"{rise:.3f}", f"{falls:.0%}"])
    bound = f"at most {MOST_CONTRAST}"
    return markdown_table(
        ["lens", "contrast", "largest", bound, "largest rise", "only falls"], rows
    )


def draw_lens_table(report: Entry, folder: Path) -> bytes:
    """Draw a row a lens as PNG: PSFs, captured and recovered patches, contrast before and after.

    Args:
        report: See the module.
        folder: Of the pictures that it names.
    """
    lenses: dict[str, Entry] = report["lenses"]
    deep, names = len(report["depths_mm"]) > 1, _names_of_places(report)
    chosen = sorted({round(i * (len(names) - 1) / (_SHOWN - 1)) for i in range(_SHOWN)})
    places = [(place, 0) if deep else (0, place) for place in chosen]
    pictures = len(_VIEWS) * len(chosen)
    figure = new_figure(3.0 + 1.3 * pictures, 0.4 + 1.6 * len(lenses))
    ratios = [1] * pictures + [2, 2]
    grid = figure.add_gridspec(len(lenses), pictures + 2, width_ratios=ratios)
    for line, (name, entry) in enumerate(lenses.items()):
        panels = [figure.add_subplot(grid[line, column]) for column in range(pictures + 2)]
        _show(panels[:pictures], np.load(folder / entry["recovered"][0]["pictures"]), places)
        panels[0].set_ylabel(name, fontsize=8)
        _plot(panels[-2], entry["contrast"], places)
        _plot(panels[-1], entry["recovered"][0]["contrast"], places)
        if line == 0:
            titles = [f"{view} {names[place]}" for view in _VIEWS for place in chosen]
            titles += ["contrast, captured", "contrast, recovered"]
            for panel, title in zip(panels, titles, strict=True):
                panel.set_title(title, fontsize=7)
    return to_png(figure)


def _show(
    panels: Sequence["Panel"],
    kept: Mapping[str, NDArray[np.float32]],
    places: Sequence[tuple[int, int]],
) -> None:
    kernels = [np.sqrt(kept["kernels"][place]) for place in places]
    shown = [kernel / kernel.max() for kernel in kernels]
    shown += [kept[s][place].transpose(1, 2, 0) for s in _VIEWS[1:] for place in places]
    for panel, picture in zip(panels, shown, strict=True):
        panel.imshow(np.clip(picture, 0, 1), cmap="gray", interpolation="nearest")
        panel.set_xticks([])
        panel.set_yticks([])


def _plot(panel: "Panel", contrast: Entry, places: Sequence[tuple[int, int]]) -> None:
    for number, place in enumerate(places):
        for across, style in (("tangential", "-"), ("sagittal", ":")):
            curve = np.array(contrast[across])[place]
            panel.plot(contrast["cycles_per_px"], curve, style, color=field_color(number))
    panel.axhline(1, color="#999999", linewidth=0.6)
    panel.set_ylim(0, 1.3)
    panel.tick_params(labelsize=6)
