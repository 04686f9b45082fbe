"""What is decided before the first row of a capture is computed.

White balance, colour, the place on the bundle's sensor, noise, the envelope, the plan, and the
windows of the networks: everything here is cheap, and all of it is known to the plan of a capture
before a second of work is spent.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from camkit.bundle.manifest import Wiener
from camkit.contracts import NoiseModel, depth_name
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.clock import StageClock
from camkit.runtime.color import color_stage
from camkit.runtime.envelope import findings, observe, verdict
from camkit.runtime.geometry.placement import Placement, place
from camkit.runtime.job.setup import Setup
from camkit.runtime.network.stage import NetworkStage, SizedNetwork, StageLimits, plan_stage
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES
from camkit.runtime.plan.decision import Case
from camkit.runtime.plan.estimate import Estimate, estimate_seconds
from camkit.runtime.plan.planner import Plan, make_plan, needs_scene, sizes_by_work
from camkit.runtime.scene import CELL_PX, Scene, measure_scene
from camkit.runtime.signal.noise import measure_noise

FIXED_BYTES: Final = 260_000_000
"""Interpreter, libraries and what the stages keep besides planes (measured, see docs)."""
ROW_BYTES_PER_COLUMN: Final = 40_000
"""Rolling rows of all stages but the network, per column of the picture (measured, see docs)."""


class Preparation:
    """What was decided for one capture.

    Attributes:
        notes: What the user should know, in the order it was found.
        record: The plan as the sidecar keeps it.
        white_balance: Gains in use.
        color: From camera RGB to the colour asked for.
        placement: Where the capture lies on the bundle's sensor; None without a bundle.
        noise: After white balance; None without a bundle.
        decided: The plan; None without a bundle.
        network: The windows of the networks; None if none runs.
    """

    def __init__(self, setup: Setup, capture: Capture, clock: StageClock) -> None:
        self._setup = setup
        self._capture = capture
        self._clock = clock
        self.notes = list(capture.notes)
        self.record: dict[str, Any] = {}
        self.white_balance = self._choose_white_balance()
        self.color = color_stage(
            self._choose_color_matrix(), setup.options.color, exposure_ev=setup.options.exposure_ev
        )
        self.placement = self._place()
        self.noise = self._choose_noise()
        self._note_depth()
        self.decided = self._decide(falls_back=self._falls_back())
        self.network = self._plan_network()

    def _choose_white_balance(self) -> tuple[float, float, float]:
        chosen = self._setup.options.white_balance or self._capture.white_balance
        if chosen is not None:
            return chosen
        if self._capture.cfa is None:
            return (1.0, 1.0, 1.0)
        bundle = self._setup.bundle
        if bundle is None:
            self.notes.append("the file states no white balance: gains of 1 are used")
            return (1.0, 1.0, 1.0)
        from camkit.colorimetry import camera_from_rec709

        camera = bundle.manifest.camera
        self.notes.append(
            f"the capture states no white balance: that of {camera.illuminant} is used"
        )
        return camera_from_rec709(np.array(camera.color_matrix))[1]

    def _choose_color_matrix(self) -> np.ndarray | None:
        if self._capture.color_matrix is not None:
            return self._capture.color_matrix
        if self._capture.cfa is None:
            return None
        if self._setup.bundle is not None:
            return np.array(self._setup.bundle.manifest.camera.color_matrix)
        self.notes.append("the file states no colour matrix: camera RGB is taken as Rec.709")
        return None

    def _place(self) -> Placement | None:
        bundle = self._setup.bundle
        if bundle is None:
            return None
        wanted = bundle.manifest.input_contract
        if self._capture.contract != wanted:
            if (wanted, self._capture.contract) != ("raw_bayer_v1", "linear_rgb_v1"):
                raise ContractError(
                    f"bundle {bundle.manifest.name} takes {wanted}, the capture is "
                    f"{self._capture.contract}; use another bundle or --bundle none"
                )
            self.notes.append("a linear RGB capture in a raw_bayer_v1 bundle: not demosaicked")
        placement = place(self._capture, bundle.manifest.camera, self._setup.options.assume)
        if placement.note:
            self.notes.append(placement.note)
        return placement

    def _choose_noise(self) -> NoiseModel | None:
        """Give the noise after white balance: the file's, the bundle's at its ISO, or measured."""
        bundle = self._setup.bundle
        if bundle is None:
            return None
        if self._capture.noise is not None:
            source, noise = "file", self._capture.noise
        elif self._capture.iso is not None:
            source, noise = "bundle", bundle.manifest.camera.noise_at(self._capture.iso)
        else:
            with self._clock.stage("noise"):
                source, noise = "measured", measure_noise(self._capture)
        self.record["noise"] = {
            "source": source,
            "shot": noise.shot,
            "read_variance": noise.read_variance,
        }
        self._sensor_noise = noise
        return noise.with_gains(self.white_balance)

    def _note_depth(self) -> None:
        """Record which kernels the bank takes, where there is a choice."""
        bundle, depth_mm = self._setup.bundle, self._setup.options.depth_mm
        if bundle is None or bundle.manifest.stage(Wiener) is None:
            return
        depths_mm = bundle.psf.depths_mm
        if depths_mm.size > 1:
            known = ", ".join(map(depth_name, depths_mm))
            self.record["depth"] = f"mean of {known}" if depth_mm is None else depth_name(depth_mm)

    def _falls_back(self) -> bool:
        """Compare the capture with the bundle's envelope; tell whether the network is left out."""
        bundle, options = self._setup.bundle, self._setup.options
        if self._setup.engine is None or bundle is None or bundle.manifest.envelope is None:
            return False
        with self._clock.stage("envelope"):
            seen = observe(self._capture, self._sensor_noise)
        found = findings(bundle.manifest.envelope, seen)
        warning = verdict(found, bundle.manifest.name, options.on_unsafe)
        falls_back = warning is not None and options.on_unsafe == "fallback"
        self.record["envelope"] = {"seen": seen, "outside": found, "fallback": falls_back}
        if warning is not None:
            self.notes.append(warning)
        return falls_back

    def _decide(self, *, falls_back: bool) -> Plan | None:
        """Plan no more than the capture needs; without a bundle there is nothing to plan."""
        bundle, options = self._setup.bundle, self._setup.options
        if bundle is None or self.placement is None or self.noise is None:
            return None
        if falls_back:
            options = replace(options, method="wiener")
        case = Case(
            bundle=bundle,
            options=options,
            height_px=self._capture.height,
            width_px=self._capture.width,
            placement=self.placement,
            scene=self._measure_scene() if needs_scene(options) else None,
        )
        plan = make_plan(case, lambda: self._setup.speed(sizes_by_work(bundle)))
        if plan.note:
            self.notes.append(plan.note)
        self.record["quality"] = options.quality
        self.record["decisions"] = [decision.to_json() for decision in plan.decisions()]
        return plan

    def _measure_scene(self) -> Scene:
        if self.placement is None or self.noise is None:
            raise ContractError("a scene is measured for a bundle")
        with self._clock.stage("scene"):
            scene = measure_scene(
                self._capture, self.noise, self.white_balance, self.placement.window
            )
        self.record["scene"] = scene.to_json()
        return scene

    def explain(self) -> Estimate | None:
        """Complete the plan by what every decision saves, and give what the work will take.

        Times the machine for a moment when first asked. None without a bundle.
        """
        made = self.decided
        if made is None:
            return None
        if made.case.scene is None:
            made = replace(made, case=replace(made.case, scene=self._measure_scene()))
        speed = self._setup.speed(made.sizes())
        self.record["decisions"] = [decision.to_json() for decision in made.decisions(speed)]
        window_mp = {} if self.network is None else self.network.window_mp()
        stage = 0 if self.network is None else self.network.needed_bytes()
        estimate = Estimate(
            seconds=estimate_seconds(made.case, made.work, speed, window_mp),
            peak_mb=(self._other_bytes() + stage) / 1e6,
        )
        self.record["estimate"] = estimate.to_json()
        return estimate

    def _other_bytes(self) -> int:
        """Give the memory of everything but the networks."""
        rows = ROW_BYTES_PER_COLUMN * self._capture.width
        return FIXED_BYTES + rows + self._capture.resident_bytes

    def _plan_network(self) -> NetworkStage | None:
        """Plan the windows of the networks that were decided for."""
        work = None if self.decided is None else self.decided.work
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
        size_px = self._capture.height, self._capture.width
        stage = plan_stage(size_px, networks, limits, work.network_labels())
        self.record["tiles"] = stage.to_json()
        return stage
