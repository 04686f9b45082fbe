"""The page and the pictures of the comparison of a real lens."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from camkit.arrays import FloatArray
from tools.pictures.captions import write_captioned
from tools.tables.records import markdown_table

if TYPE_CHECKING:
    from tools.comparison.real_lens import Comparison

CREDIT: Final = "Photographs by LinYark/Sdirt (MIT)"
SIDE_PX: Final = 200
PLACES: Final = {"centre": (388, 266), "corner": (568, 312)}
"""(x, y) of the first pixel of a crop."""
FORWARD: Final = ("blur", "setting")
HEADS: Final = ("dB", "centre", "corner")
CAPTIONS: Final = {"untouched": "f/4", "wiener": "filter", "rl": "Richardson-Lucy"}
DIFFERENCE_GAIN: Final = 4.0

COMMAND: Final = (
    "python -m tools.comparison.real_lens --data FOLDER{held_out} -o docs/results/real-lens "
    "--crops CROPS"
)
INTRODUCTION: Final = (
    "A Canon RF 50 mm f/1.8, traced from its patent, predicts a photograph at f/4 from one at f/20 "
    "and restores it. Ranges below are over what distances may count from, which one plane cannot "
    "decide. Guide, with pictures: [real-lens.md](../guides/real-lens.md). Data, by colour "
    "too: [real-lens.json](real-lens.json)."
)
HOW: Final = (
    "Photographs of a poster by LinYark/Sdirt (commit 5fa8ff5, MIT): 768x512 pixels of 46.875 um, "
    "halves of dual pixels averaged, read by their measured curve. Machine: {machine}."
)
FORWARD_TEXT: Final = (
    "PSNR of codes, white at 1, of the predicted f/4 picture. For every blur, each colour's gain "
    "and its fall with r^2 are fitted on half of the blocks and judged on the other half. "
    "{share:.0%} of the frame counts (no clipped sample near, no border). Sizes of Gaussian and "
    "disc are fitted to this picture; of the lens only the defocus is, where the sensor was moved."
)
HELD_OUT_TEXT: Final = (
    "Judged alike, and once; {share:.0%} of the frame counts. Gaussian and disc are fitted to this "
    "picture; defocus and curve of the lens are those of 1.5 m."
)
INVERSE_TEXT: Final = (
    "PSNR of codes against the f/20 picture, judged alike; cameras as `camkit make` leaves them "
    "after its filter."
)


def page_text(record: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return the page of a record.

    Args:
        record: What `tools.comparison.real_lens` found.
        names: Of the shots; the first one was fitted on.
    """
    facts = record["distance"]
    origins = markdown_table(
        ("distances from", "in best focus, dB", "sensor moved, mm", "then, dB"),
        [
            (
                one["distance_from"],
                f"{one['in_focus_db']:.2f}",
                f"{one['defocus_mm']:+.3f} +- {one['defocus_error_mm']:.3f}",
                f"{one['moved_db']:.2f}",
            )
            for one in facts["origins"]
        ],
    )
    machine = record["machine"]
    machine_text = f"{machine['cores']} cores of an {machine['processor']}"
    held_out = " --held-out FOLDER" if len(names) > 1 else ""
    parts = [
        "# A real lens",
        INTRODUCTION,
        "\n".join(_summary(record[name], name) for name in names),
    ]
    for name in names:
        shot, is_fitted = record[name], name == names[0]
        title = name if is_fitted else f"{name}, held back"
        text = FORWARD_TEXT if is_fitted else HELD_OUT_TEXT
        parts += [
            f"## Forward, {title}",
            text.format(share=shot["share"]),
            markdown_table((*FORWARD, *HEADS), map(_forward_row, shot["forward"])),
            f"## Inverse, {title}",
            INVERSE_TEXT,
            markdown_table(("restored by", *HEADS), map(_inverse_row, shot["inverse"])),
        ]
    parts += [
        "## The pair at 1.5 m",
        f"> {facts['sentence']}",
        origins,
        "\n".join(f"- {note}" for note in facts["notes"]),
        "## How",
        "    " + COMMAND.format(held_out=held_out),
        HOW.format(machine=machine_text),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _summary(shot: Mapping[str, Any], name: str) -> str:
    """Return the range of predictions and restorations of a shot as a line of a list."""
    lens = [row for row in shot["forward"] if row["blur"].startswith("lens")]
    simple = [row for row in shot["forward"] if row not in lens]
    best = max(simple, key=_psnr)
    restored = [row for row in shot["inverse"] if row["method"].startswith("rl, from")]
    return (
        f"- {name}: the lens predicts to {_range(lens)}, a fitted {best['blur']} to "
        f"{_range([best])}; Richardson-Lucy restores {_range(shot['inverse'][:1])} to "
        f"{_range(restored)}."
    )


def _range(rows: Sequence[Mapping[str, Any]]) -> str:
    ends = dict.fromkeys(f"{end(map(_psnr, rows)):.2f}" for end in (min, max))
    return " - ".join(ends) + " dB"


def _psnr(row: Mapping[str, Any]) -> float:
    return float(row["psnr_db"])


def _numbers(row: Mapping[str, Any]) -> list[str]:
    values = [row["psnr_db"], row["centre_db"], row["corner_db"]]
    return ["-" if value is None else f"{value:.2f}" for value in values]


def _forward_row(row: Mapping[str, Any]) -> list[str]:
    return [row["blur"], row["setting"], *_numbers(row)]


def _inverse_row(row: Mapping[str, Any]) -> list[str]:
    return [row["method"], *_numbers(row)]


def write_crops(
    folder: Path, comparison: "Comparison", pictures: Mapping[str, FloatArray]
) -> list[Path]:
    """Write crops at 100 %: the blur predicted, and the picture restored.

    Args:
        folder: Of the pictures.
        comparison: The shot.
        pictures: Method -> (3, h, w) light.
    """
    pair = comparison.scene.judges[comparison.tone.name].pair
    wide, sharp = pair.codes_of(pair.wide), pair.codes_of(pair.sharp)
    predicted = pair.codes_of(comparison.predicted())
    difference = 0.5 + DIFFERENCE_GAIN * (predicted - wide)
    forward = {
        "f/20": sharp,
        "f/20, blurred by the lens": predicted,
        "f/4": wide,
        f"difference x {DIFFERENCE_GAIN:g}": difference,
    }
    inverse = {
        caption: pair.codes_of(comparison.scaled(_first(pictures, method)))
        for method, caption in CAPTIONS.items()
    }
    inverse["f/20"] = sharp
    folder.mkdir(parents=True, exist_ok=True)
    number = comparison.shot.name.split()[0]
    paths = []
    for kind, columns in (("forward", forward), ("inverse", inverse)):
        rows = {
            place: {caption: _crop(picture, corner) for caption, picture in columns.items()}
            for place, corner in PLACES.items()
        }
        paths.append(folder / f"real-lens-{number}-{kind}.jpg")
        heading = f"Canon RF 50 mm at {comparison.shot.name}. {CREDIT}."
        write_captioned(paths[-1], heading, rows)
    return paths


def _first(pictures: Mapping[str, FloatArray], method: str) -> FloatArray:
    """Return the picture by a method and the lens as it was found."""
    return next(picture for name, picture in pictures.items() if name.split(",")[0] == method)


def _crop(picture: FloatArray, corner: tuple[int, int]) -> FloatArray:
    x, y = corner
    return np.ascontiguousarray(picture[:, y : y + SIDE_PX, x : x + SIDE_PX])
