import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import FieldKernels, color_kernels, wavelength_weights
from tests.deep_bundle import deep_psf
from tests.psf_factory import coma_kernels, frozen_psf, grid_psf, streak_kernel, uniform_psf

KERNELS, HEIGHTS_MM = coma_kernels()
FLAT = np.ones((3, 2))
PSF_UM = np.array([0.45, 0.55, 0.65])
ROUND = FieldKernels(kernels=KERNELS, field_heights_mm=HEIGHTS_MM)


def centroid(kernel):
    """(x, y) of the energy of (3, h, w) from the centre pixel."""
    half = kernel.shape[-1] // 2
    at = np.arange(-half, half + 1)
    return (kernel.sum(axis=1) @ at).mean(), (kernel.sum(axis=2) @ at).mean()


def test_flat_response_gives_the_trapezoid_rule():
    weights = wavelength_weights(PSF_UM, np.array([0.45, 0.65]), FLAT)
    np.testing.assert_allclose(weights, [[0.25, 0.5, 0.25]] * 3, atol=1e-12)


def test_a_finer_grid_of_the_same_response_changes_nothing():
    coarse_um = np.array([0.42, 0.53, 0.68])
    coarse = np.array([[0, 1, 0.2], [0.5, 0.1, 1], [1, 0, 0.0]])
    fine_um = np.sort(np.concatenate([coarse_um, np.linspace(0.42, 0.68, 50)]))
    fine_um = np.unique(fine_um)
    fine = np.stack([np.interp(fine_um, coarse_um, row) for row in coarse])
    np.testing.assert_allclose(
        wavelength_weights(PSF_UM, coarse_um, coarse),
        wavelength_weights(PSF_UM, fine_um, fine),
        atol=1e-12,
    )


def test_weights_equal_a_brute_force_integral():
    response_um = np.array([0.40, 0.50, 0.58, 0.70])
    response = np.random.default_rng(1).random((3, 4))
    at = np.linspace(0.40, 0.70, 200_001)
    hats = np.stack([np.interp(at, PSF_UM, row) for row in np.eye(3)])
    sensed = np.stack([np.interp(at, response_um, row) for row in response])
    expected = sensed @ hats.T
    expected /= expected.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(
        wavelength_weights(PSF_UM, response_um, response), expected, atol=1e-5
    )


def test_one_wavelength_is_interpolated():
    weights = wavelength_weights(PSF_UM, np.array([0.5]), np.ones((3, 1)))
    np.testing.assert_allclose(weights, [[0.5, 0.5, 0]] * 3, atol=1e-12)


@pytest.mark.parametrize("response", [np.ones((3, 3)), np.array([[1, 1], [1, 1], [0, 0.0]])])
def test_a_response_that_does_not_fit_is_refused(response):
    with pytest.raises(ContractError, match="response"):
        wavelength_weights(PSF_UM, np.array([0.45, 0.65]), response)


def test_a_colour_that_sees_one_wavelength_gets_its_kernel():
    psf = frozen_psf(KERNELS, HEIGHTS_MM, [0.45, 0.55, 0.65])
    mixed = color_kernels(psf, np.array([0.55]), np.ones((3, 1))).kernels
    assert mixed.dtype == np.float32
    np.testing.assert_allclose(mixed, np.repeat(KERNELS[:, 1:2], 3, axis=1), atol=1e-7)


def test_colour_kernels_are_normalised_and_symmetric_about_the_meridian():
    lopsided = np.roll(KERNELS, 1, axis=-1)
    psf = frozen_psf(lopsided, HEIGHTS_MM, [0.45, 0.55, 0.65])
    mixed = color_kernels(psf, np.array([0.4, 0.7]), FLAT).kernels
    np.testing.assert_allclose(mixed.sum(axis=(-2, -1)), 1, atol=1e-6)
    np.testing.assert_array_equal(mixed, mixed[..., ::-1])


def test_a_depth_that_the_psf_does_not_reach_is_refused():
    psf = frozen_psf(KERNELS, HEIGHTS_MM, [0.45, 0.55, 0.65])
    with pytest.raises(ContractError, match="the one depth infinity"):
        color_kernels(psf, np.array([0.4, 0.7]), FLAT, depth_mm=1000.0)


def test_without_a_depth_the_kernel_is_the_mean_of_all():
    psf, response = deep_psf(), (np.array([0.4, 0.7]), FLAT)
    each = [color_kernels(psf, *response, depth_mm=depth).kernels for depth in psf.depths_mm]
    mean = color_kernels(psf, *response).kernels
    np.testing.assert_allclose(mean, np.mean(each, axis=0), atol=1e-7)
    assert np.abs(each[0] - each[1]).max() > 0.1


