"""The halves of dual pixels: two files of one exposure, whose mean is the ordinary picture.

    shot_l.png  --halves _l,_r -->  shot_r.png, and the mean of both in linear light

Each half sees the scene through its half of the pupil. What is clipped in one half is clipped.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import Capture

Halves = tuple[str, str]
"""The texts by which the paths of a left and a right half differ."""
OF_MEAN: Final = 0.5
"""Variance of the mean of two samples, in that of one."""


def read_halves(text: str) -> Halves:
    """Return the two texts of `--halves LEFT,RIGHT`.

    Raises:
        ContractError: If it is anything else.
    """
    left, _, right = text.partition(",")
    check_halves((left, right))
    return left, right


def check_halves(halves: Halves | None) -> None:
    """Refuse texts that do not tell two files apart; None are sound.

    Raises:
        ContractError: Says what is expected.
    """
    if halves is None:
        return
    left, right = halves
    if not (left and right) or left == right or "," in right:
        raise ContractError(
            f"{option_text('halves')} takes two texts that differ, such as _l,_r for shot_l.png "
            f"and shot_r.png; got {','.join(halves)!r}"
        )


def right_half(file: Path, halves: Halves) -> Path:
    """Return the right half of a left one: its last part of a path that differs, replaced.

    Raises:
        ContractError: If the path is not that of a left half.
    """
    head, is_there, tail = str(file.with_suffix("")).rpartition(halves[0])
    if not is_there:
        raise ContractError(
            f"{file.name} is no left half: {option_text('halves')} states that {halves[0]!r} is "
            "part of its name or folder"
        )
    return Path(f"{head}{halves[1]}{tail}{file.suffix}")


def without_right_halves(files: Sequence[Path], halves: Halves | None) -> list[Path]:
    """Return files without those that are the right half of another one."""
    if halves is None:
        return list(files)
    lefts = [file for file in files if halves[0] in str(file.with_suffix(""))]
    rights = {right_half(file, halves) for file in lefts}
    return [file for file in files if file not in rights]


def mean_of_halves(left: Capture, right: Capture, names: tuple[str, str]) -> Capture:
    """Return the capture that two halves of one exposure are, with what the left one states.

    Args:
        left: The one half.
        right: The other one.
        names: Of their files, for people.

    Raises:
        DecodeError: If they are not of one exposure.
    """
    _check_one_exposure(left, right, names)
    both = left.samples, right.samples
    if np.issubdtype(left.samples.dtype, np.floating):
        samples = (both[0] + both[1]) * np.float32(0.5)
    else:
        total = both[0].astype(np.uint32) + both[1]
        samples = ((total + 1) // 2).astype(left.samples.dtype)
    clipped = left.saturated_rows(0, left.height) | right.saturated_rows(0, left.height)
    if clipped.any():
        samples[clipped] = left.white_level
    noise, rounding = left.noise, left.rounding
    return replace(
        left,
        samples=samples,
        noise=None if noise is None else noise.raised((OF_MEAN,) * len(noise.shot)),
        rounding=None if rounding is None else rounding * np.array([[1], [OF_MEAN]]),
        notes=(*dict.fromkeys((*left.notes, *right.notes)), f"mean of {' and '.join(names)}"),
    )


def _check_one_exposure(left: Capture, right: Capture, names: tuple[str, str]) -> None:
    facts = [
        {
            "size": f"{one.width}x{one.height} px",
            "samples": f"{one.channels} channel(s) of {one.samples.dtype}",
            "pattern": one.cfa,
            "black level": one.black_level.tolist(),
            "white level": one.white_level,
            "ISO": one.iso or one.metadata.iso,
            "exposure time": one.exposure_time_s or one.metadata.exposure_time_s,
            "orientation": one.orientation,
        }
        for one in (left, right)
    ]
    for name, value in facts[0].items():
        if value != facts[1][name]:
            raise DecodeError(
                f"{names[0]} and {names[1]} are no halves of one exposure: their {name} differs, "
                f"{value} and {facts[1][name]}"
            )
