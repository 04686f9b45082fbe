"""A capture of single photons: its counts, and all that is known of their times.

file, options, bundle -> PhotonCapture -> counts (t, rows, w)
"""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.manifest import Manifest
from camkit.bundle.plane import Plane
from camkit.bundle.stages import SuperResolve
from camkit.caller import option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.job.job import Job
from camkit.runtime.kinds.spad.captures.bundle_times import (
    check_bins,
    notes_of_bundle,
    with_bundle,
)
from camkit.runtime.kinds.spad.captures.settings import Product, Settings
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.counts_file import CountsFile, Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts
from camkit.runtime.kinds.spad.finer.camera import size_of
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.runtime.kinds.spad.timing import Timing
from camkit.runtime.options import Options
from camkit.runtime.rows import Rows, RowSource

LONG: Final = 1.5
"""Times the other axes: a last axis so long may be time."""
POOLED: Final = (
    "{option}: a square is taken as one distance; on slanted surfaces sigma is too small"
)
IN_MEMORY: Final = Path("the array")


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotonCapture:
    """A capture before its rows are read.

    Attributes:
        file: Open.
        product: What is to be made.
        timing: What is known of times, from the caller, the capture and its bundle.
        axis: Of its times; None for counts.
        settings: What the caller chose.
        notes: What the user should know of how the capture was understood.
    """

    file: CountsFile
    product: Product
    timing: Timing
    axis: TimeAxis | None
    settings: Settings
    notes: tuple[str, ...] = ()

    channels: ClassVar[int] = 1
    gives_own_rows: ClassVar[bool] = True
    resident_bytes: ClassVar[int] = 0
    """Those of rows on their way are counted by what works through them."""
    decoder_peak_mb: ClassVar[float] = 0.0
    sha256: ClassVar[str | None] = None

    @property
    def height(self) -> int:
        """Return the number of rows."""
        return self.file.height

    @property
    def width(self) -> int:
        """Return the number of columns."""
        return self.file.width

    @property
    def shape(self) -> tuple[int, int]:
        """Return (h, w)."""
        return self.file.height, self.file.width

    @property
    def bins(self) -> int:
        """Return how many time bins, or frames, a pixel has."""
        return self.file.bins if self.axis is None else self.axis.bins

    @property
    def an_axis(self) -> TimeAxis:
        """Return the axis.

        Raises:
            ContractError: If the capture has no times.
        """
        if self.axis is None:
            raise ContractError(
                f"{self.file.path.name} holds no times of photons: {self.file.bins} frames of "
                "counts alone"
            )
        return self.axis

    def plane(self, sensor_plane: Plane | None) -> Plane:
        """Return what the counts are; those of any array run over time."""
        counts_plane = Plane(axes="t y x", type="uint32", channels=("photons",), domain="counts")
        return counts_plane if sensor_plane is None else sensor_plane

    def rows(self) -> RowSource:
        """Return the counts as the file holds them, time first."""
        return _Rows(self)

    def gives(self, plane: Plane) -> bool:
        """Return whether a plane can be a product of what is to be made."""
        return plane.domain == DOMAINS.get(self.product, "counts")

    def shares_memory(self, array: NDArray[Any]) -> bool:
        """Return whether an array may lie where the counts do."""
        return self.file.shares_memory(array)

    def late_notes(self) -> tuple[str, ...]:
        """Return what the user should know besides once its rows were read."""
        outside = self.file.outside
        if not outside:
            return ()
        return (f"{outside} time stamps lie outside the bins of [timing] and were left out",)

    def close(self) -> None:
        """Release the file."""
        self.file.close()


DOMAINS: Final[Mapping[Product, str]] = {"depth": "depth", "lifetime": "lifetime"}
"""Of the planes of products; those of the others are counts."""


class _Rows:
    """The counts of a file as rows; each reading is the reader's own."""

    def __init__(self, capture: PhotonCapture) -> None:
        self._capture = capture
        self._edges: NDArray[np.float64] | None = None
        if capture.axis is not None and capture.file.kind == "stamps":
            self._edges = capture.axis.edges_ps / (capture.timing.array.stamp_ps or 1.0)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (t, h, w)."""
        return self._capture.bins, *self._capture.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom: a view of (rows, w, t) float32."""
        return self._capture.file.rows(top, bottom, self._edges).transpose(2, 0, 1)


def photons_of(job: Job) -> PhotonCapture:
    """Return the capture of a job, which is one of single photons.

    Raises:
        ContractError: If it is none.
    """
    capture = job.capture
    if not isinstance(capture, PhotonCapture):
        raise ContractError(f"this stage takes photons; the capture is a {type(capture).__name__}")
    return capture