def test_between_depths_kernels_are_linear_in_the_vergence():
    psf, response = deep_psf(), (np.array([0.4, 0.7]), FLAT)
    near, far, between = (
        color_kernels(psf, *response, depth_mm=depth_mm).kernels
        for depth_mm in (500.0, 1000.0, 1 / (0.75 / 500 + 0.25 / 1000))
    )
    np.testing.assert_allclose(between, 0.75 * near + 0.25 * far, atol=1e-7)


def test_on_the_axis_nothing_is_turned():
    np.testing.assert_allclose(ROUND.at(0.0, 0.0), KERNELS[0], atol=1e-7)


def test_straight_down_the_stored_kernels_come_back():
    for kernel, height_mm in zip(KERNELS, HEIGHTS_MM, strict=True):
        np.testing.assert_allclose(ROUND.at(0.0, height_mm), kernel, atol=1e-7)


def test_between_heights_kernels_are_interpolated():
    middle_mm = (HEIGHTS_MM[2] + HEIGHTS_MM[3]) / 2
    np.testing.assert_allclose(ROUND.at(0.0, middle_mm), (KERNELS[2] + KERNELS[3]) / 2, atol=1e-7)


def test_beyond_the_last_height_its_kernel_holds():
    np.testing.assert_allclose(ROUND.at(0.0, 99.0), KERNELS[-1], atol=1e-7)


@pytest.mark.parametrize("place_mm", [(0.0, 1.0), (-1.0, 0.5), (0.3, -1.0), (-1.0, -1.0)])
def test_one_field_serves_every_place_as_it_is(place_mm):
    single = KERNELS[-1:]
    assert np.abs(single[0] - single[0, :, ::-1]).max() > 1e-3
    fields = FieldKernels(kernels=single, field_heights_mm=np.zeros(1))
    np.testing.assert_allclose(fields.at(*place_mm), single[0], atol=1e-7)


def test_a_quarter_turn_is_a_transposition():
    down = ROUND.at(0.0, 1.5)
    right = ROUND.at(1.5, 0.0)
    np.testing.assert_allclose(right, np.swapaxes(down, 1, 2), atol=1e-7)


@given(st.floats(0, 2 * np.pi), st.floats(0.5, 2.0))
@settings(deadline=None, max_examples=40)
def test_the_tail_points_outward_at_every_azimuth(azimuth, height_mm):
    x_mm, y_mm = height_mm * np.cos(azimuth), height_mm * np.sin(azimuth)
    turned = centroid(ROUND.at(x_mm, y_mm))
    length = np.hypot(*centroid(ROUND.at(0.0, height_mm)))
    np.testing.assert_allclose(
        turned, (length * np.cos(azimuth), length * np.sin(azimuth)), atol=0.03
    )


def test_light_of_a_point_falls_outward_on_the_sensor():
    """Scatter one point by hand at the upper left of a sensor: its energy lies up and left."""
    canvas = np.zeros((60, 60))
    row, col, centre = 20, 14, 29.5
    x_mm, y_mm = (col - centre) * 0.04, (row - centre) * 0.04
    kernel = ROUND.at(x_mm, y_mm)[1]
    half = kernel.shape[0] // 2
    for dy in range(-half, half + 1):
        for dx in range(-half, half + 1):
            canvas[row + dy, col + dx] += kernel[dy + half, dx + half]
    rows, cols = np.indices(canvas.shape)
    shift = np.array([(canvas * cols).sum() - col, (canvas * rows).sum() - row])
    outward = np.array([x_mm, y_mm]) / np.hypot(x_mm, y_mm)
    assert shift @ outward > 1.0
    sideways = np.array([-outward[1], outward[0]])
    assert abs(shift @ sideways) < 0.02 * (shift @ outward)


@given(st.floats(0.01, 2), st.floats(0.01, 2))
@settings(deadline=None, max_examples=20)
def test_mirrored_places_have_mirrored_bits(x_mm, y_mm):
    kernel = ROUND.at(x_mm, y_mm)
    left = ROUND.at(-x_mm, y_mm)
    both = ROUND.at(-x_mm, -y_mm)
    np.testing.assert_array_equal(left, kernel[:, :, ::-1])
    np.testing.assert_array_equal(both, kernel[:, ::-1, ::-1])


@given(st.floats(-2, 2), st.floats(-2, 2))
@settings(deadline=None, max_examples=30)
def test_kernels_are_never_negative_and_sum_to_one(x_mm, y_mm):
    kernel = ROUND.at(x_mm, y_mm)
    assert (kernel >= 0).all()
    np.testing.assert_allclose(kernel.sum(axis=(-2, -1)), 1, atol=1e-5)


