"""The kernel of a plate: a softmax, a file, a checkpoint."""

from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.bundle.psf_file import write_psf
from camkit.errors import BundleError, ContractError
from camkit.models_def.kinds.spad.plate_psf import (
    SoftmaxPsf,
    frozen_psf,
    read_plate_psf,
    softmax_psf,
    write_plate_psf,
)
from camkit.models_def.kinds.spad.sampling import gaussian_psf, make_sampling
from camkit.models_def.optics.measured import measured_psf


def test_it_begins_as_the_gaussian() -> None:
    np.testing.assert_allclose(SoftmaxPsf()().detach().numpy(), gaussian_psf(), atol=1e-7)
    np.testing.assert_allclose(SoftmaxPsf(1.2)().detach().numpy(), gaussian_psf(1.2), atol=1e-7)


@pytest.mark.parametrize("spread", [1.0, 30.0, 1000.0])
def test_any_logits_make_a_kernel_that_samples(spread: float) -> None:
    logits = spread * torch.randn(11, 11, generator=torch.Generator().manual_seed(0))
    kernel = softmax_psf(logits)
    assert kernel.min() >= 0
    assert float(kernel.sum()) == pytest.approx(1, abs=1e-6)
    make_sampling("learned", kernel=kernel.numpy())


def test_a_weight_that_fell_to_nothing_comes_back() -> None:
    """A squared weight would stay at 0."""
    plate = SoftmaxPsf()
    with torch.no_grad():
        plate.logits[0, 0] = -12.0
    optimizer = torch.optim.Adam(plate.parameters(), lr=0.1)
    for _ in range(300):
        optimizer.zero_grad()
        (1 - plate()[0, 0]).square().backward()
        optimizer.step()
    assert float(plate().detach()[0, 0]) > 0.9


def test_a_kernel_comes_back_from_its_file_on_the_fine_grid(tmp_path: Path) -> None:
    kernel = np.random.default_rng(0).random((11, 11)).astype(np.float32)
    kernel /= kernel.sum()
    path = tmp_path / "plate.safetensors"
    write_plate_psf(path, kernel)
    np.testing.assert_allclose(read_plate_psf(path), kernel, rtol=1e-6)
    frozen = frozen_psf(kernel)
    assert (frozen.pixel_pitch_um, frozen.symmetry) == (37.5, "uniform")


@pytest.mark.parametrize(
    ("side", "pitch_um", "message"),
    [(9, 37.5, "one kernel of 11x11"), (11, 30.0, "samples of 37.5 um; got 30")],
)
def test_the_psf_of_something_else_is_refused(
    side: int, pitch_um: float, message: str, tmp_path: Path
) -> None:
    other = measured_psf(np.ones((1, side, side)), pixel_pitch_um=pitch_um, wavelengths_um=(0.655,))
    write_psf(tmp_path / "other.safetensors", other)
    with pytest.raises(ContractError, match=message):
        read_plate_psf(tmp_path / "other.safetensors")


def test_what_is_no_file_of_either_sort_is_refused(tmp_path: Path) -> None:
    (tmp_path / "plate.pt").write_bytes(b"no checkpoint")
    with pytest.raises(ContractError, match="no checkpoint of camkit"):
        read_plate_psf(tmp_path / "plate.pt")
    with pytest.raises(BundleError, match=r"plate\.safetensors"):
        read_plate_psf(tmp_path / "plate.safetensors")
