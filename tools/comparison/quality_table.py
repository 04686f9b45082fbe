"""Tables of the quality measurements: means, gains over the classical methods, Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tools.comparison.measurement import Measurement
from tools.comparison.names import CLASSICAL, EARLIER, title_of
from tools.comparison.paired import best_classical, paired_gains, pairs_of, to_lines
from tools.tables.records import markdown_table

PSF_TITLES: Final = {
    "fresh": "fabricated lenses, PSF traced afresh",
    "bundle": "the bundle's own PSF",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mean:
    """Means of one method over a group of captures."""

    psnr_db: float
    ssim: float
    count: int

    def to_json(self) -> dict[str, float | int]:
        """Return plain JSON values."""
        return {
            "psnr_db": round(self.psnr_db, 3),
            "ssim": round(self.ssim, 4),
            "n": self.count,
        }


def comparable(measurements: Sequence[Measurement], methods: Sequence[str]) -> list[Measurement]:
    """Keep the captures on which every method of the comparison was measured."""
    methods_of: dict[tuple[object, ...], set[str]] = {}
    for m in measurements:
        methods_of.setdefault(m.capture, set()).add(m.method)
    compared = set(methods)
    return [m for m in measurements if m.method in compared and compared <= methods_of[m.capture]]


def means(
    measurements: Iterable[Measurement], *fields: str
) -> dict[tuple[Any, ...], dict[str, Mean]]:
    """Return (values of the fields) -> method -> means over all captures of the group."""
    groups: dict[tuple[Any, ...], dict[str, list[Measurement]]] = {}
    for m in measurements:
        key = tuple(getattr(m, field) for field in fields)
        groups.setdefault(key, {}).setdefault(m.method, []).append(m)
    return {
        key: {
            method: Mean(
                psnr_db=float(np.mean([m.psnr_db for m in group])),
                ssim=float(np.mean([m.ssim for m in group])),
                count=len(group),
            )
            for method, group in by_method.items()
        }
        for key, by_method in sorted(groups.items())
    }


def gains(by_method: Mapping[str, Mean], network: str = "M") -> dict[str, Any]:
    """Return how far the network lies above the best classical method and other rows, in dB."""
    if network not in by_method:
        return {}
    level = by_method[network].psnr_db
    out: dict[str, Any] = {
        "over": {
            name: round(level - mean.psnr_db, 3)
            for name, mean in by_method.items()
            if name != network
        }
    }
    classical = [name for name in CLASSICAL if name in by_method]
    if classical:
        best = max(classical, key=lambda name: by_method[name].psnr_db)
        out["best_classical"] = best
        out["over_best_classical_db"] = round(level - by_method[best].psnr_db, 3)
    return out


def summarise(measurements: Sequence[Measurement], methods: Sequence[str]) -> dict[str, Any]:
    """Return all means and gains as plain JSON values, for each kind of PSF."""
    common = comparable(measurements, methods)
    summary: dict[str, Any] = {}
    for psf in sorted({m.psf for m in common}, reverse=True):
        of_psf = [m for m in common if m.psf == psf]
        overall = means(of_psf)[()]
        by_iso = means(of_psf, "iso")
        by_copy = means((m for m in of_psf if m.seed is not None), "seed")
        summary[psf] = {
            "overall": _plain(overall),
            "by_iso": {f"{iso:g}": _plain(mean_of) for (iso,), mean_of in by_iso.items()},
            "by_set": _nested(means(of_psf, "set_name", "iso")),
            "by_position": _nested(means(of_psf, "position", "iso")),
            "height_mm": _heights(of_psf),
            "by_copy": {str(seed): _plain(mean_of) for (seed,), mean_of in by_copy.items()},
            "gains": paired_gains(of_psf, pairs_of(methods, best_classical(of_psf))),
            "gain_of_m": gains(overall),
            "gain_of_m_by_iso": {f"{iso:g}": gains(mean_of) for (iso,), mean_of in by_iso.items()},
        }
    return summary


def seconds_per_megapixel(measurements: Iterable[Measurement]) -> dict[str, float]:
    """Return seconds per megapixel of every method."""
    totals: dict[str, list[float]] = {}
    for m in measurements:
        total = totals.setdefault(m.method, [0.0, 0.0])
        total[0] += m.seconds
        total[1] += m.megapixels
    return {name: round(s / max(mp, 1e-9), 2) for name, (s, mp) in totals.items()}


def to_markdown(report: Mapping[str, Any]) -> str:
    """Write the page: the best method, the tables, then how it was measured.

    Args:
        report: The mapping of the JSON file.
    """
    lines = [f"# Quality of `{report['bundle']['name']}`", "", _best_line(report), ""]
    methods = list(report["methods"])
    current = [name for name in methods if not name.endswith(EARLIER)]
    for psf, summary in report["summary"].items():
        lines += [f"## Captures through {PSF_TITLES[psf]}", ""]
        lines += _table(summary["by_iso"], summary["overall"], methods)
        lines += to_lines(summary["gains"])
        lines += _copy_lines(summary["by_copy"], report.get("copies", {}), current)
        lines += ["### By picture set", ""]
        lines += _groups(summary["by_set"], current, "set")
        lines += ["### By field position", ""]
        heights = summary["height_mm"]
        places = {f"{p} ({heights[p]:.1f} mm)": v for p, v in summary["by_position"].items()}
        lines += _groups(places, current, "position (mean distance from the axis)")
    return "\n".join([*lines, *_protocol_lines(report)]) + "\n"


def _best_line(report: Mapping[str, Any]) -> str:
    """Return the best method and the input over all captures, as a sentence."""
    overall = next(iter(report["summary"].values()))["overall"]
    best = max(overall, key=lambda name: overall[name]["psnr_db"])
    developed = f"; {title_of('input')}: {_cell(overall['input'])}" if "input" in overall else ""
    return (
        f"Best in PSNR over {overall[best]['n']} captures: {title_of(best)}, {_cell(overall[best])}"
        f"{developed} (PSNR in dB / SSIM). Every measurement is in `{report['json_name']}`."
    )


def _plain(mean_of: Mapping[str, Mean]) -> dict[str, Any]:
    return {name: mean.to_json() for name, mean in mean_of.items()}


def _nested(groups: Mapping[tuple[Any, ...], Mapping[str, Mean]]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for (group, iso), by_method in groups.items():
        nested.setdefault(str(group), {})[f"{iso:g}"] = _plain(by_method)
    return nested


def _heights(measurements: Iterable[Measurement]) -> dict[str, float]:
    heights: dict[str, list[float]] = {}
    for m in measurements:
        heights.setdefault(str(m.position), []).append(m.height_mm)
    return {position: round(float(np.mean(mm)), 2) for position, mm in sorted(heights.items())}


def _protocol_lines(report: Mapping[str, Any]) -> list[str]:
    machine, protocol = report["machine"], report["protocol"]
    tuned = "; ".join(
        f"{title_of(peer)}: "
        + " and ".join(
            f"{', '.join(f'{name} {v:g}' for name, v in values.items())} at ISO {iso}"
            for iso, values in by_iso.items()
        )
        for peer, by_iso in report["tuned"]["values"].items()
    )
    return [
        "## How it was measured",
        "",
        f"Written by {', then '.join(f'`{command}`' for command in report['commands'])} on "
        f"{machine['cpu']} with {machine['cores']} cores.",
        "",
        *(
            f"- An earlier run on {cpu} measured {' and '.join(map(title_of, names))}."
            for cpu, names in report.get("earlier_runs", {}).items()
        ),
        *(f"- {line}" for line in protocol["text"]),
        f"- Parameters of the classical methods, tuned on `{report['tuned']['data']}`: {tuned}.",
    ]


def _table(
    by_iso: Mapping[str, Mapping[str, Any]], overall: Mapping[str, Any], methods: Sequence[str]
) -> list[str]:
    """Return a table with a line per method and PSNR / SSIM per ISO and over all."""
    heads = ["PSNR in dB / SSIM", *(f"ISO {iso}" for iso in by_iso), "all"]
    cells = [
        [title_of(n), *(_cell(scores[n]) for scores in by_iso.values()), _cell(overall[n])]
        for n in methods
    ]
    count = overall[methods[0]]["n"]
    return [markdown_table(heads, cells), "", f"Means over {count} captures.", ""]


def _copy_lines(
    by_copy: Mapping[str, Mapping[str, Any]], errors: Mapping[str, float], methods: Sequence[str]
) -> list[str]:
    """Return a table with a column for each copy of the lens."""
    if not by_copy:
        return []
    heads = [f"{seed}, off by {errors.get(seed, float('nan')):.2f}" for seed in by_copy]
    cells = [[title_of(n), *(_cell(scores[n]) for scores in by_copy.values())] for n in methods]
    table = markdown_table(["seed, relative error of the transfer", *heads], cells)
    return ["### By copy of the lens", "", table, ""]


def _groups(groups: Mapping[str, Any], methods: Sequence[str], what: str) -> list[str]:
    """Return a table per ISO with a column per group."""
    lines = []
    for iso in next(iter(groups.values())):
        scores_at_iso = {name: scores[iso] for name, scores in groups.items() if iso in scores}
        heads = [f"{name}, n = {scores[methods[0]]['n']}" for name, scores in scores_at_iso.items()]
        cells = [
            [title_of(n), *(_cell(scores[n]) for scores in scores_at_iso.values())] for n in methods
        ]
        lines += [markdown_table([f"ISO {iso}, {what}", *heads], cells), ""]
    return lines


def _cell(mean: Mapping[str, Any]) -> str:
    return f"{mean['psnr_db']:.2f} / {mean['ssim']:.3f}"
