"""A blur that varies from cell to cell: as a slow sum over all cells says, by few convolutions."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.bank.place_blur import (
    AZIMUTHS,
    NodeKernels,
    Nodes,
    PlaceBlur,
    _whole_pairs,
    few_kernels,
    lay_nodes,
)
from camkit.runtime.bank.psf import FieldKernels
from camkit.runtime.geometry.sensor_window import SensorWindow

FLOAT32 = 2e-6
SIDE = 7


def _kernels(symmetry: str, fields: int = 2) -> FieldKernels:
    rng = np.random.default_rng(4)
    made = rng.uniform(0.1, 1, (fields, 2, SIDE, SIDE))
    if symmetry == "radial":
        made += made[..., ::-1]
    made /= made.sum(axis=(-2, -1), keepdims=True)
    if symmetry != "grid":
        heights = np.linspace(0, 0.5, fields)
        return FieldKernels(
            kernels=made.astype("f4"),
            field_heights_mm=heights,
            symmetry=symmetry,  # type: ignore[arg-type]
        )
    x_mm, y_mm = np.array([-0.3, 0.3]), np.array([-0.2, 0.0, 0.2])
    return FieldKernels(
        kernels=made.astype("f4"),
        field_heights_mm=np.hypot(y_mm[:, None], x_mm).ravel(),
        symmetry="grid",
        grid_x_mm=x_mm,
        grid_y_mm=y_mm,
    )


def _window(width: int = 12, height: int = 9) -> SensorWindow:
    return SensorWindow(
        size_px=(width, height), origin_px=(0, 0), sensor_size_px=(width, height), pitch_um=48.0
    )


CASES = {
    "radial": _kernels("radial", 3),
    "radial of one field": _kernels("radial", 1),
    "uniform": _kernels("uniform", 1),
    "grid": _kernels("grid", 6),
}


def _laid(kernels: FieldKernels) -> tuple[Nodes, FloatArray]:
    nodes = lay_nodes(kernels, _window())
    light = 0.4 + 0.1 * np.arange(2 * len(kernels.kernels)).reshape(-1, 2)
    return nodes, NodeKernels(kernels, light).of(1)


def _slowly(picture: FloatArray, nodes: Nodes, kernels: FloatArray) -> FloatArray:
    """Add the kernel of every cell, times its light."""
    half = kernels.shape[-1] // 2
    height, width = picture.shape
    out = np.zeros((height + 2 * half, width + 2 * half))
    for y in range(height):
        for x in range(width):
            own = np.zeros(kernels.shape[1:])
            for node, share in zip(nodes.near[y, x], nodes.share[y, x], strict=True):
                own += share * kernels[node]
            out[y : y + 2 * half + 1, x : x + 2 * half + 1] += picture[y, x] * own
    return out[half : half + height, half : half + width].astype(np.float32)


@pytest.mark.parametrize("kernels", CASES.values(), ids=CASES.keys())
def test_the_blur_is_the_sum_over_all_cells(kernels: FieldKernels) -> None:
    nodes, made = _laid(kernels)
    picture = np.random.default_rng(0).random((9, 12), dtype=np.float32)
    blur = PlaceBlur(few_kernels(made, len(made)), nodes)
    np.testing.assert_allclose(blur(picture), _slowly(picture, nodes, made), atol=FLOAT32)


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_do_not_change_a_bit(threads: int) -> None:
    nodes, made = _laid(CASES["radial"])
    few = few_kernels(made, 9)  # three sums, of which the last has one term
    picture = np.random.default_rng(0).random((9, 12), dtype=np.float32)
    alone = PlaceBlur(few, nodes)(picture)
    np.testing.assert_array_equal(PlaceBlur(few, nodes, threads=threads)(picture), alone)


def test_a_cell_on_a_node_has_its_kernel() -> None:
    kernels = _kernels("radial", 3)
    nodes, _ = _laid(kernels)
    np.testing.assert_allclose(nodes.share.sum(axis=-1), 1, atol=FLOAT32)
    place = nodes.places_mm[1 + AZIMUTHS + 8]  # of the last ring, to the right
    np.testing.assert_allclose(place, [0.5, 0.0], atol=1e-12)
    on = SensorWindow(
        size_px=(1, 1), origin_px=(0, 0), sensor_size_px=(1, 1), pitch_um=1000, axis_px=(-0.5, 0)
    )
    laid = lay_nodes(kernels, on)
    at = int(laid.near[0, 0, np.argmax(laid.share[0, 0])])
    assert at == 1 + AZIMUTHS + 8
    np.testing.assert_allclose(
        NodeKernels(kernels, np.ones((3, 2))).of(0)[at],
        kernels.at(0.5, 0.0)[0],
        atol=FLOAT32,
    )


def test_mirrored_nodes_have_mirrored_kernels() -> None:
    _, made = _laid(_kernels("radial", 2))
    ring = made[1:]
    for azimuth in range(AZIMUTHS):
        np.testing.assert_array_equal(ring[azimuth], ring[-azimuth % AZIMUTHS][:, ::-1])


def test_few_kernels_stand_for_many_and_more_of_them_are_nearer() -> None:
    nodes, made = _laid(_kernels("radial", 3))
    picture = np.random.default_rng(0).random((9, 12), dtype=np.float32)
    exact = PlaceBlur(few_kernels(made, len(made)), nodes)(picture)
    off = [
        float(np.abs(PlaceBlur(few_kernels(made, terms), nodes)(picture) - exact).max())
        for terms in (2, 8, 32)
    ]
    assert off[0] > 2 * off[1] > 4 * off[2]
    assert off[2] < 0.01 * exact.max()


def test_equal_directions_are_kept_or_left_together() -> None:
    lengths = np.array([5.0, 4.0, 4.0 - 1e-9, 3.0, 3.0, 1.0])
    assert [_whole_pairs(lengths, most) for most in (1, 2, 3, 4, 5)] == [1, 1, 3, 3, 5]


def test_the_solver_undoes_a_blur_that_is_the_same_everywhere() -> None:
    nodes, made = _laid(CASES["uniform"])
    made = np.zeros_like(made)
    made[0, SIDE // 2, SIDE // 2], made[0, 0, 0] = 0.7, 0.2
    blur = PlaceBlur(few_kernels(made, 1), nodes)
    picture = np.zeros((9, 12), np.float32)
    picture[4, 6] = 1
    np.testing.assert_allclose(blur.solver(1e-6)(blur(picture)), picture, atol=1e-2)


def test_other_numbers_of_kernels_are_refused() -> None:
    nodes, made = _laid(CASES["uniform"])
    with pytest.raises(ContractError, match="1 nodes need a kernel each"):
        PlaceBlur(few_kernels(np.concatenate([made, made]), 4), nodes)
