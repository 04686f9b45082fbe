"""Pictures of counts, films of counts, and light in flight: photons by pixel and time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.cancel import cancellable
from camkit.runtime.capture_result import Result, Write
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.job.stream import Stream
from camkit.runtime.kinds.spad.captures.frames import frames_of
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture
from camkit.runtime.kinds.spad.pixels import Pixels
from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.float_pictures import write_exr, write_tiff
from camkit.runtime.kinds.spad.products.preview import (
    grey_picture,
    white_of,
    white_of_flight,
    write_preview,
)
from camkit.runtime.kinds.spad.products.record import told_axis, told_finer, total_photons
from camkit.runtime.kinds.spad.products.video import write_video


def make_intensity(work: Reconstruction, capture: PhotonCapture, product: str) -> Result:
    """Return the photons of every pixel; arguments and errors as of `make_depth`.

    A capture of several frames of counts gives them all.
    """
    frames, warnings = _photons(work, capture, product)
    white = max(white_of(frame) for frame in frames)
    record = {"product": "intensity", "frames": len(frames), **told_finer(work.job)}
    if capture.axis is None and capture.bins > 1:
        # one picture of a film: all its photons
        picture, film, arrays = frames.mean(axis=0), white, {"frames": frames}
    else:
        picture, film, arrays = frames[0], None, {"intensity": frames[0]}
    return _result(work, frames, arrays, picture, film, record, warnings)


def make_transient(work: Reconstruction, capture: PhotonCapture, product: str) -> Result:
    """Return the photons of every pixel and bin; arguments and errors as of `make_depth`."""
    axis = capture.an_axis
    frames, warnings = _photons(work, capture, product)
    arrays: dict[str, NDArray[Any]] = {"transient": frames, "time_ps": axis.centres_ps}
    record = {"product": "transient", **told_axis(axis), **told_finer(work.job)}
    white = white_of_flight(frames)
    return _result(work, frames, arrays, frames.sum(axis=0), white, record, warnings)


def _photons(
    work: Reconstruction, capture: PhotonCapture, product: str
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return photons (n, h, w), and what the user should know of them."""
    stream = work.stream_of(product)
    with cancellable(work.job.cancel):
        frames = _whole(stream, capture)
    work.job.log.meter.finish()
    notes = list[str]()
    if isinstance(stream.facts, Pixels) and (blind := int(stream.facts.blind.sum())):
        notes.append(
            f"pile-up is too strong to correct in {blind} pixels: their photons are a lower bound"
        )
    return frames, (*notes, *work.warnings, *capture.late_notes())


def _whole(stream: Stream, capture: PhotonCapture) -> FloatArray:
    if stream.plane.grid.pitch_ratio == 1:
        return frames_of(stream, capture)
    frames: FloatArray = stream.rows().read(0, stream.shape[1])
    return frames


def _result(
    work: Reconstruction,
    frames: FloatArray,
    arrays: dict[str, NDArray[Any]],
    picture: NDArray[np.floating],
    film_white: float | None,
    record: dict[str, Any],
    warnings: tuple[str, ...],
) -> Result:
    """Return frames with their writers; photons of white of a film, None for no film."""
    writers: dict[str, Write] = {
        ".npz": lambda path: write_archive(path, arrays),
        ".png": lambda path: write_preview(path, grey_picture(picture, white_of(picture))),
    }
    if film_white is not None:
        writers[".mp4"] = lambda path: write_video(path, frames, film_white)
    return Result(
        arrays=arrays,
        writers=writers,
        pictures={
            "exr": (".exr", lambda path: write_exr(path, frames, "Y")),
            "tiff": (".tif", lambda path: write_tiff(path, frames)),
        },
        record=record,
        seconds=work.seconds,
        warnings=warnings,
        sections={"spad": {"photons": total_photons(frames, work.capture.shape)}},
    )
