"""The page of the front of methods, written from its record."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from tools.tables.records import markdown_table

TITLE: Final = "# Modern methods beside camkit's"
INTRO: Final = (
    "Decibels against CPU-seconds of methods that were trained from scratch for the same "
    "{minutes:g} CPU-minutes on the same samples, and judged on the same captures of `duet`; "
    "those as shipped were trained longer."
)
HOW: Final = (
    "Written by `python -m tools.methods judge`; `python -m tools.methods chart` draws it.",
    (
        "- **Samples** are those of `models_def/recipes/duet.toml`, made once by the maker of "
        "`camkit train`. Networks that know the blur draw blocks with their surroundings and the "
        "kernels of their place."
    ),
    (
        "- **Training**: one thread, without the time of the samples; the recipe's loss for M, "
        "AdamW, a rate that falls with the share of the minutes spent, averaged weights, nothing "
        "chosen by validation. Behind the bank the loss is taken after the bound on light, as in "
        "`camkit train`."
    ),
    (
        "- **S and M** are those of the recipe. XS has half the work of S (2.4 kMAC/px); taught, "
        "it is fitted to M's result as much as to the truth. The U-Net on the capture is M with "
        "three planes."
    ),
    (
        "- **NAFNet** has width 16 and one block a scale (20.3 kMAC/px; the published depth takes "
        "three times as much). It learns on patches and restores whole pictures."
    ),
    (
        "- **Feature Wiener** deconvolves eight learned linear features of every colour with the "
        "kernels of the place, each with its own ratio of noise to signal, and refines them by a "
        "U-Net of the size of S. **HQS** alternates three closed-form steps with three such "
        "U-Nets. **Two stages** are S at half size, one closed-form step, and S again."
    ),
    (
        "- **Captures**: {pictures} pictures, at {places} of the way to the corner, ISO {isos}, "
        "each through one of eight fabricated lenses, traced afresh; methods know the kernels of "
        "the design only. PSNR on sRGB values as in [quality.md](quality.md). Errors are those of "
        "a mean over pictures. The JSON of the same name has the gains by ISO."
    ),
    (
        "- **Classical methods** are tuned on pictures of `valid_open`, at ISO 400 half-way "
        "(deepinv: two numbers for all ISOs, by 3 x 3 tries on one picture). Where these are the "
        "pictures judged on, that favours them."
    ),
    (
        "- **CPU-seconds** a megapixel on one thread, from developed to restored planes with the "
        "bank, without development and colours (the same for all): medians of rounds in which the "
        "rows take turns. Networks run in onnxruntime if they export, else in torch."
    ),
)
"""Text below the table."""
DEVELOPED: Final = (
    "Programs that only develop: whole commands on one thread, a DNG of the camera to a 16-bit "
    "TIFF, medians of rounds in turn. Two picture sizes separate the CPU-seconds of a megapixel "
    "from those of starting. Tone and colours differ by program, so no decibels are compared."
)
"""Text above the table of developers."""
HEADS: Final = (
    "method",
    "PSNR, dB",
    "over S, paired",
    "CPU-s/MP",
    "runs in",
    "steps",
    "parameters",
)
SHARES: Final = ("0", "0.25", "0.5", "0.75", "1")


def to_page(record: Mapping[str, Any]) -> str:
    """Return a record as a page."""
    places = ", ".join(SHARES[position] for position in record["positions"])
    isos = ", ".join(f"{iso:g}" for iso in record["isos"])
    facts = {"minutes": record["minutes"], "pictures": record["pictures"]}
    how = [line.format(**facts, places=places, isos=isos) for line in HOW]
    rows = sorted(record["rows"], key=lambda row: row["cpu_s_per_mp"])
    table = markdown_table(HEADS, [_cells(row) for row in rows])
    left_out = [f"- {name}: {reason}" for name, reason in record["left_out"].items()]
    left_out += [""] if left_out else []
    machine = f"Timed and trained on {record['machine']}."
    intro = f"{INTRO.format(**facts)} {_summary(record['rows'])}"
    developed = [DEVELOPED, "", _developers(record["developers"])]
    measured = ["## How it was measured", "", f"{how[0]} {machine}", "", *how[1:]]
    return "\n".join([TITLE, "", intro, "", table, "", *developed, "", *left_out, *measured, ""])


def _summary(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the best and the lowest row in two sentences."""
    best = max(rows, key=lambda row: row["psnr_db"])
    lowest = min(rows, key=lambda row: row["psnr_db"])
    return (
        f"Best: {best['title']}, {best['psnr_db']:.2f} dB in {best['cpu_s_per_mp']:.2f} CPU-s a "
        f"megapixel. Lowest: {lowest['title']}, {lowest['psnr_db']:.2f} dB."
    )


def _developers(developers: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        [one["title"], one["version"], f"{one['cpu_s_per_mp']:.3f}", f"{one['start_s']:.2f}"]
        for one in developers
    ]
    return markdown_table(["program", "version", "CPU-s/MP", "CPU-s to start"], rows)


def _cells(row: Mapping[str, Any]) -> list[str]:
    training = row["training"] or {}
    against_s = row["over_s"]
    return [
        row["title"],
        f"{row['psnr_db']:.2f}",
        "" if against_s is None else _gain(against_s["all"]),
        f"{row['cpu_s_per_mp']:.2f}",
        row["runs_in"],
        str(training.get("steps", "")),
        str(training.get("parameters", "")),
    ]


def _gain(gain: Mapping[str, float]) -> str:
    error = f" +- {gain['error_db']:.2f}" if "error_db" in gain else ""
    return f"{gain['db']:+.2f}{error}"
