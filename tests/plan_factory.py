"""Scenes and calibrated tiny bundles for the tests of the plan."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Wiener
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.bundle.writer import write_bundle
from camkit.radial import RadialDistortion
from camkit.runtime.content import CELL_PX, LIGHT_PX, Content
from camkit.runtime.plan.loss import LossModel, plan_entries
from tests.bundle_factory import (
    tiny_facts,
    tiny_manifest,
    tiny_members,
    tiny_network,
    tiny_psf,
    tiny_sensor,
    tiny_stages,
)

WIDTH_PX, HEIGHT_PX = 1024, 768
RADIUS_MM = 640 * 6e-3
"""Half the diagonal of the planned bundle's sensor."""
MODEL = LossModel(
    lines={
        "exact": (0.0, 1.0, 0.0, 0.0),
        "plain": (1.0, 1.0, 0.0, 0.0),
        "wiener": (-0.5, 1.0, 0.0, 0.0),
        "S": (-2.0, 1.0, 0.0, 0.0),
    },
    adaptive_db=0.1,
    draft_db=0.5,
)


def made_content(
    detail: NDArray[np.float64], *, noise: float = 1e-5, field: float = 0.0, clipped: float = 0.0
) -> Content:
    """Give content of whole cells with this detail."""
    like = np.ones_like(detail)
    return Content(
        height_px=CELL_PX * detail.shape[0],
        width_px=CELL_PX * detail.shape[1],
        sensor_share=1.0,
        level=0.2 * like,
        detail=detail,
        noise=noise * like,
        clipped=clipped * like,
        field=field * like,
        lights=np.full([CELL_PX // LIGHT_PX * side for side in detail.shape], clipped > 0),
    )


def write_planned_bundle(folder: Path, *, model: LossModel | None = MODEL) -> Bundle:
    """Write and open a tiny bundle of 4x3 cells with sizes M and S, calibrated by `model`."""
    stages = tuple(
        stage.model_copy(update={"block_px": 128, "overlap_px": 32})
        if isinstance(stage, Wiener)
        else stage
        for stage in tiny_stages()
    )
    networks = {
        "M": tiny_facts().model_copy(update={"mac_per_pixel": 16_000.0}),
        "S": tiny_facts().model_copy(update={"member": "network_s.onnx", "mac_per_pixel": 4_000.0}),
    }
    plan = None
    if model is not None:
        plan = plan_entries(model, adaptive_cost_db=0.05, draft_cost_db=0.3)
    full = tiny_manifest(
        sensor=tiny_sensor(WIDTH_PX, HEIGHT_PX),
        stages=stages,
        networks={DEFAULT_ROLE: networks},
        plan=plan,
    )
    path = folder / "planned.camkit"
    psf = replace(
        tiny_psf(),
        field_heights_mm=np.array([0.0, 4.0]),
        distortion=RadialDistortion(
            coefficients=np.tile([1.0, -0.01, 0.0, 0.0], (3, 1)), radius_mm=RADIUS_MM
        ),
    )
    members = tiny_members() | {
        "network_s.onnx": tiny_network(seed=7),
        "psf.safetensors": psf_to_bytes(psf),
    }
    write_bundle(path, full, members)
    return open_bundle(path)


def half_textured_mosaic() -> NDArray[np.uint16]:
    """Give a capture of the planned bundle: flat on the left, strong texture on the right."""
    rng = np.random.default_rng(4)
    signal = np.full((HEIGHT_PX, WIDTH_PX), 0.3)
    blocks = rng.random((HEIGHT_PX // 8, WIDTH_PX // 16))
    signal[:, WIDTH_PX // 2 :] = 0.8 * np.kron(blocks, np.ones((8, 8)))
    noisy = signal + 0.002 * rng.standard_normal(signal.shape)
    return np.clip(np.rint(64 + 959 * noisy), 0, 1023).astype(np.uint16)
