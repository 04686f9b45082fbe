from dataclasses import replace

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.training.psf_bank import read_bank, write_bank


def test_bank_survives_the_disk(bank, tmp_path):
    write_bank(tmp_path / "bank.npz", bank)
    assert read_bank(tmp_path / "bank.npz").digest() == bank.digest()


def test_digest_sees_every_array(bank):
    moved = replace(bank, relative_illumination=bank.relative_illumination * 0.99)
    assert moved.digest() != bank.digest()


def test_kernels_are_normalised_everywhere_and_turn_with_the_azimuth(bank):
    right = bank.blur_kernels(0, 1.5, 0.0)[0]
    down = bank.blur_kernels(0, 0.0, 1.5)[0]
    assert np.allclose(right.sum((-1, -2)), 1, atol=1e-5)
    assert np.allclose(right, down.transpose(-1, -2), atol=1e-6)


def test_bank_without_a_copy_for_validation_is_refused(bank):
    with pytest.raises(ContractError, match="copy >= 2"):
        replace(bank, copies=bank.copies[:1])
