"""Closed forms of decentred and tilted surfaces."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.tolerance.deviation import Deviations, no_deviations
from camkit.models_def.optics.tolerance.elements import glass_elements
from camkit.models_def.optics.tolerance.fabricated import fabricated_tensors
from camkit.models_def.optics.tolerance.misaligned_trace import trace_misaligned
from camkit.models_def.optics.tolerance.pose import poses
from camkit.models_def.optics.trace import Fate, Rays, trace
from camkit.models_def.optics.tracing.frame import Pose, rotation

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
EXACT_MM = 1e-12
WAVE = torch.tensor([0.55], dtype=torch.float64)


def lens_of(*surfaces: Surface) -> Lens:
    return Lens(
        name="made", surfaces=surfaces, stop=0, aperture_kind="f_number", aperture_value=4.0
    )


PLATE = lens_of(
    Surface(curvature_per_mm=0.0, thickness_mm=10.0, glass="N-BK7"),
    Surface(curvature_per_mm=0.0, thickness_mm=20.0),
)
SINGLET = lens_of(
    Surface(curvature_per_mm=1 / 40, thickness_mm=6.0, glass="N-BK7"),
    Surface(curvature_per_mm=-1 / 70, thickness_mm=45.0),
)


def beam(slope: float = 0.0) -> Rays:
    """Give rays (1, 1, 1, ray) over a disc, towards a field."""
    x = torch.tensor([0.0, 1.5, -2.0, 0.3, 0.0], dtype=torch.float64)
    y = torch.tensor([0.0, -1.0, 0.5, 2.5, -2.0], dtype=torch.float64)
    towards = torch.full((1, 1, 1, 1), slope, dtype=torch.float64)
    return launch(x, y, towards, math.inf)


def traced(lens: Lens, deviations: Deviations, rays: Rays) -> Rays:
    tensors = fabricated_tensors(lens, deviations, WAVE)
    ahead = torch.zeros(1, dtype=torch.float64)
    thickness = tensors.thickness_mm[:, :, 0, 0, 0]
    return trace_misaligned(
        tensors, poses(deviations, glass_elements(lens), thickness, ahead), rays
    )


def with_error(lens: Lens, **vectors: list[list[float]]) -> Deviations:
    return replace(
        no_deviations(lens), **{name: np.array([value]) for name, value in vectors.items()}
    )


@pytest.mark.parametrize("name", ["duet", "cooke-triplet", "double-gauss"])
def test_no_errors_give_the_aligned_trace(name: str) -> None:
    lens, rays = read_lens(PRESCRIPTIONS / f"{name}.toml"), beam(0.1)
    nothing = no_deviations(lens)
    aligned = trace(fabricated_tensors(lens, nothing, WAVE), rays)
    same = traced(lens, nothing, rays)
    for part in ("x", "y", "l", "m", "n"):
        torch.testing.assert_close(
            getattr(same, part), getattr(aligned, part), rtol=0, atol=EXACT_MM
        )
    assert torch.equal(same.fate, aligned.fate)


@pytest.mark.parametrize("tilt_deg", [-20.0, 1 / 60, 5.0, 25.0])
def test_tilted_plate_shifts_a_ray_by_the_textbook_amount(tilt_deg: float) -> None:
    angle = math.radians(tilt_deg)
    landed = traced(PLATE, with_error(PLATE, element_tilt_rad=[[angle, 0.0]]), beam())
    n = float(fabricated_tensors(PLATE, no_deviations(PLATE), WAVE).index[1])
    inside = math.asin(math.sin(angle) / n)
    # t sin i (1 - cos i / (n cos i')), towards the normal: that of a plate turned y to z is -y
    shift = 10 * math.sin(angle) * (1 - math.cos(angle) / (n * math.cos(inside)))
    start = beam()
    torch.testing.assert_close(landed.y, start.y - shift, rtol=0, atol=EXACT_MM)
    torch.testing.assert_close(landed.x, start.x, rtol=0, atol=EXACT_MM)


def test_tilted_window_leaves_directions() -> None:
    start = beam(0.2)
    landed = traced(PLATE, with_error(PLATE, element_tilt_rad=[[0.2, -0.3]]), start)
    for part in ("l", "m", "n"):
        torch.testing.assert_close(
            getattr(landed, part), getattr(start, part), rtol=0, atol=EXACT_MM
        )


def test_wedge_turns_a_ray_by_prism_angle_times_index_minus_one() -> None:
    wedge = 1e-4
    landed = traced(PLATE, with_error(PLATE, surface_tilt_rad=[[0.0, 0.0], [wedge, 0.0]]), beam())
    n = float(fabricated_tensors(PLATE, no_deviations(PLATE), WAVE).index[1])
    # the plate is thicker at the top, and a prism turns light to its base
    torch.testing.assert_close(
        landed.m, torch.full_like(landed.m, (n - 1) * wedge), rtol=1e-7, atol=0
    )


@pytest.mark.parametrize("name", ["cooke-triplet", "double-gauss"])
def test_a_whole_lens_moved_aside_moves_every_ray_with_it(name: str) -> None:
    lens = read_lens(PRESCRIPTIONS / f"{name}.toml")
    moved = with_error(lens, element_decentre_mm=[[0.3, -0.2]] * len(glass_elements(lens)))
    start = beam(0.1)
    beside = replace(start, x=start.x + 0.3, y=start.y - 0.2)
    landed, still = traced(lens, moved, beside), traced(lens, no_deviations(lens), start)
    torch.testing.assert_close(
        landed.x - still.x, torch.full_like(still.x, 0.3), atol=1e-12, rtol=0
    )
    torch.testing.assert_close(
        landed.y - still.y, torch.full_like(still.y, -0.2), atol=1e-12, rtol=0
    )


def test_tilted_sphere_is_a_sphere_with_its_centre_aside_by_r_sin_tilt() -> None:
    tilt, radius = 0.05, 40.0
    landed = traced(SINGLET, with_error(SINGLET, surface_tilt_rad=[[tilt, 0.0], [0, 0]]), beam())
    centre = torch.tensor(
        [0.0, -radius * math.sin(tilt), radius * (math.cos(tilt) - 1)], dtype=torch.float64
    )
    moved = Pose(turn=torch.eye(3, dtype=torch.float64), offset_mm=centre)
    tensors = fabricated_tensors(SINGLET, no_deviations(SINGLET), WAVE)
    same = trace_misaligned(tensors, [moved, None], beam())
    torch.testing.assert_close(landed.x, same.x, rtol=0, atol=EXACT_MM)
    torch.testing.assert_close(landed.y, same.y, rtol=0, atol=EXACT_MM)


def test_a_tilted_piece_of_glass_is_the_straight_one_seen_from_a_turned_frame() -> None:
    """Turn the rays the other way, trace the aligned lens, turn them back: the same line."""
    tilt = [0.04, -0.03]
    landed = traced(SINGLET, with_error(SINGLET, element_tilt_rad=[tilt]), beam(0.1))
    turn = rotation(torch.tensor(tilt, dtype=torch.float64))
    start = beam(0.1)
    place, way = (
        torch.stack(parts, dim=-1) @ turn
        for parts in ((start.x, start.y, start.z), (start.l, start.m, start.n))
    )
    turned = Rays(
        x=place[..., 0],
        y=place[..., 1],
        z=place[..., 2],
        l=way[..., 0],
        m=way[..., 1],
        n=way[..., 2],
        fate=start.fate,
    )
    behind = trace(fabricated_tensors(SINGLET, no_deviations(SINGLET), WAVE), turned)
    depth = torch.full_like(behind.x, 51.0)
    point = torch.stack([behind.x, behind.y, depth], dim=-1) @ turn.T
    along = torch.stack([behind.l, behind.m, behind.n], dim=-1) @ turn.T
    reach = (51.0 - point[..., 2]) / along[..., 2]
    torch.testing.assert_close(landed.x, point[..., 0] + reach * along[..., 0], rtol=0, atol=1e-12)
    torch.testing.assert_close(landed.y, point[..., 1] + reach * along[..., 1], rtol=0, atol=1e-12)


def test_a_ray_that_misses_stays_lost_and_finite() -> None:
    tight = replace(
        SINGLET, surfaces=(replace(SINGLET.surfaces[0], semi_diameter_mm=1.0), SINGLET.surfaces[1])
    )
    landed = traced(tight, with_error(tight, element_decentre_mm=[[5.0, 0.0]]), beam())
    assert bool((landed.fate == Fate.VIGNETTED).all())
    assert bool(torch.isfinite(landed.x).all())


def test_rotation_is_orthogonal_and_small_angles_are_exact() -> None:
    vectors = torch.tensor([[0.0, 0.0], [1e-9, 0.0], [0.3, -0.4]], dtype=torch.float64)
    turns = rotation(vectors)
    torch.testing.assert_close(
        turns @ turns.mT, torch.eye(3, dtype=torch.float64).expand(3, 3, 3), rtol=0, atol=1e-15
    )
    assert float(turns[1, 2, 1]) == pytest.approx(1e-9, rel=1e-12)
    reference = torch.linalg.matrix_exp(
        torch.tensor([[0, 0, -0.4], [0, 0, -0.3], [0.4, 0.3, 0]], dtype=torch.float64)
    )
    torch.testing.assert_close(turns[2], reference, rtol=0, atol=1e-14)
