"""Light in flight: the photons of every time bin as a film."""

import time
from typing import Any

from numpy.typing import NDArray

from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.photons import frames_of, full_pixels, made_finer
from camkit.runtime.kinds.spad.products.picture import write_exr, write_tiff
from camkit.runtime.kinds.spad.products.preview import (
    grey_picture,
    white_of,
    white_of_flight,
    write_preview,
)
from camkit.runtime.kinds.spad.products.record import told_axis, told_finer
from camkit.runtime.kinds.spad.products.survey import Survey
from camkit.runtime.kinds.spad.products.video import write_video
from camkit.runtime.maker import Made, Making


def make_transient(making: Making, survey: Survey, began: float) -> Made:
    """Return the photons of every pixel and bin; arguments and errors as of `make_depth`."""
    axis = survey.an_axis
    frames = frames_of(making, survey)
    read_s = time.perf_counter() - began
    frames = made_finer(making, survey, frames)
    finer_s = time.perf_counter() - began - read_s
    arrays: dict[str, NDArray[Any]] = {"transient": frames, "time_ps": axis.centres_ps}
    white = white_of_flight(frames)
    shown = frames.sum(axis=0)
    return Made(
        arrays=arrays,
        writers={
            ".npz": lambda path: write_archive(path, arrays),
            ".png": lambda path: write_preview(path, grey_picture(shown, white_of(shown))),
            ".mp4": lambda path: write_video(path, frames, white),
        },
        pictures={
            "exr": (".exr", lambda path: write_exr(path, frames, "Y")),
            "tiff": (".tif", lambda path: write_tiff(path, frames)),
        },
        record={"product": "transient", **told_axis(axis), **told_finer(survey)},
        seconds={"read": read_s} | ({} if survey.camera is None else {"finer": finer_s}),
        warnings=(*full_pixels(survey), *survey.warnings()),
        sections={"spad": {"photons": float(frames.sum(dtype="float64").round(1))}},
    )
