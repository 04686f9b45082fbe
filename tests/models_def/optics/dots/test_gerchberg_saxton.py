import numpy as np
import pytest

from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.optics.dots.gerchberg_saxton import gerchberg_saxton
from camkit.models_def.optics.dots.target import likeness, to_target
from camkit.models_def.optics.dots.unit import phase_light

GAUSSIAN = to_target(gaussian_psf(1.84))


@pytest.mark.parametrize("place", [(5, 5), (5, 6), (8, 3)])
def test_one_dot_is_found_but_for_the_sinc_of_the_cells(place: tuple[int, int]) -> None:
    target = np.zeros((11, 11))
    target[place] = 1
    light = phase_light(gerchberg_saxton(target, 22, np.random.default_rng(0)))
    known = np.prod([np.sinc((at - 5) / 22) ** 2 for at in place])
    assert light[place] == pytest.approx(known)


def test_turns_bring_the_light_nearer() -> None:
    reached = [
        likeness(
            phase_light(gerchberg_saxton(GAUSSIAN, 22, np.random.default_rng(0), rounds)), GAUSSIAN
        )
        for rounds in (1, 5, 50)
    ]
    rmse = [one.rmse for one in reached]
    assert rmse[0] > rmse[1] > rmse[2]
    assert reached[-1].correlation > 0.98


def test_one_seed_gives_one_plate() -> None:
    one, two = (gerchberg_saxton(GAUSSIAN, 22, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