def read_photons(
    file: Path, _mosaic: MosaicOptions | None, manifest: Manifest | None, options: Options
) -> PhotonCapture:
    """Open a capture and say what it is.

    Raises:
        DecodeError: If it cannot be read.
        ContractError: If capture, bundle and options do not fit each other.
    """
    settings = Settings.of(options, file)
    _check_finer(settings, manifest)
    array = settings.timing.array
    hints = Hints(axes=array.axes, key=array.key, max_bytes=settings.max_mem_bytes // 4)
    with ExitStack() as stack:
        counts = stack.enter_context(open_counts(file, hints))
        capture = _understood(counts, settings, manifest)
        stack.pop_all()
        return capture


def photons_of_array(
    image: NDArray[Any], manifest: Manifest, *, options: Options | None = None, **_: object
) -> PhotonCapture:
    """Return counts (h, w) or a histogram (t, h, w) as a capture of a bundle's array.

    Raises:
        DecodeError: If they are no counts.
        ContractError: If they are of another array.
    """
    settings = Settings.of(options or Options(), None)
    _check_finer(settings, manifest)
    return _understood(ArrayFile(IN_MEMORY, image, Hints()), settings, manifest)


def _understood(file: CountsFile, settings: Settings, manifest: Manifest | None) -> PhotonCapture:
    timing = settings.timing.with_stated(file.stated_times)
    product = settings.product_of(is_histogram=file.kind != "counts")
    notes: tuple[str, ...] = ()
    if manifest is not None:
        _check_shape(file, manifest)
        if product != "intensity":
            check_bins(file, timing, manifest)
            notes = notes_of_bundle(file, timing, manifest)
        timing = with_bundle(timing, manifest)
    elif settings.timing.array.axes is None:
        notes = _turned(file)
    if product == "depth" and settings.way.pool not in ("auto", "1"):
        notes += (POOLED.format(option=option_text("pool", settings.way.pool)),)
    timing = timing.with_stated(file.assumed)
    _check_listed(product, manifest)
    return PhotonCapture(
        file=file,
        product=product,
        timing=timing,
        axis=None if file.kind == "counts" else _axis(file, timing),
        settings=settings,
        notes=notes,
    )


def _turned(file: CountsFile) -> tuple[str, ...]:
    """Return a note where the last axis of an array is so long that it may be time."""
    last, others = file.width, max(file.bins, file.height)
    if file.kind != "histogram" or file.axes != "tyx" or last < LONG * others:
        return ()
    return (
        f"{file.path.name} is taken as {file.bins} time bins of {file.width}x{file.height} pixels; "
        f'if its last axis is time, state [array] axes = "yxt" in a file for '
        f"{option_text('timing')}",
    )


def _check_finer(settings: Settings, manifest: Manifest | None) -> None:
    """Refuse what means nothing where pictures become finer, and sizes that are not held.

    Raises:
        ContractError: Names it.
    """
    stages = () if manifest is None else manifest.stages_of(SuperResolve)
    if stages and settings.way.pool not in ("auto", "1"):
        raise ContractError(
            f"{option_text('pool')} puts pixels of an array together; with a bundle the estimate "
            f"of the fine grid does so by itself: leave {option_text('pool')} out"
        )
    if manifest is not None and (settings.size is not None or settings.finer == "net"):
        for stage in stages:
            size_of(manifest, stage.role, settings.size)


def _check_listed(product: Product, manifest: Manifest | None) -> None:
    """Refuse a product that no stage of a bundle gives.

    Raises:
        ContractError: Names those there are.
        UnsupportedError: If it is a lifetime.
    """
    if manifest is None:
        return
    domains = {manifest.all_planes[plane].domain for plane in manifest.products.values()}
    if product == "lifetime" and "lifetime" not in domains:
        raise UnsupportedError(
            f"lifetimes are those of the array's own pixels; use {option_text('bundle', 'none')}"
        )
    if DOMAINS.get(product, "counts") not in domains:
        raise ContractError(
            f"bundle {manifest.name} gives no {product}: its products are "
            f"{', '.join(manifest.products)}; choose another {option_text('product')}, or use "
            f"{option_text('bundle', 'none')}"
        )


def _check_shape(file: CountsFile, manifest: Manifest) -> None:
    """Refuse a capture of another array, and say so if its axes are only in another order.

    Raises:
        ContractError: If it is none of this array.
    """
    extent = manifest.sensor.known_extent
    array_px = extent.height_px, extent.width_px
    if (file.height, file.width) == array_px:
        return
    text = (
        f"the capture has {file.width}x{file.height} pixels, the array of bundle "
        f"{manifest.name} {array_px[1]}x{array_px[0]}; use {option_text('bundle', 'none')}"
    )
    sizes = {"y": file.height, "x": file.width, "t": file.bins}
    shape = [sizes[axis] for axis in file.axes]
    for axes in permutations(file.axes):
        turned = dict(zip(axes, shape, strict=True))
        if (turned["y"], turned["x"]) == array_px:
            raise ContractError(
                f"{text}; or, if its axes are in another order, [array] axes = "
                f'"{"".join(axes)}" in a file for {option_text("timing")}'
            )
    raise ContractError(text)


def _axis(file: CountsFile, timing: Timing) -> TimeAxis:
    if file.kind == "stamps":
        return timing.axis(orientation="histogram")
    return timing.axis(bins=file.bins)
