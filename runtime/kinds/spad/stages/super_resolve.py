"""Photons on the fine grid of a plate: linearly at their level of light, or by a network."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages import SuperResolve
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.kinds.spad.captures.frames import frames_of, is_summed
from camkit.runtime.kinds.spad.captures.known_pulse import growth_of, pulse_of
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture, photons_of
from camkit.runtime.kinds.spad.captures.strips import check_room
from camkit.runtime.kinds.spad.finer.bins import FineBins, finer_bins
from camkit.runtime.kinds.spad.finer.camera import FineCamera, network_planes, white_of
from camkit.runtime.kinds.spad.finer.depth import coarse_sharpener
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.pixels import Pixels, by_pixel
from camkit.runtime.rows import ArrayRows, RowsMadeWhole, RowSource

METHODS: Final = ("net", "linear")
OPTIONS: Final = ("size",)
BYTES_OF_COUNT: Final = 80
"""What a count of the array takes on the fine grid."""
BYTES_OF_TIMED_COUNT: Final = 290
"""The same where times are fitted to it, with all that is made of it."""


def prepare(entry: SuperResolve, job: Job) -> StageWork:
    """Make ready; an array behind a plate is small, and made finer whole."""
    capture, camera = photons_of(job), camera_of(entry, job)

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (photons,) = streams
        count, height, width = photons.shape
        has_times = capture.product == "depth"
        shape = 1 if is_summed(capture) else count, camera.scale * height, camera.scale * width
        plane = job.known_bundle.manifest.all_planes[entry.gives[0]]
        fine = replace(photons, plane=plane, shape=shape, band_iterator=None, owned=True)
        if has_times:
            bins = TimedBins(entry, job, photons)
            return (replace(fine, source=RowsMadeWhole(shape, bins.rows), facts=bins),)
        source = RowsMadeWhole(shape, lambda: _frames(entry, job, photons))
        return (replace(fine, source=source),)

    return StageWork(run=run)


def camera_of(entry: SuperResolve, job: Job) -> FineCamera:
    """Return the array of a bundle behind a stage."""
    return FineCamera(bundle=job.known_bundle, stage=entry, networks=job.setup.networks)


def size_of_network(camera: FineCamera, capture: PhotonCapture) -> str | None:
    """Return the network that makes a capture finer; None for the linear estimate."""
    if capture.settings.finer == "linear" or not camera.sizes:
        return None
    size = capture.settings.size
    return camera.size_of_bins(size) if capture.product == "depth" else camera.size(size)


def given_rows(_entry: SuperResolve, job: Job, streams: Sequence[Stream]) -> RowSource:
    """Return light and noise of the photons of all times, as a network is given them."""
    (photons,) = streams
    frames, dark = _frames_and_dark(photons, photons_of(job))
    light = frames.sum(axis=0)
    return ArrayRows(network_planes(light, white_of(light), dark))


class TimedBins:
    """Bins that are made finer when their first row is asked for (`Stream.facts`).

    Attributes:
        fine_bins: How; None before.
    """

    def __init__(self, entry: SuperResolve, job: Job, photons: Stream) -> None:
        self.fine_bins: FineBins | None = None
        self._entry, self._job, self._photons = entry, job, photons

    def rows(self) -> FloatArray:
        """Return them, (bins, m h, m w)."""
        capture, photons = photons_of(self._job), self._photons
        bins, height, width = photons.shape
        check_room((height, width), bins, BYTES_OF_TIMED_COUNT, capture.settings.max_mem_bytes)
        pulse = pulse_of(self._job, self._entry.takes[0])
        coarse = coarse_sharpener(capture.an_axis, pulse, capture.settings.way)
        rows = photons.rows()
        counts, pixels = by_pixel(rows.read(0, height)), Pixels.of(photons)
        camera = camera_of(self._entry, self._job)
        self.fine_bins = fine_bins = finer_bins(
            camera,
            coarse,
            counts,
            pixels,
            size=size_of_network(camera, capture),
            always=capture.settings.finer == "net",
            growth=growth_of(coarse, capture, counts, pixels.worst),
        )
        return fine_bins.fine


def _frames(entry: SuperResolve, job: Job, photons: Stream) -> FloatArray:
    """Return pictures, (n, m h, m w)."""
    capture, camera = photons_of(job), camera_of(entry, job)
    frames, dark = _frames_and_dark(photons, capture)
    shape, cap = (frames.shape[1], frames.shape[2]), capture.settings.max_mem_bytes
    check_room(shape, len(frames), BYTES_OF_COUNT, cap)
    return finer_frames(
        camera,
        frames,
        dark,
        size_of_network(camera, capture),
        progress=lambda finished, total: job.log.meter.reach(entry.gives[0], finished / total),
        cancel=job.cancel,
    )


def _frames_and_dark(
    photons: Stream, capture: PhotonCapture
) -> tuple[FloatArray, NDArray[np.float64]]:
    """Return photons (n, h, w) without dark counts, and how many those of a frame were, (h, w)."""
    of_frame = capture.bins if is_summed(capture) else 1
    return frames_of(photons, capture), Pixels.of(photons).dark * of_frame
