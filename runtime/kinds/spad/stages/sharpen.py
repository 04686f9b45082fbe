"""Times of photons to depth, of the array's own pixels strip by strip, or of a fine grid."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from camkit.bundle.stages import Sharpen
from camkit.runtime.cancel import check_wish
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.kinds.spad.captures.known_pulse import growth_of, pulse_of
from camkit.runtime.kinds.spad.captures.photon_capture import photons_of
from camkit.runtime.kinds.spad.captures.strips import pieces
from camkit.runtime.kinds.spad.finer.bins import FineBins
from camkit.runtime.kinds.spad.finer.depth import fine_sharpener, fitted_bins
from camkit.runtime.kinds.spad.hot_pixels import check_map
from camkit.runtime.kinds.spad.pixels import Pixels, by_pixel
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.sharpen import METHODS as FITS
from camkit.runtime.kinds.spad.sharpen import Sharpened, Sharpener, stacked
from camkit.runtime.kinds.spad.stages.super_resolve import TimedBins
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.rows import Rows

METHODS: Final = FITS
OPTIONS: Final[tuple[str, ...]] = ()
IS_NEEDED: Final = True
PIXEL_BYTES: Final = 150
"""Of all arrays of one return."""


@dataclass(slots=True, kw_only=True)
class Depths:
    """The surfaces of every pixel, complete once all rows of depth are out (`Stream.beside`).

    Attributes:
        pixels: What is known of the array's own pixels.
        strips: Of rows, from top to bottom.
        pulse: By which they were fitted.
        templates: Of its bank.
        bins: How they were made finer; None in the array's own pixels.
    """

    pixels: Pixels
    strips: list[Sharpened] = field(default_factory=list)
    pulse: Pulse | None = None
    templates: int = 0
    bins: FineBins | None = None

    def whole(self) -> Sharpened:
        """Return what was found of all pixels."""
        return stacked(self.strips)


def prepare(entry: Sharpen, job: Job) -> StageWork:
    """Make ready; the bank is made when the first row is asked for."""

    def run(taken: Sequence[Stream]) -> tuple[Stream, ...]:
        (photons,) = taken
        depths = Depths(pixels=Pixels.of(photons))
        own = isinstance(photons.beside, TimedBins)
        bands = _fine(entry, job, photons, depths) if own else _strips(entry, job, photons, depths)
        plane = photons.plane.model_copy(update={"axes": "y x", "domain": "depth"})
        shape = photons_of(job).settings.way.returns, *photons.shape[1:]
        return (replace(photons.with_bands(bands), plane=plane, shape=shape, beside=depths),)

    return StageWork(run=run)


def _depth_of(found: Sharpened, offset_ps: float) -> Rows:
    """Return the depth in metres of every pixel, believed or not, (returns, rows, w)."""
    return (found.time_of_flight_ps - offset_ps) * LIGHT_M_PER_PS / 2


def _strips(entry: Sharpen, job: Job, photons: Stream, depths: Depths) -> Iterator[Rows]:
    """Fit the array's own pixels."""
    capture = photons_of(job)
    way, (bins, height, width) = capture.settings.way, photons.shape
    depths.pulse = pulse_of(job, entry.takes[0])
    sharpener = Sharpener(capture.an_axis, depths.pulse, way)
    depths.templates = len(sharpener.fitter.bank.mu_ps)
    cut = pieces(
        (height, width),
        bins,
        reach=way.reach_px,
        max_mem_bytes=capture.settings.max_mem_bytes,
        held_bytes=PIXEL_BYTES * way.returns * height * width,
    )
    pixels, rows = depths.pixels, photons.rows()
    check_map(pixels.hot)
    for piece in cut:
        check_wish()
        counts = by_pixel(rows.read(piece.first, piece.end))
        near = slice(piece.first, piece.end)
        found = sharpener.strip(
            counts,
            hot=pixels.hot[near],
            blind=pixels.blind[near],
            core=piece.core,
            growth=growth_of(sharpener, capture, counts, pixels.worst[near]),
        )
        depths.strips.append(found)
        yield _depth_of(found, capture.timing.correction.offset_ps)


def _fine(entry: Sharpen, job: Job, photons: Stream, depths: Depths) -> Iterator[Rows]:
    """Fit bins that were made finer."""
    capture, beside = photons_of(job), photons.beside
    assert isinstance(beside, TimedBins)
    rows = photons.rows().read(0, photons.shape[1])
    depths.bins = bins = beside.made
    assert bins is not None  # its rows were read
    depths.pixels = bins.pixels
    depths.pulse = pulse_of(job, entry.takes[0])
    sharpener = fine_sharpener(capture.an_axis, depths.pulse, capture.settings.way)
    depths.templates = len(sharpener.fitter.bank.mu_ps)
    found = fitted_bins(rows if photons.gives_own_rows else rows.copy(), bins, sharpener)
    depths.strips.append(found)
    yield _depth_of(found, capture.timing.correction.offset_ps)
