"""Tables of the quality measurements: means, gains over the classical methods, Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tools.comparison.measurement import Measurement

CLASSICAL: Final = ("skimage_wiener", "skimage_rl", "admm_tv")
TITLES: Final = {
    "input": "input (developed only)",
    "skimage_wiener": "scikit-image Wiener",
    "skimage_rl": "scikit-image Richardson-Lucy",
    "admm_tv": "ADMM-TV",
    "bank": "our Wiener bank",
    "bank_rl": "our blocks, Richardson-Lucy",
    "bank_admm_tv": "our blocks, ADMM-TV",
    "S": "network S",
    "M": "network M",
    "L": "network L",
}
PSF_TITLES: Final = {
    "fresh": "fabricated lenses, PSF traced afresh",
    "bundle": "the bundle's own PSF",
}
AIMS: Final = {"fresh": 2.0, "bundle": 2.5}
BANK_AIM_DB: Final = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Mean:
    """Means of one method over a group of captures."""

    psnr_db: float
    ssim: float
    count: int

    def to_json(self) -> dict[str, float | int]:
        """Give plain JSON values."""
        return {
            "psnr_db": round(self.psnr_db, 3),
            "ssim": round(self.ssim, 4),
            "n": self.count,
        }


def comparable(measurements: Sequence[Measurement], methods: Sequence[str]) -> list[Measurement]:
    """Keep the captures on which every method of the comparison was measured."""
    seen: dict[tuple[object, ...], set[str]] = {}
    for m in measurements:
        seen.setdefault(m.capture, set()).add(m.method)
    wanted = set(methods)
    return [m for m in measurements if m.method in wanted and wanted <= seen[m.capture]]


def means(
    measurements: Iterable[Measurement], *fields: str
) -> dict[tuple[Any, ...], dict[str, Mean]]:
    """Give (values of the fields) -> method -> means over all captures of the group."""
    groups: dict[tuple[Any, ...], dict[str, list[Measurement]]] = {}
    for m in measurements:
        key = tuple(getattr(m, field) for field in fields)
        groups.setdefault(key, {}).setdefault(m.method, []).append(m)
    return {
        key: {
            method: Mean(
                psnr_db=float(np.mean([m.psnr_db for m in found])),
                ssim=float(np.mean([m.ssim for m in found])),
                count=len(found),
            )
            for method, found in by_method.items()
        }
        for key, by_method in sorted(groups.items())
    }


def gains(by_method: Mapping[str, Mean], network: str = "M") -> dict[str, Any]:
    """Give how far the network lies above the best classical method and every other row, in dB."""
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
    """Give all means and gains as plain JSON values, for each kind of PSF."""
    kept = comparable(measurements, methods)
    summary: dict[str, Any] = {}
    for psf in sorted({m.psf for m in kept}, reverse=True):
        of_psf = [m for m in kept if m.psf == psf]
        overall = means(of_psf)[()]
        by_iso = means(of_psf, "iso")
        summary[psf] = {
            "overall": _plain(overall),
            "by_iso": {f"{iso:g}": _plain(found) for (iso,), found in by_iso.items()},
            "by_set": _nested(means(of_psf, "set_name", "iso")),
            "by_position": _nested(means(of_psf, "position", "iso")),
            "height_mm": _heights(of_psf),
            "gain_of_m": gains(overall),
            "gain_of_m_by_iso": {f"{iso:g}": gains(found) for (iso,), found in by_iso.items()},
        }
    return summary


def seconds_per_megapixel(measurements: Iterable[Measurement]) -> dict[str, float]:
    """Give seconds per megapixel of every method."""
    totals: dict[str, list[float]] = {}
    for m in measurements:
        total = totals.setdefault(m.method, [0.0, 0.0])
        total[0] += m.seconds
        total[1] += m.megapixels
    return {name: round(s / max(mp, 1e-9), 2) for name, (s, mp) in totals.items()}


def to_markdown(report: Mapping[str, Any]) -> str:
    """Write the page: how it was measured, then the tables.

    Args:
        report: The mapping of the JSON file.
    """
    lines = ["# Quality", "", *_protocol_lines(report), ""]
    methods = list(report["methods"])
    for psf, summary in report["summary"].items():
        lines += [f"## Captures through {PSF_TITLES[psf]}", ""]
        lines += _gain_lines(psf, summary, methods)
        lines += _table("", {"all": summary["by_iso"]}, summary["overall"], methods)
        lines += ["### By picture set", ""]
        lines += _groups(summary["by_set"], methods, "set")
        lines += ["### By field position", ""]
        heights = summary["height_mm"]
        places = {f"{p} ({heights[p]:.1f} mm)": v for p, v in summary["by_position"].items()}
        lines += _groups(places, methods, "position (mean distance from the axis)")
    return "\n".join(lines).rstrip() + "\n"


def _plain(found: Mapping[str, Mean]) -> dict[str, Any]:
    return {name: mean.to_json() for name, mean in found.items()}


def _nested(found: Mapping[tuple[Any, ...], Mapping[str, Mean]]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for (group, iso), by_method in found.items():
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
        f"{TITLES.get(peer, peer)}: "
        + " and ".join(
            f"{', '.join(f'{name} {v:g}' for name, v in values.items())} at ISO {iso}"
            for iso, values in by_iso.items()
        )
        for peer, by_iso in report["tuned"]["values"].items()
    )
    return [
        f"Written by {', then '.join(f'`{command}`' for command in report['commands'])} on "
        f"{machine['cpu']} with {machine['cores']} cores; "
        f"every single measurement stands in `{report['json_name']}`.",
        "",
        *(f"- {line}" for line in protocol["text"]),
        f"- Parameters of the classical methods, tuned on `{report['tuned']['data']}`: {tuned}.",
    ]


def _gain_lines(psf: str, summary: Mapping[str, Any], methods: Sequence[str]) -> list[str]:
    gain = summary["gain_of_m"]
    if not gain:
        return []
    rows = []
    if "over_best_classical_db" in gain:
        best = TITLES.get(gain["best_classical"], gain["best_classical"])
        rows.append((f"best classical ({best})", gain["over_best_classical_db"], AIMS[psf]))
    if "bank" in gain["over"]:
        rows.append((TITLES["bank"], gain["over"]["bank"], BANK_AIM_DB))
    rows += [(name, gain["over"][name], 0.0) for name in methods if name not in TITLES]
    lines = ["| M over | gain, dB | aim, dB | reached |", "|---|---|---|---|"]
    lines += [
        f"| {name} | {value:+.2f} | {aim:+.1f} | {'yes' if value >= aim else 'no'} |"
        for name, value, aim in rows
    ]
    return [*lines, ""]


def _table(
    title: str,
    groups: Mapping[str, Mapping[str, Mapping[str, Any]]],
    overall: Mapping[str, Any],
    methods: Sequence[str],
) -> list[str]:
    """Give a table with a line per method and PSNR / SSIM per ISO and over all."""
    (by_iso,) = groups.values()
    isos = list(by_iso)
    count = overall[methods[0]]["n"]
    lines = [title, ""] if title else []
    lines.append("| PSNR in dB / SSIM | " + " | ".join(f"ISO {i}" for i in isos) + " | all |")
    lines.append("|---" * (len(isos) + 2) + "|")
    for name in methods:
        cells = [_cell(by_iso[iso][name]) for iso in isos] + [_cell(overall[name])]
        lines.append(f"| {TITLES.get(name, name)} | " + " | ".join(cells) + " |")
    return [*lines, "", f"Means over {count} captures.", ""]


def _groups(groups: Mapping[str, Any], methods: Sequence[str], what: str) -> list[str]:
    """Give a table per ISO with a column per group."""
    isos = list(next(iter(groups.values())))
    lines = []
    for iso in isos:
        counts = {g: found[iso][methods[0]]["n"] for g, found in groups.items() if iso in found}
        heads = [f"{g}, n = {n}" for g, n in counts.items()]
        lines.append(f"| ISO {iso}, {what} | " + " | ".join(heads) + " |")
        lines.append("|---" * (len(heads) + 1) + "|")
        for name in methods:
            cells = [_cell(groups[g][iso][name]) for g in counts]
            lines.append(f"| {TITLES.get(name, name)} | " + " | ".join(cells) + " |")
        lines.append("")
    return lines


def _cell(mean: Mapping[str, Any]) -> str:
    return f"{mean['psnr_db']:.2f} / {mean['ssim']:.3f}"
