"""An open capture with its axis and pulse: what every product begins with."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Final

import numpy as np

from camkit.caller import option_text
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.corrected import CorrectedRows
from camkit.runtime.kinds.spad.files.counts_file import CountsFile, Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.guess_pulse import guess_pulse
from camkit.runtime.kinds.spad.products.settings import Product, Settings
from camkit.runtime.kinds.spad.pulse import FWHM_PER_SIGMA, Pulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.runtime.kinds.spad.timing import Timing, timing_beside
from camkit.runtime.maker import Making

SAMPLE_ROWS: Final = 16
"""Rows, evenly spread, in which a pulse is looked for that nobody stated."""
PULSE: Final = frozenset({"width_ps", "rc_ps", "jitter_ps", "fwhm_ps"})
WHAT: Final = {"gate": "a scan with a gate", "histogram": "a histogram of arrivals"}
"""Orientation -> what such a capture is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """A capture before its rows are worked through.

    Attributes:
        file: Open.
        product: What is to be made.
        timing: What is known of times, from the caller and the capture.
        axis: Of its times; None for counts.
        rows: Its rows, pile-up undone.
        settings: What the caller chose.
        camera: The array of a bundle, whose products lie on its fine grid; None without one.
        notes: What the user should know of how the capture was understood.
    """

    file: CountsFile
    product: Product
    timing: Timing
    axis: TimeAxis | None
    rows: CorrectedRows
    settings: Settings
    camera: FineCamera | None = None
    notes: tuple[str, ...] = ()

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
            raise ContractError(f"{self.file.path.name} holds no times of photons")
        return self.axis

    @property
    def size_of_pictures(self) -> str | None:
        """Return the network that makes pictures finer; None for the linear estimate."""
        if self.camera is None or self.settings.finer == "linear" or not self.camera.sizes:
            return None
        asked = self.settings.size
        if self.product == "depth":
            return self.camera.size_of_bins(asked)
        return self.camera.size(asked)

    def pulse(self) -> tuple[Pulse, str | None]:
        """Return the pulse, and what the user should know if nobody stated it.

        Raises:
            ContractError: If none is stated and too few photons show one.
        """
        stated = self.timing.pulse()
        if stated is not None:
            return stated, None
        guessed = guess_pulse(self._sample(), self.an_axis)
        told = (
            f"no pulse is stated: a Gaussian of {FWHM_PER_SIGMA * guessed.sigma_ps:.3g} ps full "
            "width is estimated; state [laser] fwhm_ps, [gate] or [irf] if you know it"
        )
        return guessed, told

    def warnings(self) -> tuple[str, ...]:
        """Return what the user should know of the capture itself, once its rows were read."""
        outside = self.file.outside
        if not outside:
            return self.notes
        told = f"{outside} time stamps lie outside the bins of [timing] and were left out"
        return (*self.notes, told)

    def _sample(self) -> FloatArray:
        height = self.file.height
        rows = np.unique(np.linspace(0, height - 1, min(height, SAMPLE_ROWS)).astype(int))
        found = [self.rows.rows(int(row), int(row) + 1).counts for row in rows]
        return np.concatenate(found).reshape(-1, self.bins)


@contextmanager
def surveyed(making: Making) -> Iterator[Survey]:
    """Open a capture and determine its kind.

    Raises:
        DecodeError: If it cannot be read.
        ContractError: If capture and options do not fit each other.
        BundleError: If the bundle makes no picture of photons finer.
    """
    settings = Settings.of(making.options, Path(making.path))
    camera = None if making.bundle is None else FineCamera.of(making.bundle, making.threads)
    _check_finer(settings, camera)
    array = settings.timing.array
    hints = Hints(axes=array.axes, key=array.key, max_bytes=settings.max_mem_bytes // 4)
    with open_counts(Path(making.path), hints) as file:
        timing = settings.timing.with_stated(file.stated)
        notes: tuple[str, ...] = ()
        if camera is not None:
            _check_shape(file, camera)
            notes = _surprise(file, timing, camera)
            timing = _with_bundle(timing, camera)
        timing = timing.with_stated(file.assumed)
        product = settings.product_of(is_histogram=file.kind != "counts")
        axis = None if file.kind == "counts" else _axis(file, timing)
        yield Survey(
            file=file,
            product=product,
            timing=timing,
            axis=axis,
            rows=CorrectedRows(
                file,
                axis,
                cycles=timing.timing.cycles,
                stamp_ps=timing.array.stamp_ps or 1.0,
            ),
            settings=settings,
            camera=camera,
            notes=() if product == "intensity" else notes,
        )


def _check_finer(settings: Settings, camera: FineCamera | None) -> None:
    """Refuse what means nothing with a bundle, or without one.

    Raises:
        ContractError: Names it.
    """
    if camera is None and settings.finer is not None:
        raise ContractError(
            f"{option_text('method', settings.finer)} makes pictures finer behind the plate of a "
            f"bundle; add {option_text('bundle')} too"
        )
    if camera is not None and settings.way.pool not in ("auto", "1"):
        raise ContractError(
            f"{option_text('pool')} puts pixels of an array together; with a bundle the estimate "
            f"of the fine grid does so by itself: leave {option_text('pool')} out"
        )
    if camera is not None and (settings.size is not None or settings.finer == "net"):
        camera.size(settings.size)


def _check_shape(file: CountsFile, camera: FineCamera) -> None:
    """Refuse a capture of another array, and say so if its axes are only in another order.

    Raises:
        ContractError: If it is none of this array.
    """
    try:
        camera.check_shape((file.height, file.width))
    except ContractError as error:
        sizes = {"y": file.height, "x": file.width, "t": file.bins}
        shape = [sizes[axis] for axis in file.axes]
        for axes in permutations(file.axes):
            turned = dict(zip(axes, shape, strict=True))
            if (turned["y"], turned["x"]) == (camera.sensor.height_px, camera.sensor.width_px):
                raise ContractError(
                    f"{error}; or, if its axes are in another order, [array] axes = "
                    f'"{"".join(axes)}" in a file for {option_text("timing")}'
                ) from error
        raise


def _with_bundle(timing: Timing, camera: FineCamera) -> Timing:
    """Return what is known of times, with what the bundle says where nobody else does."""
    stated = {"pitch_um": camera.sensor.pixel_pitch_um, **camera.stated_times()}
    # a measured pulse stands for gate and laser together
    unwanted = PULSE if timing.irf.file is not None else frozenset()
    return timing.with_stated({n: value for n, value in stated.items() if n not in unwanted})


def _surprise(file: CountsFile, timing: Timing, camera: FineCamera) -> tuple[str, ...]:
    """Return a note if a bundle makes something else of a capture than is usual of such files."""
    usual, own = file.assumed.get("orientation"), camera.stated_times().get("orientation")
    if timing.timing.orientation is not None or None in (usual, own) or usual == own:
        return ()
    return (
        f"{file.path.name} is taken as {WHAT[str(own)]}, as bundle {camera.bundle.manifest.name} "
        f"states, though such files usually hold {WHAT[str(usual)]}; state [timing] orientation in "
        f"a file for {option_text('timing')}, or in {timing_beside(file.path).name} beside it",
    )


def _axis(file: CountsFile, timing: Timing) -> TimeAxis:
    if file.kind == "stamps":
        return timing.axis(orientation="histogram")
    return timing.axis(bins=file.bins)
