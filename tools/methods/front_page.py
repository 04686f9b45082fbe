"""The page of the front of methods, written from its record."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from tools.tables.records import markdown_table

TITLE: Final = "# The front of methods"
HOW: Final = (
    (
        "Modern methods beside camkit's: trained from scratch for the same CPU-minutes on the "
        "same samples, judged on the same captures, timed beside each other. Written by `python "
        "-m tools.methods judge`; `python -m tools.methods chart` draws it."
    ),
    (
        "- **Samples** are those of `models_def/recipes/duet.toml`, made once by the maker of "
        "`camkit train` and kept; every method draws its patches from them (networks that know "
        "the blur draw blocks with their surroundings and the kernels of their place)."
    ),
    (
        "- **Training**: {minutes:g} CPU-minutes each on one thread, without the samples; the "
        "loss that the recipe has for M, AdamW, a rate that falls with the share of the minutes "
        "spent, averaged weights, nothing chosen by validation. Behind the bank the loss is that "
        "of what the bound on light leaves, as in `camkit train`."
    ),
    (
        "- **Methods**: S and M as in the recipe. NAFNet of width 16 with one block a scale (20.3 "
        "kMAC/px; the published depth takes three times as much), behind the bank and on the "
        "capture alone; it learns on patches and sees whole pictures here. The U-Net on the "
        "capture is M with three planes. *Feature Wiener* deconvolves eight learned linear "
        "features of every colour with the kernels of the place, each with its own ratio of noise "
        "to signal, and refines them by a U-Net of the size of S. *HQS* alternates three "
        "closed-form steps with three such U-Nets. *Two stages* are S at half size, one closed- "
        "form step behind it, and S again. XS has half the work of S (2.4 kMAC/px); taught, it is "
        "fitted to what M makes as much as to the truth."
    ),
    (
        "- **Captures**: {pictures} pictures, at {places} of the way to the corner, ISO {isos}, "
        "each through one of eight fabricated copies of the lens, traced afresh; methods know the "
        "kernels of the design only. PSNR on sRGB values as in [quality.md](quality.md). The "
        "parameters of the classical methods are tuned on pictures of `valid_open`, at ISO 400 "
        "they lie half-way (deepinv: two numbers for all ISOs, by 3 x 3 tries on one of them); "
        "where these are the pictures judged on, that is in their favour."
    ),
    (
        "- **CPU-seconds** a megapixel, one thread, from developed to restored planes (the bank "
        "included; development and colours, the same for all, are not): medians of rounds in "
        "which the rows take turns. Networks run in onnxruntime where they export, else in torch, "
        "as the table says."
    ),
    ("- An error is that of a mean over pictures."),
)
"""Text above the table."""
DEVELOPED: Final = (
    "Programs that develop alone, whole commands on one thread, a DNG of the camera to a 16-bit "
    "TIFF, medians of rounds in turn. Two sizes tell the CPU-seconds of a megapixel from those of "
    "starting. Tone and colours are each program's own, so no decibels are compared."
)
"""Text above the table of developers."""
SHARES: Final = ("0", "0.25", "0.5", "0.75", "1")


def to_page(record: Mapping[str, Any]) -> str:
    """Return a record as a page."""
    places = ", ".join(SHARES[position] for position in record["positions"])
    isos = ", ".join(f"{iso:g}" for iso in record["isos"])
    facts = {"minutes": record["minutes"], "pictures": record["pictures"]}
    intro, *how = (line.format(**facts, places=places, isos=isos) for line in HOW)
    heads = [
        *("method", "PSNR, dB", "over S, paired", "CPU-s/MP", "runs in", "steps", "parameters"),
        *(f"over S, ISO {iso:g}" for iso in record["isos"]),
    ]
    rows = sorted(record["rows"], key=lambda row: row["cpu_s_per_mp"])
    table = markdown_table(heads, [_cells(row, record) for row in rows])
    left_out = [f"- {name}: {reason}" for name, reason in record["left_out"].items()]
    machine = f"Timed and trained on {record['machine']}."
    text = [TITLE, "", intro, "", *how, "", machine, "", table, "", DEVELOPED, ""]
    return "\n".join([*text, _developers(record["developers"]), "", *left_out, ""])


def _developers(developers: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        [one["title"], one["version"], f"{one['cpu_s_per_mp']:.3f}", f"{one['start_s']:.2f}"]
        for one in developers
    ]
    return markdown_table(["program", "version", "CPU-s/MP", "CPU-s to start"], rows)


def _cells(row: Mapping[str, Any], record: Mapping[str, Any]) -> list[str]:
    training = row["training"] or {}
    against_s = row["over_s"]
    gains = {} if against_s is None else against_s["by_iso"]
    return [
        row["title"],
        f"{row['psnr_db']:.2f}",
        "" if against_s is None else _gain(against_s["all"]),
        f"{row['cpu_s_per_mp']:.2f}",
        row["runs_in"],
        str(training.get("steps", "")),
        str(training.get("parameters", "")),
        *(_gain(gains[f"{iso:g}"]) if f"{iso:g}" in gains else "" for iso in record["isos"]),
    ]


def _gain(gain: Mapping[str, float]) -> str:
    error = f" +- {gain['error_db']:.2f}" if "error_db" in gain else ""
    return f"{gain['db']:+.2f}{error}"
