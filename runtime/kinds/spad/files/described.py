"""Description of a capture and of its own statements, for `camkit info`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from camkit.runtime.capture import MosaicOptions
from camkit.runtime.kinds.spad.files.bundle_name import named_bundle
from camkit.runtime.kinds.spad.files.counts_file import Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts
from camkit.runtime.kinds.spad.timing import Timing, read_timing, timing_beside


def describe(path: Path, _mosaic: MosaicOptions | None = None) -> Mapping[str, Any]:
    """Return what a capture holds, as plain JSON values.

    Args:
        path: The file; a timing file beside it says its axes, if it does not.

    Raises:
        DecodeError: If it is damaged, or holds no counts.
        ContractError: If it holds several variables, or an array whose axes nobody states.
        UnsupportedError: If the library for such files is not installed.
    """
    timing_path = timing_beside(path)
    is_there = timing_path.is_file()
    array = (read_timing(timing_path) if is_there else Timing()).array
    with open_counts(path, Hints(axes=array.axes, key=array.key)) as file:
        return {
            "holds": file.kind,
            "width": file.width,
            "height": file.height,
            "frames" if file.kind == "counts" else "bins": file.bins or None,
            "axes": file.axes or None,
            "stated": {name: _plain(value) for name, value in file.stated_times.items()},
            "usual": dict(file.assumed),
            "timing": timing_path.name if is_there else None,
            "bundle_named": named_bundle(path),
        }


def _plain(value: object) -> object:
    """Return a stated value; of many numbers, such as edges, how many there are and their ends."""
    if not isinstance(value, np.ndarray | np.generic):
        return value
    array = np.asarray(value)
    if array.size <= 1:
        return array.tolist()
    return f"{array.size} values, {array.flat[0]} to {array.flat[-1]}"
