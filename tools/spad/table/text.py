"""The record as tables in Markdown: one for every level of light, then the gains."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from tools.spad.table.record import NOISE_FREE

TITLES: Final = {"set5": "Set5", "set14": "Set14", "bsd100_half_a": "BSD100, half a"}
Record = Mapping[str, Any]


def tables_text(record: Record) -> str:
    """Return all tables."""
    levels = [_table(record, level) for level in record["photons"]]
    gains = [_gains(record)] if record["gains"] else []
    return "\n\n".join([*levels, *gains, "\n".join(_remarks(record))]) + "\n"


def _table(record: Record, level: str) -> str:
    sets = list(record["pictures"])
    is_thesis = level == NOISE_FREE
    heads = ["row", *(TITLES.get(name, name) for name in sets)]
    heads += [f"thesis: {TITLES.get(name, name)}" for name in sets] if is_thesis else []
    heads += ["kMAC/px"] if is_thesis else []
    title = "no noise" if is_thesis else f"{level} photons of white"
    lines = [f"**{title}** (PSNR in dB / SSIM)", "", _line(heads), "|---" * len(heads) + "|"]
    for row in record["rows"].values():
        cells = [row["label"], *(_score(row["scores"][level][name]) for name in sets)]
        if is_thesis:
            cells += [_printed(row["thesis"], name) for name in sets]
            mac = row["mac_per_px"]
            cells.append("" if mac is None else f"{mac / 1000:.4g}")
        lines.append(_line(cells))
    return "\n".join(lines)


def _gains(record: Record) -> str:
    sets = list(record["pictures"])
    heads = ["gain, dB", "photons", *(TITLES.get(name, name) for name in sets)]
    lines = [_line(heads), "|---" * len(heads) + "|"]
    for name, levels in record["gains"].items():
        for level, found in levels.items():
            lines.append(_line([name, level, *(_gain(found[s]) for s in sets)]))
    return "\n".join(lines)


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _score(found: Record) -> str:
    psnr, ssim = found["psnr_db"], found["ssim"]
    spread = "" if psnr["spread"] is None else f" +- {psnr['spread']:.2f}"
    return f"{psnr['mean']:.2f}{spread} / {ssim['mean']:.4f}"


def _gain(found: Record) -> str:
    spread = "" if found["spread"] is None else f" +- {found['spread']:.2f}"
    error = found["se_of_pictures"]
    pictures = "" if error is None else f" ({error:.2f})"
    return f"{found['db']:+.2f}{spread}{pictures}"


def _printed(thesis: Record | None, name: str) -> str:
    if thesis is None or name not in thesis:
        return ""
    found_db, ssim = thesis[name]
    return f"{found_db:.2f} / {ssim:.4f}"


def _remarks(record: Record) -> Iterator[str]:
    yield (
        "+- is the standard deviation over seeds of training, in brackets the standard error of a "
        "gain over pictures. The thesis's figures are as printed, of all of BSD100; its SRCNN and "
        "VDSR stand behind nothing, and all its other rows are D-DBPN."
    )
    for key, seeds in record["seeds_left_out"].items():
        yield f"- {key}: seeds {', '.join(map(str, seeds))} are not trained yet"
    for key, reason in record["rows_left_out"].items():
        yield f"- {key} is left out: {reason}"
    for name, reason in record["sets_left_out"].items():
        yield f"- {name} is left out: {reason}"
