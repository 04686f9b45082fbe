"""Pictures of counts: one, or the frames of a high-speed capture; all photons of histograms."""

import time

from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.photons import frames_of, full_pixels, made_finer, sum_of
from camkit.runtime.kinds.spad.products.picture import write_exr, write_tiff
from camkit.runtime.kinds.spad.products.preview import grey_picture, white_of, write_preview
from camkit.runtime.kinds.spad.products.record import told_finer
from camkit.runtime.kinds.spad.products.survey import Survey
from camkit.runtime.kinds.spad.products.video import write_video
from camkit.runtime.maker import Made, Making, Write


def make_intensity(making: Making, survey: Survey, began: float) -> Made:
    """Return the photons of every pixel; arguments and errors as of `make_depth`.

    A capture of several frames of counts gives them all.
    """
    is_film = survey.axis is None and survey.bins > 1
    frames = frames_of(making, survey) if survey.axis is None else sum_of(making, survey)
    read_s = time.perf_counter() - began
    frames = made_finer(making, survey, frames)
    finer_s = time.perf_counter() - began - read_s
    white = max(white_of(frame) for frame in frames)
    # one picture of a film: all its photons
    shown = frames.mean(axis=0) if is_film else frames[0]
    arrays = {"frames": frames} if is_film else {"intensity": frames[0]}
    writers: dict[str, Write] = {
        ".npz": lambda path: write_archive(path, arrays),
        ".png": lambda path: write_preview(path, grey_picture(shown, white_of(shown))),
    }
    if is_film:
        writers[".mp4"] = lambda path: write_video(path, frames, white)
    return Made(
        arrays=arrays,
        writers=writers,
        pictures={
            "exr": (".exr", lambda path: write_exr(path, frames, "Y")),
            "tiff": (".tif", lambda path: write_tiff(path, frames)),
        },
        record={"product": "intensity", "frames": len(frames), **told_finer(survey)},
        seconds={"read": read_s} | ({} if survey.camera is None else {"finer": finer_s}),
        warnings=(*full_pixels(survey), *survey.warnings()),
        sections={"spad": {"photons": float(frames.sum(dtype="float64").round(1))}},
    )