def test_kernels_without_their_heights_are_refused():
    with pytest.raises(ContractError, match="fields"):
        FieldKernels(kernels=KERNELS, field_heights_mm=HEIGHTS_MM[:-1])


def _gaussian(side: int, sigma: float) -> FieldKernels:
    at = np.arange(side) - side // 2
    line = np.exp(-(at**2) / (2 * sigma**2))
    kernel = (np.outer(line, line) / line.sum() ** 2).astype(np.float32)
    kernels = kernel[None, None].repeat(3, axis=1)
    return FieldKernels(kernels=kernels, field_heights_mm=np.zeros(1))


@pytest.mark.parametrize("ratio", [0.5, 0.8, 1.7])
def test_scaled_kernels_have_scaled_width_and_unit_sum(ratio: float) -> None:
    scaled = _gaussian(33, 4.0).scaled(ratio).kernels
    at = np.arange(scaled.shape[-1]) - scaled.shape[-1] // 2
    width = np.sqrt((scaled[0, 0].sum(axis=0) * at**2).sum())
    assert scaled.shape[-1] % 2 == 1
    np.testing.assert_allclose(scaled.sum(axis=(-2, -1)), 1, atol=1e-5)
    assert width == pytest.approx(4.0 * ratio, rel=0.1)


def test_a_ratio_of_one_changes_nothing() -> None:
    kernels = _gaussian(9, 1.0)
    assert kernels.scaled(1.0) is kernels


def test_a_ratio_of_zero_is_refused() -> None:
    with pytest.raises(ContractError, match="> 0"):
        _gaussian(9, 1.0).scaled(0.0)


# ------------------------------------------------------------------------------- other symmetries

PLACES_MM = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, -1.0), (-0.7, 0.4), (5.0, 5.0)]
SEEN_UM = np.array([0.5, 0.6])


@pytest.mark.parametrize("turn_deg", [0.0, 30.0, 200.0])
def test_a_uniform_kernel_is_neither_symmetrised_nor_turned_nor_mirrored(turn_deg: float) -> None:
    streak = streak_kernel(turn_deg)
    assert np.abs(streak - streak[:, ::-1]).max() > 0.01
    fields = color_kernels(uniform_psf(streak), SEEN_UM, np.ones((2, 2)))
    assert not fields.turns
    for place_mm in PLACES_MM:
        np.testing.assert_allclose(fields.at(*place_mm), [streak, streak], atol=1e-7)


def test_only_a_radial_psf_of_several_fields_turns() -> None:
    response = np.array([0.4, 0.7]), FLAT
    round_psf = frozen_psf(KERNELS, HEIGHTS_MM, [0.45, 0.55, 0.65])
    assert color_kernels(round_psf, *response).turns
    one = frozen_psf(KERNELS[-1:], np.zeros(1), [0.45, 0.55, 0.65])
    assert not color_kernels(one, *response).turns
    assert not color_kernels(_grid()[0], *response).turns


GRID_X_MM = np.array([-1.5, -0.5, 2.0])
GRID_Y_MM = np.array([-1.0, 0.25])


def _grid() -> tuple[FrozenPsf, np.ndarray]:
    streaks = np.stack([streak_kernel(60.0 * n) for n in range(6)]).reshape(2, 3, 21, 21)
    return grid_psf(streaks, GRID_X_MM, GRID_Y_MM), streaks


def _grid_fields() -> tuple[FieldKernels, np.ndarray]:
    psf, streaks = _grid()
    return color_kernels(psf, SEEN_UM, np.ones((1, 2))), streaks


def test_at_its_places_a_grid_gives_the_stored_kernels() -> None:
    fields, streaks = _grid_fields()
    for row, y_mm in enumerate(GRID_Y_MM):
        for column, x_mm in enumerate(GRID_X_MM):
            found = fields.at(x_mm, y_mm)[0]
            np.testing.assert_allclose(found, streaks[row, column], atol=1e-7)


@given(st.floats(0, 1), st.floats(0, 1), st.sampled_from([0, 1]))
@settings(deadline=None, max_examples=30)
def test_between_its_places_a_grid_blends_the_four_neighbours_bilinearly(
    across: float, down: float, column: int
) -> None:
    fields, streaks = _grid_fields()
    x_mm = GRID_X_MM[column] + across * np.diff(GRID_X_MM)[column]
    y_mm = GRID_Y_MM[0] + down * np.diff(GRID_Y_MM)[0]
    (a, b), (c, d) = streaks[:, column : column + 2]
    wanted = (1 - down) * ((1 - across) * a + across * b) + down * ((1 - across) * c + across * d)
    np.testing.assert_allclose(fields.at(x_mm, y_mm)[0], wanted, atol=1e-7)


