import numpy as np
import pytest
import torch

from camkit.contracts import FrozenPsf
from camkit.models_def.sensors import psf as torch_psf
from camkit.runtime.bank import psf as numpy_psf
from tests.deep_bundle import deep_psf
from tests.focus_bundle import focus_psf
from tests.psf_factory import coma_kernels, frozen_psf, grid_psf, streak_kernel, uniform_psf

KERNELS, HEIGHTS_MM = coma_kernels()
LOOKUP_TOLERANCE = 1e-6
WAVELENGTHS_UM = np.linspace(0.42, 0.68, 5)
POINTS_MM = np.concatenate(
    [
        [[0, 0], [0, 1], [1, 0], [-1, 0], [0, -1], [0, -9], [9, 0.3], [-2, 1.5]],
        np.random.default_rng(1).uniform(-2.5, 2.5, (40, 2)),
    ]
)


def _radial() -> FrozenPsf:
    return frozen_psf(KERNELS, HEIGHTS_MM, [0.45, 0.55, 0.65])


def _uniform() -> FrozenPsf:
    return uniform_psf(streak_kernel(30.0), wavelengths_um=(0.5, 0.6))


def _grid(columns: int = 3, rows: int = 2) -> FrozenPsf:
    turns = 360 * np.arange(rows * columns) / (rows * columns)
    streaks = np.stack([streak_kernel(turn) for turn in turns])
    x_mm, y_mm = np.array([-2.0, 0.5, 1.0])[:columns], np.array([-1.0, 1.5])[:rows]
    return grid_psf(streaks.reshape(rows, columns, 21, 21), x_mm, y_mm, wavelengths_um=(0.5, 0.6))


PSFS = {
    "radial": _radial(),
    "one field": frozen_psf(KERNELS[-1:], np.zeros(1), [0.45, 0.55, 0.65]),
    "depths": deep_psf(),
    "uniform": _uniform(),
    "grid": _grid(),
    "one column": _grid(columns=1),
    "one place": _grid(columns=1, rows=1),
}


def _response(channels: int, count: int = 5) -> np.ndarray:
    return np.random.default_rng(channels).random((channels, count))


@pytest.mark.parametrize("channels", [1, 3, 7])
@pytest.mark.parametrize("psf", PSFS.values(), ids=PSFS.keys())
def test_kernels_of_image_points_agree(psf: FrozenPsf, channels: int) -> None:
    given = psf, WAVELENGTHS_UM, _response(channels)
    ours, theirs = torch_psf.color_kernels(*given), numpy_psf.color_kernels(*given)
    assert ours.symmetry == theirs.symmetry == psf.symmetry
    np.testing.assert_allclose(ours.kernels.numpy(), theirs.kernels, atol=LOOKUP_TOLERANCE)
    batch = ours.at(torch.from_numpy(POINTS_MM[:, 0]), torch.from_numpy(POINTS_MM[:, 1]))
    for (x_mm, y_mm), kernel in zip(POINTS_MM, batch.numpy(), strict=True):
        np.testing.assert_allclose(kernel, theirs.at(x_mm, y_mm), atol=LOOKUP_TOLERANCE)


@pytest.mark.parametrize("count", [1, 2, 31])
def test_colour_kernels_agree_however_the_response_is_sampled(count: int) -> None:
    rng = np.random.default_rng(0)
    given = _radial(), np.sort(rng.uniform(0.42, 0.68, count)), rng.random((3, count))
    ours, theirs = torch_psf.color_kernels(*given), numpy_psf.color_kernels(*given)
    np.testing.assert_allclose(ours.kernels.numpy(), theirs.kernels, atol=LOOKUP_TOLERANCE)


@pytest.mark.parametrize("depth_mm", [None, 500.0, 800.0, 2000.0])
def test_colour_kernels_of_several_depths_agree(depth_mm: float | None) -> None:
    given = deep_psf(), WAVELENGTHS_UM, _response(3)
    np.testing.assert_allclose(
        torch_psf.color_kernels(*given, depth_mm=depth_mm).kernels.numpy(),
        numpy_psf.color_kernels(*given, depth_mm=depth_mm).kernels,
        atol=LOOKUP_TOLERANCE,
    )


def test_what_one_side_takes_for_a_field_the_other_does_too() -> None:
    """Kernels that a caller has already are looked up alike."""
    psf = _grid()
    places = {"grid_x_mm": psf.grid_x_mm, "grid_y_mm": psf.grid_y_mm}
    kernels = psf.kernels[:, 0]
    theirs = numpy_psf.FieldKernels(
        kernels=kernels, field_heights_mm=psf.field_heights_mm, symmetry="grid", **places
    )
    ours = torch_psf.field_kernels(torch.from_numpy(kernels), psf)
    at = torch.tensor([0.2]), torch.tensor([-0.3])
    np.testing.assert_allclose(
        ours.at(*at)[0].numpy(), theirs.at(float(at[0]), float(at[1])), atol=LOOKUP_TOLERANCE
    )
    one = numpy_psf.FieldKernels(
        kernels=kernels[:1], field_heights_mm=np.zeros(1), symmetry="uniform"
    )
    twin = torch_psf.field_kernels(torch.from_numpy(kernels[:1]), _uniform())
    np.testing.assert_allclose(twin.at(*at)[0].numpy(), one.at(0.2, -0.3), atol=LOOKUP_TOLERANCE)
    np.testing.assert_allclose(one.at(0.2, -0.3), kernels[0], atol=LOOKUP_TOLERANCE)


@pytest.mark.parametrize("focus_um", [0.0, -40.0, 40.0, -11.0, 29.5])
def test_kernels_of_a_unit_agree(focus_um: float) -> None:
    given = focus_psf(), WAVELENGTHS_UM, _response(3)
    ours = torch_psf.color_kernels(*given, focus_um=focus_um)
    theirs = numpy_psf.color_kernels(*given, focus_um=focus_um)
    np.testing.assert_allclose(ours.kernels.numpy(), theirs.kernels, atol=LOOKUP_TOLERANCE)
