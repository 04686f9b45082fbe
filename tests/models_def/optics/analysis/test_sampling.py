import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.sampling import Pupil, pupil_samples, sample_weights

NAMES = ("hexapolar:6", "gauss:6x12", "radau:6x12", "grid:40", "fibonacci:500")
QUADRATURE_TOLERANCE = 1e-14


@pytest.mark.parametrize("name", NAMES)
def test_points_lie_in_the_disc_and_their_shares_make_one(name: str) -> None:
    samples = pupil_samples(name)
    assert bool((samples.x**2 + samples.y**2 <= 1 + 1e-12).all())
    assert float(sample_weights(samples).sum()) == pytest.approx(1, abs=1e-12)
    assert float((sample_weights(samples) * samples.x).sum()) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("kind", ["gauss", "radau"])
@pytest.mark.parametrize("power", range(7))
def test_quadrature_is_exact_for_polynomials_of_the_pupil(kind: str, power: int) -> None:
    """The mean of r^(2p) over the disc is 1 / (p + 1); 4 rings do up to p = 6 (Radau) or 7."""
    samples = pupil_samples(f"{kind}:4x12")
    square = samples.x**2 + samples.y**2
    mean = float((sample_weights(samples) * square**power).sum())
    assert mean == pytest.approx(1 / (power + 1), abs=QUADRATURE_TOLERANCE)


def test_quadrature_is_exact_for_powers_of_y() -> None:
    """The mean of y^4 over the disc is 1/8, of x^2 y^2 1/24."""
    samples = pupil_samples("gauss:3x8")
    weight = sample_weights(samples)
    assert float((weight * samples.y**4).sum()) == pytest.approx(1 / 8, abs=1e-14)
    assert float((weight * samples.x**2 * samples.y**2).sum()) == pytest.approx(1 / 24, abs=1e-14)


def test_radau_has_the_centre_as_a_node() -> None:
    samples = pupil_samples("radau:5x6")
    assert float(torch.hypot(samples.x, samples.y).min()) == 0


def test_grid_fills_the_disc_with_its_area() -> None:
    assert len(pupil_samples("grid:200").x) == pytest.approx(math.pi / 4 * 200**2, rel=2e-3)


@pytest.mark.parametrize(
    "name",
    ["", "hexapolar", "hexapolar:0", "hexapolar:-1", "hexapolar:6x2", "gauss:6", "grid:1.5",
     "spiral:9", "gauss:axb", "grid:²", "fibonacci:9999999999"],
)  # fmt: skip
def test_unknown_sampling_is_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(ContractError, match="hexapolar:RINGS"):
        pupil_samples(name)


@pytest.mark.parametrize("name", ["hexapolar:9999", "gauss:9999x9999", "grid:9999"])
def test_sampling_too_large_for_memory_is_refused(name: str) -> None:
    with pytest.raises(ContractError, match="at most"):
        pupil_samples(name)


def test_unknown_pupil_definition_is_refused() -> None:
    with pytest.raises(ContractError, match="paraxial, chief, stop"):
        Pupil(definition="aimed")  # type: ignore[arg-type]
