"""PTU of PicoQuant, T3: images as histograms of every pixel, other measurements as one pixel."""

import logging
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.errors import CamkitError, ContractError, DecodeError, UnsupportedError
from camkit.runtime.kinds.spad.containers.broken import BROKEN
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.channels import chosen_places
from camkit.runtime.kinds.spad.files.counts_file import ARRIVALS, EXTRA, CountsFile, Hints

RECORD_BYTES: Final = 4
COUNT_BYTES: Final = 4
MARKERS: Final = ("ImgHdr_LineStart", "ImgHdr_LineStop", "ImgHdr_Frame")
MOST_MARKER: Final = 32
"""Far above the four that a device has; ptufile takes two to this power, however large it is."""
TIMES: Final = 2
"""Of max_bytes: such files are read whole."""
logging.getLogger("ptufile").addHandler(logging.NullHandler())


def open_ptu(path: Path, hints: Hints) -> CountsFile:
    """Open a PTU file; see `open_counts`."""
    try:
        import ptufile
    except ImportError as error:
        raise UnsupportedError(f"reading {path.name} needs ptufile: {EXTRA}") from error
    try:
        with warnings.catch_warnings(), ptufile.PtuFile(path) as file:
            warnings.simplefilter("ignore")
            _check_whole(path, file)
            values = _histograms(path, file, hints)
            width_ps = float(file.tcspc_resolution) * 1e12
    except CamkitError:
        raise
    except BROKEN as error:
        raise DecodeError(f"{path.name} is damaged, or no PTU of T3: {error}") from error
    return ArrayFile(
        path,
        values,
        hints,
        kind="histogram",
        usual="yxt",
        stated_times={"time_bin_ps": width_ps},
        assumed=ARRIVALS,
    )


def _check_whole(path: Path, file: Any) -> None:
    room = path.stat().st_size - int(file.record_offset)
    if int(file.number_records) * RECORD_BYTES > room:
        raise DecodeError(
            f"{path.name} is cut off: {file.number_records} photons and markers are announced, "
            f"{max(room, 0) // RECORD_BYTES} are there"
        )
    numbers = {tag: file.tags[tag] for tag in MARKERS if tag in file.tags}
    if wrong := [tag for tag, number in numbers.items() if not 0 <= number <= MOST_MARKER]:
        raise DecodeError(
            f"{path.name} is damaged: {wrong[0]} is the marker {numbers[wrong[0]]}; there are "
            f"0 to {MOST_MARKER}"
        )


def _histograms(path: Path, file: Any, hints: Hints) -> NDArray[Any]:
    """Return (y, x, t) of one channel and, of several frames, of one."""
    if not file.is_t3:
        raise DecodeError(
            f"{path.name} is no T3 measurement: its Measurement_Mode is "
            f"{file.tags['Measurement_Mode']}, expected 3, with times within a cycle"
        )
    active = [int(number) for number in file.active_channels]
    numbers: dict[str, Sequence[int]] = {"channel": active}
    if file.is_image:
        numbers["frame"] = range(int(file.shape[0]))
    place = chosen_places(path, numbers, hints.key, summed="frame")
    bins = _bins(file)
    size = float(np.prod(file.shape[1:-1], dtype=np.float64)) * bins * COUNT_BYTES
    size += int(file.number_records) * RECORD_BYTES
    if size > TIMES * hints.max_bytes:
        raise ContractError(
            f"{path.name}, {file.number_records} photons and markers, takes {size / 1e9:.3g} GB, "
            f"and such files are read whole; raise {option_text('max_mem_bytes')}, or save its "
            "histograms as .h5 or .npz"
        )
    channel = active[place["channel"]] - active[0]
    if not file.is_image:
        histogram = np.asarray(file.decode_histogram(dtype="uint32", dtime=bins))
        return np.asarray(histogram.reshape(-1, histogram.shape[-1])[channel])[None, None]
    options = {"channel": channel, "dtime": bins, "dtype": "uint32"}
    cube = np.asarray(file.decode_image(frame=place["frame"], **options))
    return cube.reshape(cube.shape[1], cube.shape[2], cube.shape[-1])


def _bins(file: Any) -> int:
    """Return the bins of a laser period, empty ones at its end too.

    A period is a whole number of bins but for the rounding of two floats, so it is rounded;
    ptufile cuts off what no photon reached, and rounds down where it is asked for all.
    """
    period = round(float(file.global_resolution) / float(file.tcspc_resolution))
    return max(int(file.number_bins), min(period, int(file.number_bins_max)))