@given(st.floats(-50, 50), st.floats(-50, 50))
@settings(deadline=None, max_examples=30)
def test_beyond_its_rim_a_grid_holds(x_mm: float, y_mm: float) -> None:
    fields, _ = _grid_fields()
    inside = (
        float(np.clip(x_mm, GRID_X_MM[0], GRID_X_MM[-1])),
        float(np.clip(y_mm, GRID_Y_MM[0], GRID_Y_MM[-1])),
    )
    np.testing.assert_array_equal(fields.at(x_mm, y_mm), fields.at(*inside))


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 3), (2, 1)])
def test_a_grid_of_one_row_or_column_blends_along_the_other(rows: int, columns: int) -> None:
    _, streaks = _grid()
    psf = grid_psf(streaks[:rows, :columns].copy(), GRID_X_MM[:columns], GRID_Y_MM[:rows])
    fields = color_kernels(psf, SEEN_UM, np.ones((1, 2)))

    def shares(at_mm: float, places_mm: np.ndarray) -> np.ndarray:
        number = np.interp(at_mm, places_mm, np.arange(places_mm.size))
        return np.maximum(1 - np.abs(np.arange(places_mm.size) - number), 0)

    for x_mm, y_mm in PLACES_MM:
        down, across = shares(y_mm, GRID_Y_MM[:rows]), shares(x_mm, GRID_X_MM[:columns])
        wanted = np.einsum("r,c,rchw->hw", down, across, streaks[:rows, :columns])
        np.testing.assert_allclose(fields.at(x_mm, y_mm)[0], wanted, atol=1e-7)


def test_scaling_keeps_where_the_fields_are_and_which_way_streaks_point() -> None:
    fields, _ = _grid_fields()
    larger = fields.scaled(1.5)
    assert larger.symmetry == "grid"
    for x_mm, y_mm in PLACES_MM:
        before, after = (np.array(centroid(f.at(x_mm, y_mm))) for f in (fields, larger))
        np.testing.assert_allclose(after, 1.5 * before, atol=0.15)


def test_rectangular_kernels_are_scaled_along_both_sides() -> None:
    wide = np.zeros((1, 1, 5, 21), np.float32)
    wide[0, 0, 2, 10:] = np.arange(11, 0, -1)
    wide /= wide.sum()
    fields = FieldKernels(kernels=wide, field_heights_mm=np.zeros(1), symmetry="uniform")
    for ratio in (0.5, 2.0):
        scaled = fields.scaled(ratio).kernels
        assert scaled.shape[2:] == (2 * round(2 * ratio) + 1, 2 * round(10 * ratio) + 1)
        half = scaled.shape[-1] // 2
        offset = (scaled[0, 0].sum(axis=0) * np.arange(-half, half + 1)).sum()
        before = (wide[0, 0].sum(axis=0) * np.arange(-10, 11)).sum()
        assert offset == pytest.approx(ratio * before, rel=0.1)


@pytest.mark.parametrize("channels", [1, 2, 7])
@pytest.mark.parametrize("kind", ["radial", "uniform", "grid"])
def test_any_number_of_channels_has_kernels(kind: str, channels: int) -> None:
    psf = {
        "radial": frozen_psf(KERNELS, HEIGHTS_MM, [0.45, 0.55, 0.65]),
        "uniform": uniform_psf(streak_kernel(10.0), (0.5, 0.6)),
        "grid": _grid()[0],
    }[kind]
    seen_um, response = np.array([0.42, 0.5, 0.6, 0.68]), np.random.default_rng(0)
    weights = response.random((channels, 4))
    kernels = color_kernels(psf, seen_um, weights).at(0.3, -0.4)
    assert kernels.shape[0] == channels
    np.testing.assert_allclose(kernels.sum(axis=(-2, -1)), 1, atol=1e-5)
    for channel in range(channels):
        alone = color_kernels(psf, seen_um, weights[channel][None]).at(0.3, -0.4)
        np.testing.assert_allclose(alone[0], kernels[channel], atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"symmetry": "uniform"}, "uniform kernels are of one field"),
        ({"symmetry": "grid"}, "a position for each"),
        (
            {"symmetry": "grid", "grid_x_mm": GRID_X_MM, "grid_y_mm": GRID_Y_MM},
            "a position for each",
        ),
        ({"grid_x_mm": np.arange(5.0), "grid_y_mm": np.zeros(1)}, "and nothing else"),
    ],
)
def test_fields_that_are_not_what_they_say_are_refused(changes: dict, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        FieldKernels(kernels=KERNELS, field_heights_mm=HEIGHTS_MM, **changes)
