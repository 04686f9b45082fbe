"""A small camera whose optics write streaks, made without torch: four lines about every light.

The core is a narrow Gaussian; each of eight arms holds the same light, even from 8 to 40 pixels,
so that shares are known by construction. There is no network: what comes out is physics alone.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.chain import rewired
from camkit.bundle.frozen_optics import FrozenOptics, psf_of_streaks
from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Highlights,
    Illumination,
    Linearise,
    Parts,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
)
from camkit.bundle.writer import write_bundle
from camkit.streaks import SECTION_STEP_PX, StreakOptics
from tests.camera_factory import PITCH_UM, make_sensor

SIZE_PX: Final = (256, 192)
ARMS: Final = 8
FIRST_PX: Final = 8
LAST_PX: Final = 40
CORE_PX: Final = 11
CORE_SHARE: Final = 0.935
STREAK_SHARE: Final = 0.06
HAZE_SHARE: Final = 0.005
HAZE_SQUARES: Final = 11
DEEP_MM: Final = (1000.0, 5000.0)
WAVELENGTHS_UM: Final = (0.45, 0.55, 0.62)


def four_lines(*, depths_mm: tuple[float, ...] = (5000.0,)) -> StreakOptics:
    """Give the optics described at the head of the module.

    Args:
        depths_mm: With several, arms grow by a hundredth from each to the one before.
    """
    depths, waves = len(depths_mm), len(WAVELENGTHS_UM)
    lead = (depths, waves)
    core, bare = (_gaussian(sigma) for sigma in (0.7, 0.6))
    section = _gaussian_line(0.5)
    profiles = np.zeros((*lead, ARMS, LAST_PX + 2 + depths), np.float32)
    for depth in range(depths):
        last = LAST_PX * (1 + 0.01 * (depths - 1 - depth))
        reach = np.clip(last + 0.5 - np.arange(profiles.shape[-1]), 0, 1)
        reach[:FIRST_PX] = 0
        profiles[depth] = STREAK_SHARE / ARMS * reach / reach.sum()
    haze = np.full((*lead, HAZE_SQUARES, HAZE_SQUARES), HAZE_SHARE, np.float32)
    return StreakOptics(
        core=np.broadcast_to(np.float32(CORE_SHARE) * core, (*lead, CORE_PX, CORE_PX)).copy(),
        bare_core=np.broadcast_to(bare, (*lead, CORE_PX, CORE_PX)).copy(),
        profiles=profiles,
        sections=np.broadcast_to(section, (waves, ARMS, section.size)).copy(),
        angles_rad=2 * math.pi * (np.arange(ARMS) + 0.5) / ARMS,
        haze=haze / np.float32((8 * HAZE_SQUARES) ** 2),
        depths_mm=np.array(depths_mm),
        wavelengths_um=np.array(WAVELENGTHS_UM),
        pixel_pitch_um=PITCH_UM,
    )


def hdr_stages() -> tuple[Stage, ...]:
    """Give the usual stages of the kind, without its network."""
    usual: tuple[Stage, ...] = (
        Linearise(),
        Repair(),
        WhiteBalance(),
        Demosaic(method="fast"),
        Highlights(),
        Illumination(takes=("lit",)),
        Undistort(),
        Color(),
    )
    return rewired(usual, usual)


def hdr_stages_from_samples() -> tuple[Stage, ...]:
    """Return the usual stages, of which streaks are taken from the mosaic (format 2.8)."""
    changes: dict[type[Stage], dict[str, Any]] = {
        Demosaic: {"method": "quality"},
        Highlights: {"takes": ("rgb", "balanced")},
    }
    return tuple(s.model_copy(update=changes.get(type(s), {})) for s in hdr_stages())


def write_hdr_bundle(
    folder: Path,
    name: str = "streaks.camkit",
    *,
    size_px: tuple[int, int] = SIZE_PX,
    depths_mm: tuple[float, ...] = (5000.0,),
    members: Mapping[str, bytes] | None = None,
    **changes: Any,
) -> Bundle:
    """Write and open a camera of four lines; changes are fields of its manifest.

    Args:
        folder: For the file.
        name: Of the file.
        size_px: Of the sensor.
        depths_mm: Of the optics.
        members: Networks, by name.
        changes: Fields of the manifest.
    """
    streaks = four_lines(depths_mm=depths_mm)
    optics = FrozenOptics(psf=psf_of_streaks(streaks, 3), streaks=streaks)
    member, data = optics.member
    sensor = make_sensor(*size_px)
    parts = Parts(
        sensor=sensor, optics=optics.entry(depths_mm[-1]), networks=changes.get("networks", {})
    )
    stages = changes.pop("stages", hdr_stages())
    fields: dict[str, Any] = {
        "name": "streaks",
        "kind": "hdr",
        "version": "1.0.0",
        "licence": "Apache-2.0",
        "training_data": "untrained",
        "sensor": sensor,
        "optics": parts.optics,
        "stages": stages,
        "planes": planes_of(stages, parts),
        "products": {"image": stages[-1].gives[0]},
        "exported_with": {"camkit": "0.1.0"},
    }
    path = folder / name
    write_bundle(path, Manifest(**(fields | changes)), {member: data, **(members or {})})
    return open_bundle(path)


def _gaussian(sigma_px: float) -> np.ndarray:
    place = np.arange(CORE_PX) - CORE_PX // 2
    line = np.exp(-0.5 * (place / sigma_px) ** 2)
    square = np.outer(line, line)
    return (square / square.sum()).astype(np.float32)


def _gaussian_line(sigma_px: float) -> np.ndarray:
    place = SECTION_STEP_PX * np.arange(-12, 13)
    line = np.exp(-0.5 * (place / sigma_px) ** 2)
    return (line / (line.sum() * SECTION_STEP_PX)).astype(np.float32)
