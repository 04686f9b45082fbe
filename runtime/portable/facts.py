"""The facts of a camera that its graphs are made of; cameras without such graphs are refused."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor
from camkit.bundle.stages import Dehaze, Network, Undistort, Wiener
from camkit.bundle.stages.together import Together
from camkit.caller import option_text
from camkit.runtime.bank.blocks import UNCUT_PX
from camkit.runtime.bank.haze import hazy_kernels
from camkit.runtime.bank.psf import FieldKernels, color_kernels
from camkit.runtime.portable.haze_graph import HazeFacts
from camkit.runtime.portable.refusal import refusal, stage_of_host
from camkit.runtime.portable.spectra import BlockShape

STAGES: Final = (
    *("linearise", "repair", "white_balance", "demosaic", "haze", "wiener", "network"),
    *("raise_clipped", "illumination", "undistort", "color"),
)
"""The stages that the graphs stand for, in order, a haze where there is one; repair and the reading
of files stay outside."""
LEAST_HAZE_FIELDS: Final = 3
BLOCK_STEP_PX: Final = 8
"""Sides of blocks are multiples of it: four phases, whose means have a spectrum of even length."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFacts:
    """A camera whose chain can be compiled.

    Attributes:
        bundle: Of the camera.
        sensor: Of the bundle.
        bank: Its stage.
        network: Likewise.
        warp: Likewise.
        together: Numbers of the bank.
        kernels: (field, c, h, w) of the fields, and where these lie.
        shape: Of the blocks.
        depth_mm: Object distance whose kernels they are; None for the mean over all distances.
        haze: What lies beside the kernels; None for nothing.
    """

    bundle: Bundle
    sensor: BayerSensor
    bank: Wiener
    network: Network
    warp: Undistort
    together: Together
    kernels: FieldKernels
    shape: BlockShape
    depth_mm: float | None
    haze: HazeFacts | None

    @property
    def pitch_mm(self) -> float:
        """Return the distance of pixels."""
        return self.sensor.known_extent.pixel_pitch_um / 1000

    @property
    def axis_px(self) -> tuple[float, float]:
        """Return (x, y) on the sensor where the optical axis meets it."""
        extent = self.sensor.known_extent
        middle = (extent.width_px - 1) / 2, (extent.height_px - 1) / 2
        return extent.optical_centre_px or middle

    @property
    def least_noise(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return shot noise and read variance of the lowest ISO, (3,) each, before gains."""
        noise = self.sensor.noise_at(min(one.iso for one in self.sensor.noise))
        return np.array(noise.shot), np.array(noise.read_variance)


def facts_of(bundle: Bundle, depth_mm: float | None = None) -> CameraFacts:
    """Return the facts of a camera.

    Args:
        bundle: Of the camera.
        depth_mm: Object distance whose kernels the graphs take; None for the mean over those of a
            bundle that does not find the distance itself.

    Raises:
        UnsupportedError: If something of its chain has no graph; the message names it.
        ContractError: If the PSF does not reach the depth.
    """
    manifest = bundle.manifest
    if reason := _missing(manifest, depth_mm):
        raise refusal(manifest, reason)
    sensor = manifest.sensor
    stages = {stage.type: stage for stage in manifest.stages}
    bank, network, warp = stages["wiener"], stages["network"], stages["undistort"]
    assert isinstance(sensor, BayerSensor)
    assert isinstance(bank, Wiener)
    assert isinstance(network, Network)
    assert isinstance(warp, Undistort)
    assert bank.together is not None
    response = sensor.response_arrays()
    share = bundle.haze.core_share if manifest.has_haze else None
    return CameraFacts(
        bundle=bundle,
        sensor=sensor,
        bank=bank,
        network=network,
        warp=warp,
        together=bank.together,
        kernels=color_kernels(bundle.psf, *response, depth_mm=depth_mm, share=share),
        shape=BlockShape(bank.block_px),
        depth_mm=depth_mm,
        haze=_haze_of(bundle, depth_mm),
    )


def _haze_of(bundle: Bundle, depth_mm: float | None) -> HazeFacts | None:
    """Return the haze of a camera.

    Raises:
        UnsupportedError: If its kernels are such that no graph removes it.
    """
    manifest, stage = bundle.manifest, bundle.manifest.stage(Dehaze)
    if stage is None:
        return None
    sensor = manifest.light_sensor
    kernels = hazy_kernels(bundle.psf, bundle.haze, *sensor.response_arrays(), depth_mm=depth_mm)
    if kernels.differ:
        raise refusal(manifest, "every place of its haze needs a filter of its own")
    if kernels.core.field_heights_mm.size < LEAST_HAZE_FIELDS:
        raise refusal(manifest, f"its haze is known at fewer than {LEAST_HAZE_FIELDS} fields")
    pitch_mm = sensor.known_extent.pixel_pitch_um / 1000
    return HazeFacts(stage=stage, kernels=kernels, pitch_mm=pitch_mm)


def _missing(manifest: Manifest, depth_mm: float | None) -> str | None:
    """Return what of a camera has no graph; None if all has one."""
    if reason := stage_of_host(manifest):
        return reason
    if manifest.kind != "bayer" or not isinstance(manifest.sensor, BayerSensor):
        return f"its kind is {manifest.kind}"
    stages = {stage.type: stage for stage in manifest.stages}
    types = tuple(stage.type for stage in manifest.stages)
    if types != STAGES:
        other = [name for name in types if name not in STAGES]
        lacking = [name for name in STAGES if name not in (*types, "haze")]
        if other or lacking:
            return f"stage {other[0]} has no graph" if other else f"it has no stage {lacking[0]}"
        if types != tuple(name for name in STAGES if name != "haze"):
            return "its stages stand in another order, or twice"
    bank, network, warp = stages["wiener"], stages["network"], stages["undistort"]
    assert isinstance(bank, Wiener)
    assert isinstance(network, Network)
    assert isinstance(warp, Undistort)
    optics = manifest.optics
    reasons = {
        "its bank restores every colour alone": bank.together is None,
        "its bank finds the distance of the scene in every capture; state one with "
        + option_text("depth_m"): bank.depth != "mean" and depth_mm is None,
        "its bank explains lights without a reach": bank.clip_reach_px is None,
        f"its blocks are no multiple of {BLOCK_STEP_PX} px": bank.block_px % BLOCK_STEP_PX != 0,
        f"its blocks are larger than {UNCUT_PX} px": bank.block_px > UNCUT_PX,
        "its kernels lie on a grid": optics is None or getattr(optics, "symmetry", "") == "grid",
        "its bank works on the mosaic, which has a haze": "haze" in stages
        and bank.mosaic is not None,
        "its network takes numbers of its own": network.transform != "stabilise",
        "its network runs near lights only": network.lights_px is not None,
        "its network keeps lamps white": network.keeps_white,
        "its warp is not cubic with limited overshoot": (
            warp.interpolation != "cubic" or warp.overshoot != "limited"
        ),
        "its demosaic is not fast": getattr(stages["demosaic"], "method", "") != "fast",
    }
    first = next((reason for reason, applies in reasons.items() if applies), None)
    return first or _other_planes(manifest)


def _other_planes(manifest: Manifest) -> str | None:
    """Return which stage takes other planes than those that its graph is given; None if none."""
    planes, last_plane = manifest.all_planes, ""
    for stage in manifest.stages:
        stage_planes = [name for name in stage.takes if planes[name].domain != "mask"]
        graph_planes = [last_plane] if last_plane else list(stage.takes[:1])
        if isinstance(stage, Network):
            bank = manifest.stage(Wiener)
            assert bank is not None
            graph_planes = [bank.takes[0], last_plane]
        if stage_planes != graph_planes:
            names, expected = (", ".join(some) for some in (stage_planes, graph_planes))
            return f"its stage {stage.type} takes {names}, not {expected}"
        last_plane = stage.gives[0]
    return None
