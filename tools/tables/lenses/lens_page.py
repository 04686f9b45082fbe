"""Lenses compared after recovery: the tables.

A report is what `lens_table` measures: settings, and for every lens `capture` (and `front`)
with `db` and `ssim` (depth, field), what became of its light, and `recovered`, the same for every
seed. Over one depth quality is told by field, over several by depth.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from tools.tables.journal import Entry
from tools.tables.lenses.depth_likeness import CYCLES_PER_MM
from tools.tables.records import markdown_table


def mean_and_spread(entries: Sequence[Entry], what: str) -> tuple[float, float]:
    """Return mean and standard deviation over seeds of `db` or `ssim`."""
    means = [float(np.mean(entry[what])) for entry in entries]
    return float(np.mean(means)), float(np.std(means))


def lens_table(report: Entry) -> str:
    """Return the page as Markdown: quality, where it is reached, what lenses do."""
    lenses: dict[str, Entry] = report["lenses"]
    trained = any(entry["recovered"] for entry in lenses.values())
    network = f"network {report['network']}, {report['steps']} steps" if trained else "no network"
    parts = [
        f"Recipe {report['recipe']}, front {report['front']}, {network}, F/{report['f_number']:g}, "
        f"focused at {report['object_mm']:g} mm.",
        _quality(lenses),
    ]
    if trained:
        parts += _places(report, _recovered, "db", "Recovered, PSNR, dB", 2)
        parts += _places(report, _recovered, "ssim", "Recovered, SSIM", 3)
    elif report["front"] != "none":
        parts += _places(report, _front, "db", "Front alone, PSNR, dB", 2)
    if len(report["depths_mm"]) > 1 and all("mtf" in entry for entry in lenses.values()):
        parts.append(_depth_likeness(report))
    if all("axial_colour_um" in entry for entry in lenses.values()):
        parts.append(_axial_colour(lenses))
    parts.append(_light(lenses))
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
        front = f"{np.mean(entry['front']['db']):.2f}" if "front" in entry else "-"
        captured = (
            f"{np.mean(entry['capture']['db']):.2f}",
            f"{np.mean(entry['capture']['ssim']):.3f}",
        )
        recovered = "-", "-"
        if entry["recovered"]:
            db, ssim = (mean_and_spread(entry["recovered"], what) for what in ("db", "ssim"))
            recovered = f"{db[0]:.2f} ± {db[1]:.2f}", f"{ssim[0]:.3f} ± {ssim[1]:.3f}"
        rows.append([name, *captured, front, *recovered])
    head = ["lens", "captured, dB", "SSIM", "front alone, dB", "recovered, dB", "SSIM"]
    return markdown_table(head, rows)


def _names_of_places(report: Entry) -> list[str]:
    if len(report["depths_mm"]) > 1:
        return [f"{depth:g} mm" for depth in report["depths_mm"]]
    return [f"{angle:.3g}°" for angle in report["field_angles_deg"]]


def _depth_likeness(report: Entry) -> str:
    rows = []
    for name, entry in report["lenses"].items():
        alike = [f"{value:.2f}" for value in entry["likeness"]]
        mtf = [" / ".join(f"{value:.2f}" for value in of_depth) for of_depth in entry["mtf"]]
        rows.append([name, *alike, *mtf])
    depths = _names_of_places(report)
    cycles = "/".join(f"{value:g}" for value in CYCLES_PER_MM)
    head = ["lens", *(f"likeness {d}" for d in depths), *(f"MTF {cycles} at {d}" for d in depths)]
    return markdown_table(head, rows)


def _axial_colour(lenses: Mapping[str, Entry]) -> str:
    spans = {name: float(np.ptp(entry["axial_colour_um"])) for name, entry in lenses.items()}
    each = ", ".join(f"{name} {span:.0f}" for name, span in spans.items())
    return f"Axial colour, range of the paraxial foci of the recipe's wavelengths, µm: {each}."


def _recovered(entry: Entry) -> list[Entry]:
    seeds: list[Entry] = entry["recovered"]
    return seeds


def _front(entry: Entry) -> list[Entry]:
    return [entry["front"]]


def _places(
    report: Entry, scored: Callable[[Entry], list[Entry]], what: str, title: str, digits: int
) -> list[str]:
    deep = len(report["depths_mm"]) > 1
    rows = []
    for name, entry in report["lenses"].items():
        values = [np.mean(e[what], axis=1 if deep else 0) for e in scored(entry)]
        mean = np.mean(values, axis=0)
        spread = [np.ptp(mean)] if deep else []
        rows.append([name, *(f"{value:.{digits}f}" for value in (*mean, *spread))])
    head = ["lens", *_names_of_places(report), *(["spread"] if deep else [])]
    return [f"{title}:", markdown_table(head, rows)]


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
