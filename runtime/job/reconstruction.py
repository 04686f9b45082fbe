"""One capture on its way to a picture: the stages joined, rows pulled through them, times kept.

    capture -> [repair, white balance, demosaic] -> Wiener bank -> stabilise -> network -> back
            -> divide by relative illumination -> undistort -> camera to output colour

Nothing is computed before the first band is asked for; a `Reconstruction` serves one thread, once.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.manifest import Demosaic, Illumination, Network, Undistort, Wiener
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray, NoiseModel
from camkit.errors import ContractError
from camkit.runtime.bank.baselines import restoration_bank
from camkit.runtime.bank.blocks import BlockBank, LocalPsf, PlainBlock
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.capture import Capture
from camkit.runtime.clock import StageClock, TimedRows
from camkit.runtime.color import ColorStage, recover_highlights, to_output
from camkit.runtime.geometry.illumination import IlluminationGain
from camkit.runtime.geometry.placement import scale_kernels
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.job.preparation import Preparation
from camkit.runtime.job.setup import Setup
from camkit.runtime.network.guard import TileGuard
from camkit.runtime.network.stage import NetworkStage
from camkit.runtime.network.tiling import Cancel, Progress
from camkit.runtime.options import DemosaicMethod
from camkit.runtime.plan.blocks import plain_blocks
from camkit.runtime.plan.decision import Labels
from camkit.runtime.plan.estimate import Estimate
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import RollingRows, RowSource, changed_bands
from camkit.runtime.signal.front_rows import FrontRows
from camkit.runtime.signal.stabilise import NetworkRows, unstabilise

BAND_ROWS: Final = 128
STAGE_ORDER: Final = (
    *("noise", "envelope", "scene", "demosaic", "wiener", "rl", "admm-tv", "stabilise", "network"),
    *("illumination", "undistort", "color"),
)


class Reconstruction:
    """The work on one capture.

    Attributes:
        capture: What is reconstructed.
        prepared: What was decided beforehand.
    """

    def __init__(
        self,
        setup: Setup,
        capture: Capture,
        *,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> None:
        self.capture = capture
        self._setup = setup
        self._progress = progress
        self._cancel = cancel
        self._clock = StageClock()
        self._front: FrontRows | None = None
        self._guard = TileGuard(fallback=setup.options.on_unsafe == "fallback")
        self.prepared = Preparation(setup, capture, self._clock)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Give (3, h, w) of the picture."""
        return 3, self.capture.height, self.capture.width

    @property
    def plan(self) -> dict[str, Any]:
        """Give what was decided, for the sidecar."""
        return self.prepared.record

    @property
    def white_balance(self) -> tuple[float, float, float]:
        """Give the gains in use."""
        return self.prepared.white_balance

    @property
    def color(self) -> ColorStage:
        """Give the way from camera RGB to the colour asked for."""
        return self.prepared.color

    @property
    def size(self) -> str | None:
        """Give the size of network in use; None if none runs."""
        decided = self.prepared.decided
        sizes = () if decided is None else decided.work.sizes()
        return sizes[0] if sizes else None

    @property
    def labels(self) -> Labels | None:
        """Give the tier of every lattice cell; None where all get the network."""
        decided = self.prepared.decided
        return None if decided is None else decided.work.labels

    @property
    def stage(self) -> NetworkStage | None:
        """Give the planned windows of the networks; None if none runs."""
        return self.prepared.network

    def explain(self) -> Estimate | None:
        """Complete the plan by what every decision saves, and give what the work will take.

        Times the machine for a moment when first asked. None without a bundle.
        """
        return self.prepared.explain()

    def measured_speed(self, sizes: Sequence[str]) -> Speed:
        """Give how fast this machine is with the networks of some sizes."""
        return self._setup.speed(sizes)

    @property
    def seconds(self) -> dict[str, float]:
        """Give the seconds per stage so far, in the order of the data."""
        spent = self._clock.seconds
        return {name: spent[name] for name in sorted(spent, key=STAGE_ORDER.index)}

    @property
    def clock(self) -> StageClock:
        """Give the clock of the stages, for profiles."""
        return self._clock

    @property
    def warnings(self) -> tuple[str, ...]:
        """Give what the user should know; complete once the last band is out."""
        found = list(self.prepared.notes)
        if self._front is not None and self._front.repaired:
            found.append(f"{self._front.repaired} dead or invalid pixels were repaired")
        found += [f"the Wiener result was taken in {tile}" for tile in self._guard.replaced]
        return tuple(found)

    @property
    def clipped_fraction(self) -> float:
        """Give the share of clipped samples seen so far."""
        return 0.0 if self._front is None else self._front.clipped_fraction

    def bands(self) -> Iterator[FloatArray]:
        """Yield finished bands (3, rows, w) of the output colour, from top to bottom."""
        bundle = self._setup.bundle
        front = self._front_rows()
        if bundle is None:
            return self._finished_bands(_read_bands(front))
        return self._finished_bands(self._restored_bands(bundle, front))

    def fill_plain(self) -> FloatArray:
        """Give (3, h, w) developed without bank and network, all corrections applied."""
        bands = self._finished_bands(_read_bands(self._front_rows()))
        return np.concatenate(list(bands), axis=1)

    def _finished_bands(self, bands: Iterator[FloatArray]) -> Iterator[FloatArray]:
        """Yield the bands behind the restoration: highlights, corrections, colour.

        Args:
            bands: Each an array that nobody else reads.
        """
        rows = self._undistorted(RollingRows(self.shape, self._evened(bands)).reader())
        _, height, _ = self.shape
        for top in range(0, height, BAND_ROWS):
            band = rows.read(top, min(top + BAND_ROWS, height))
            with self._clock.stage("color"):
                band = to_output(band, self.color)
            yield band

    def fill(self, out: FloatArray | None) -> FloatArray:
        """Collect all bands in one (3, h, w) array.

        Raises:
            ContractError: If `out` has another shape or type.
        """
        if out is None:
            out = np.empty(self.shape, dtype=np.float32)
        if out.shape != self.shape or out.dtype != np.float32:
            raise ContractError(f"out must be float32 {self.shape}; got {out.dtype} {out.shape}")
        top = 0
        for band in self.bands():
            out[:, top : top + band.shape[1]] = band
            top += band.shape[1]
        return out

    def _front_rows(self) -> RowSource:
        self._front = FrontRows(
            self.capture,
            self.white_balance,
            method=self._demosaic_method(),
            repair=self._setup.bundle is not None,
            threads=self._setup.threads,
        )
        return TimedRows(self._front, self._clock, "demosaic")

    def _demosaic_method(self) -> DemosaicMethod:
        chosen, bundle = self._setup.options.demosaic, self._setup.bundle
        stage = None if bundle is None else bundle.manifest.stage(Demosaic)
        return chosen or ("fast" if stage is None else stage.method)

    def network_input(self, scale: float) -> FloatArray:
        """Give what a network is given for the whole capture, (6, h, w), for export and tests.

        Args:
            scale: Of the network stage.

        Raises:
            ContractError: If there is no bundle, or it has no Wiener stage.
        """
        bundle = self._setup.bundle
        bank = None if bundle is None else self._bank(bundle)
        noise = self.prepared.noise
        if bank is None or noise is None:
            raise ContractError("a network stands behind the Wiener bank of a bundle")
        rows = self._network_rows(bank, self._front_rows(), noise, scale)
        return rows.read(0, self.capture.height)

    def _restored_bands(self, bundle: Bundle, front: RowSource) -> Iterator[FloatArray]:
        """Yield what bank and network make of the rows, each band an array of its own."""
        bank, run, noise = self._bank(bundle), self.prepared.network, self.prepared.noise
        stage = bundle.manifest.stage(Network)
        if bank is None or noise is None:
            return _read_bands(front)
        if run is None or stage is None:
            return self._bank_bands(bank, front)
        bands = run.bands(
            self._network_rows(bank, front, noise, stage.scale),
            progress=self._progress,
            cancel=self._cancel,
            guard=self._guard,
        )

        def undo(rows: FloatArray, _: int) -> None:
            unstabilise(rows, noise, scale=stage.scale, out=rows)

        linear = changed_bands(
            self._clock.bands("network", bands), undo, threads=self._setup.threads
        )
        return self._clock.bands("stabilise", linear)

    def _network_rows(
        self, bank: BlockBank, front: RowSource, noise: NoiseModel, scale: float
    ) -> RowSource:
        """Give the stabilised rows (6) of the capture and of the bank."""
        planes = RollingRows(front.shape, _read_bands(front))
        restored = RollingRows(front.shape, self._bank_bands(bank, planes.reader()))
        both = planes.reader(), restored.reader()
        rows = NetworkRows(*both, noise, scale=scale, threads=self._setup.threads)
        return TimedRows(rows, self._clock, "stabilise")

    def _bank_bands(self, bank: BlockBank, rows: RowSource) -> Iterator[FloatArray]:
        method = self._setup.options.method
        bands = bank.restore_bands(rows, self._unknown_rows, self._plain_blocks())
        return self._clock.bands("wiener" if method == "net" else method, bands)

    def _unknown_rows(self, top: int, bottom: int) -> NDArray[np.bool_]:
        source = self.capture.saturated_rows if self._front is None else self._front.unknown_rows
        return source(top, bottom)

    def _plain_blocks(self) -> PlainBlock | None:
        """Give the test for blocks that nothing but plain cells read."""
        if self.labels is None:
            return None
        reach = 0 if self.stage is None else self.stage.halo_px
        return plain_blocks(self.labels, reach)

    def _bank(self, bundle: Bundle) -> BlockBank | None:
        stage = bundle.manifest.stage(Wiener)
        if stage is None or self.prepared.placement is None or self.prepared.noise is None:
            return None
        psf = bundle.psf
        response = bundle.manifest.camera.channel_response.to_arrays()
        kernels = color_kernels(psf, *response, depth_mm=self._setup.options.depth_mm)
        local = LocalPsf(
            kernels=scale_kernels(kernels, self.prepared.placement.kernel_scale),
            field_heights_mm=psf.field_heights_mm,
            window=self.prepared.placement.window,
        )
        method = self._setup.options.method
        return restoration_bank(
            local,
            stage,
            self.prepared.noise,
            method="wiener" if method == "net" else method,
            threads=self._setup.threads,
        )

    def _evened(self, bands: Iterator[FloatArray]) -> Iterator[FloatArray]:
        """Raise clipped lights and divide by the illumination, in place."""
        raises, gain = self.capture.cfa is not None, self._illumination_gain()
        if not raises and gain is None:
            return bands

        def even(rows: FloatArray, top: int) -> None:
            if raises:
                recover_highlights(rows, self.white_balance, in_place=True)
            if gain is not None:
                gain.divide(rows, top, out=rows)

        evened = changed_bands(bands, even, threads=self._setup.threads)
        return self._clock.bands("color" if gain is None else "illumination", evened)

    def _illumination_gain(self) -> IlluminationGain | None:
        bundle, placement = self._setup.bundle, self.prepared.placement
        if bundle is None or placement is None or not self._setup.options.vignetting:
            return None
        if bundle.manifest.stage(Illumination) is None:
            return None
        return IlluminationGain(bundle.psf, placement.window)

    def _undistorted(self, rows: RowSource) -> RowSource:
        bundle, placement = self._setup.bundle, self.prepared.placement
        if bundle is None or placement is None or bundle.manifest.stage(Undistort) is None:
            return rows
        decided = self.prepared.decided
        if not (self._setup.options.undistort if decided is None else decided.work.undistort):
            return rows
        bands = undistort_bands(
            rows, bundle.psf.distortion, placement.window, threads=self._setup.threads
        )
        return RollingRows(self.shape, self._clock.bands("undistort", bands)).reader()


def _read_bands(source: RowSource) -> Iterator[FloatArray]:
    _, height, _ = source.shape
    for top in range(0, height, BAND_ROWS):
        yield source.read(top, min(top + BAND_ROWS, height))
