"""One capture on its way to a picture: the stages joined, rows pulled through them, times kept.

    capture -> [repair, white balance, demosaic] -> Wiener bank -> stabilise -> network -> back
            -> divide by relative illumination -> undistort -> camera to output colour

Nothing is computed before the first band is asked for; a `Reconstruction` serves one thread, once.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
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
from camkit.runtime.color import color_stage, recover_highlights, to_output
from camkit.runtime.envelope import findings, observe, verdict
from camkit.runtime.geometry.illumination import IlluminationGain
from camkit.runtime.geometry.placement import Placement, place, scale_kernels
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.guard import TileGuard
from camkit.runtime.network.stage import NetworkStage, SizedNetwork, StageLimits, plan_stage
from camkit.runtime.network.tiling import Cancel, Progress
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES, DemosaicMethod, Options
from camkit.runtime.plan.blocks import plain_blocks
from camkit.runtime.plan.decision import Case, Labels
from camkit.runtime.plan.estimate import Estimate, estimate_seconds
from camkit.runtime.plan.planner import Plan, make_plan, needs_scene, sizes_by_work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import MappedRows, RollingRows, RowSource
from camkit.runtime.scene import CELL_PX, Scene, measure_scene
from camkit.runtime.signal.front_rows import FrontRows
from camkit.runtime.signal.noise import measure_noise
from camkit.runtime.signal.stabilise import NetworkRows, unstabilise

BAND_ROWS: Final = 128
STAGE_ORDER: Final = (
    *("noise", "envelope", "scene", "demosaic", "wiener", "rl", "admm-tv", "stabilise", "network"),
    *("illumination", "undistort", "color"),
)
FIXED_BYTES: Final = 260_000_000
"""Interpreter, libraries and what the stages keep besides planes (measured, see docs)."""
ROW_BYTES_PER_COLUMN: Final = 60_000
"""Rolling rows of all stages together, per column of the picture (measured, see docs)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What all captures of a pipeline share.

    Attributes:
        bundle: The camera; None develops only.
        options: What the caller chose.
        engine: The network; None for the classical methods.
        networks: Gives the network of a size.
        speed: Gives how fast this machine is with the networks of some sizes.
        threads: Threads to compute with.
    """

    bundle: Bundle | None
    options: Options
    engine: NetworkEngine | None
    networks: Callable[[str], NetworkEngine]
    speed: Callable[[Sequence[str]], Speed]
    threads: int


class Reconstruction:
    """The work on one capture.

    Attributes:
        capture: What is reconstructed.
        plan: What was decided, for the sidecar.
        white_balance: Gains in use.
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
        self._warnings = list(capture.notes)
        self._front: FrontRows | None = None
        self.plan: dict[str, Any] = {}
        self.white_balance = self._choose_white_balance()
        self.color = color_stage(
            self._choose_color_matrix(),
            setup.options.color,
            exposure_ev=setup.options.exposure_ev,
        )
        self._placement = self._place()
        self._noise = self._choose_noise()
        self._guard = TileGuard(fallback=setup.options.on_unsafe == "fallback")
        self._decided = self._decide(falls_back=self._falls_back())
        self._stage = self._plan_network()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Give (3, h, w) of the picture."""
        return 3, self.capture.height, self.capture.width

    @property
    def size(self) -> str | None:
        """Give the size of network in use; None if none runs."""
        sizes = () if self._decided is None else self._decided.work.sizes()
        return sizes[0] if sizes else None

    @property
    def labels(self) -> Labels | None:
        """Give the tier of every lattice cell; None where all get the network."""
        return None if self._decided is None else self._decided.work.labels

    @property
    def stage(self) -> NetworkStage | None:
        """Give the planned windows of the networks; None if none runs."""
        return self._stage

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
        found = list(self._warnings)
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
        rows = self._front_rows()
        if bundle is not None:
            rows = self._restored_rows(bundle, rows)
        return self._finished_bands(rows)

    def fill_plain(self) -> FloatArray:
        """Give (3, h, w) developed without bank and network, all corrections applied."""
        return np.concatenate(list(self._finished_bands(self._front_rows())), axis=1)

    def _finished_bands(self, rows: RowSource) -> Iterator[FloatArray]:
        """Yield the bands behind the restoration: highlights, corrections, colour."""
        bundle = self._setup.bundle
        if self.capture.cfa is not None:
            rows = self._mapped(rows, lambda band, _: recover_highlights(band, self.white_balance))
        if bundle is not None:
            rows = self._corrected_rows(bundle, rows)
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

    # What is decided beforehand.

    def _choose_white_balance(self) -> tuple[float, float, float]:
        chosen = self._setup.options.white_balance or self.capture.white_balance
        if chosen is not None:
            return chosen
        if self.capture.cfa is None:
            return (1.0, 1.0, 1.0)
        bundle = self._setup.bundle
        if bundle is None:
            self._warnings.append("the file states no white balance: gains of 1 are used")
            return (1.0, 1.0, 1.0)
        from camkit.colorimetry import camera_from_rec709

        camera = bundle.manifest.camera
        self._warnings.append(
            f"the capture states no white balance: that of {camera.illuminant} is used"
        )
        return camera_from_rec709(np.array(camera.color_matrix))[1]

    def _choose_color_matrix(self) -> np.ndarray | None:
        if self.capture.color_matrix is not None:
            return self.capture.color_matrix
        if self.capture.cfa is None:
            return None
        if self._setup.bundle is not None:
            return np.array(self._setup.bundle.manifest.camera.color_matrix)
        self._warnings.append("the file states no colour matrix: camera RGB is taken as Rec.709")
        return None

    def _place(self) -> Placement | None:
        bundle = self._setup.bundle
        if bundle is None:
            return None
        wanted = bundle.manifest.input_contract
        if self.capture.contract != wanted:
            if (wanted, self.capture.contract) != ("raw_bayer_v1", "linear_rgb_v1"):
                raise ContractError(
                    f"bundle {bundle.manifest.name} takes {wanted}, the capture is "
                    f"{self.capture.contract}; use another bundle or --bundle none"
                )
            self._warnings.append("a linear RGB capture in a raw_bayer_v1 bundle: not demosaicked")
        placement = place(self.capture, bundle.manifest.camera, self._setup.options.assume)
        if placement.note:
            self._warnings.append(placement.note)
        return placement

    def _choose_noise(self) -> NoiseModel | None:
        """Give the noise after white balance: the file's, the bundle's at its ISO, or measured."""
        bundle = self._setup.bundle
        if bundle is None:
            return None
        if self.capture.noise is not None:
            source, noise = "file", self.capture.noise
        elif self.capture.iso is not None:
            source, noise = "bundle", bundle.manifest.camera.noise_at(self.capture.iso)
        else:
            with self._clock.stage("noise"):
                source, noise = "measured", measure_noise(self.capture)
        self.plan["noise"] = {
            "source": source,
            "shot": noise.shot,
            "read_variance": noise.read_variance,
        }
        self._sensor_noise = noise
        return noise.with_gains(self.white_balance)

    def _falls_back(self) -> bool:
        """Compare the capture with the bundle's envelope; tell whether the network is left out."""
        bundle, options = self._setup.bundle, self._setup.options
        if self._setup.engine is None or bundle is None or bundle.manifest.envelope is None:
            return False
        with self._clock.stage("envelope"):
            seen = observe(self.capture, self._sensor_noise)
        found = findings(bundle.manifest.envelope, seen)
        warning = verdict(found, bundle.manifest.name, options.on_unsafe)
        falls_back = warning is not None and options.on_unsafe == "fallback"
        self.plan["envelope"] = {"seen": seen, "outside": found, "fallback": falls_back}
        if warning is not None:
            self._warnings.append(warning)
        return falls_back

    def _decide(self, *, falls_back: bool) -> Plan | None:
        """Plan no more than the capture needs; without a bundle there is nothing to plan."""
        bundle, options = self._setup.bundle, self._setup.options
        if bundle is None or self._placement is None or self._noise is None:
            return None
        if falls_back:
            options = replace(options, method="wiener")
        case = Case(
            bundle=bundle,
            options=options,
            height_px=self.capture.height,
            width_px=self.capture.width,
            placement=self._placement,
            scene=self._measure_scene() if needs_scene(options) else None,
        )
        plan = make_plan(case, lambda: self._setup.speed(sizes_by_work(bundle)))
        if plan.note:
            self._warnings.append(plan.note)
        self.plan["quality"] = options.quality
        self.plan["decisions"] = [decision.to_json() for decision in plan.decisions()]
        return plan

    def _measure_scene(self) -> Scene:
        if self._placement is None or self._noise is None:
            raise ContractError("a scene is measured for a bundle")
        with self._clock.stage("scene"):
            scene = measure_scene(
                self.capture, self._noise, self.white_balance, self._placement.window
            )
        self.plan["scene"] = scene.to_json()
        return scene

    def explain(self) -> Estimate | None:
        """Complete the plan by what every decision saves, and give what the work will take.

        Times the machine for a moment when first asked. None without a bundle.
        """
        made = self._decided
        if made is None:
            return None
        if made.case.scene is None:
            made = replace(made, case=replace(made.case, scene=self._measure_scene()))
        speed = self._setup.speed(made.sizes())
        self.plan["decisions"] = [decision.to_json() for decision in made.decisions(speed)]
        window_mp = {} if self._stage is None else self._stage.window_mp()
        stage = 0 if self._stage is None else self._stage.needed_bytes()
        estimate = Estimate(
            seconds=estimate_seconds(made.case, made.work, speed, window_mp),
            peak_mb=(self._other_bytes() + stage) / 1e6,
        )
        self.plan["estimate"] = estimate.to_json()
        return estimate

    def _other_bytes(self) -> int:
        """Give the memory of everything but the networks."""
        rows = ROW_BYTES_PER_COLUMN * self.capture.width
        return FIXED_BYTES + rows + self.capture.resident_bytes

    def _plan_network(self) -> NetworkStage | None:
        """Plan the windows of the networks that were decided for."""
        work = None if self._decided is None else self._decided.work
        bundle = self._setup.bundle
        if work is None or bundle is None or not work.sizes():
            return None
        options = self._setup.options
        limits = StageLimits(
            cap_bytes=options.max_mem_bytes or DEFAULT_MAX_MEM_BYTES,
            spent_bytes=self._other_bytes(),
            mode=work.mode,
            cell_px=CELL_PX,
            tile_px=options.tile_px,
        )
        networks = [
            SizedNetwork(
                size=size, run=self._setup.networks(size).run, facts=bundle.network_facts(size)
            )
            for size in work.sizes()
        ]
        size_px = self.capture.height, self.capture.width
        stage = plan_stage(size_px, networks, limits, work.network_labels())
        self.plan["tiles"] = stage.to_json()
        return stage

    # The stages, each reading rows from the one before it.

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
        if bundle is None or bundle.manifest.stage(Wiener) is None:
            raise ContractError("a network stands behind the Wiener bank of a bundle")
        _, source = self._bank_rows(bundle, self._front_rows(), scale)
        return source.read(0, self.capture.height)

    def _restored_rows(self, bundle: Bundle, front: RowSource) -> RowSource:
        run, stage, noise = self._stage, bundle.manifest.stage(Network), self._noise
        with_network = run is not None and stage is not None
        restored, source = self._bank_rows(
            bundle, front, stage.scale if with_network and stage is not None else None
        )
        if run is None or stage is None or noise is None:
            return restored
        bands = run.bands(
            TimedRows(source, self._clock, "stabilise"),
            progress=self._progress,
            cancel=self._cancel,
            guard=self._guard,
        )
        linear = self._mapped(
            self._rolled("network", bands),
            lambda rows, _: unstabilise(rows, noise, scale=stage.scale),
        )
        return TimedRows(linear, self._clock, "stabilise")

    def _bank_rows(
        self, bundle: Bundle, front: RowSource, scale: float | None
    ) -> tuple[RowSource, RowSource]:
        """Give the rows of the bank, and with a scale the stabilised rows (6) for a network.

        Only one of the two may be read.
        """
        noise, method = self._noise, self._setup.options.method
        bank = self._bank(bundle)
        if bank is None or noise is None:
            return front, front
        planes = RollingRows(front.shape, _read_bands(front))
        bank_reader = planes.reader()
        restored = self._rolled(
            "wiener" if method == "net" else method,
            bank.restore_bands(bank_reader, self._unknown_rows, self._plain_blocks()),
        )
        if scale is None:
            return restored, restored
        source = NetworkRows(
            planes.reader(), restored, noise, scale=scale, threads=self._setup.threads
        )
        return restored, source

    def _unknown_rows(self, top: int, bottom: int) -> NDArray[np.bool_]:
        source = self.capture.saturated_rows if self._front is None else self._front.unknown_rows
        return source(top, bottom)

    def _plain_blocks(self) -> PlainBlock | None:
        """Give the test for blocks that nothing but plain cells read."""
        work = None if self._decided is None else self._decided.work
        if work is None or work.labels is None:
            return None
        reach = 0 if self._stage is None else self._stage.halo_px
        return plain_blocks(work.labels, reach)

    def _bank(self, bundle: Bundle) -> BlockBank | None:
        stage = bundle.manifest.stage(Wiener)
        if stage is None or self._placement is None or self._noise is None:
            return None
        psf = bundle.psf
        kernels = color_kernels(psf, *bundle.manifest.camera.channel_response.to_arrays())
        local = LocalPsf(
            kernels=scale_kernels(kernels, self._placement.kernel_scale),
            field_heights_mm=psf.field_heights_mm,
            window=self._placement.window,
        )
        method = self._setup.options.method
        return restoration_bank(
            local,
            stage,
            self._noise,
            method="wiener" if method == "net" else method,
            threads=self._setup.threads,
        )

    def _corrected_rows(self, bundle: Bundle, rows: RowSource) -> RowSource:
        if self._placement is None:
            return rows
        options, manifest, psf = self._setup.options, bundle.manifest, bundle.psf
        window = self._placement.window
        if options.vignetting and manifest.stage(Illumination) is not None:
            rows = TimedRows(
                self._mapped(rows, IlluminationGain(psf, window).divide),
                self._clock,
                "illumination",
            )
        wanted = options.undistort if self._decided is None else self._decided.work.undistort
        if wanted and manifest.stage(Undistort) is not None:
            rows = self._rolled(
                "undistort",
                undistort_bands(rows, psf.distortion, window, threads=self._setup.threads),
            )
        return rows

    def _mapped(
        self, rows: RowSource, function: Callable[[FloatArray, int], FloatArray]
    ) -> RowSource:
        return MappedRows(rows, function, rows.shape[0], threads=self._setup.threads)

    def _rolled(self, name: str, bands: Iterator[FloatArray]) -> RowSource:
        return RollingRows(self.shape, self._clock.bands(name, bands)).reader()


def _read_bands(source: RowSource) -> Iterator[FloatArray]:
    _, height, _ = source.shape
    for top in range(0, height, BAND_ROWS):
        yield source.read(top, min(top + BAND_ROWS, height))
