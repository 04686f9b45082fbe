from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.psf_bank import read_bank, write_bank


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
    with pytest.raises(ContractError, match="one to train on at least and the last 1"):
        replace(bank, copies=bank.copies[:1])


def test_depths_survive_the_disk_and_are_seen_by_the_digest(bank, tmp_path):
    deep = replace(bank, depths=bank.copies.shape[0] // 2)
    write_bank(tmp_path / "bank.npz", deep)
    assert read_bank(tmp_path / "bank.npz").depths == deep.depths
    assert read_bank(tmp_path / "bank.npz").frozen_depths is None
    with pytest.raises(ContractError, match="does not hold"):
        deep.frozen_kernels(0.1, 0.2, 1)
    apart = replace(deep, frozen_depths=np.stack([deep.frozen, deep.frozen[::-1]]))
    write_bank(tmp_path / "apart.npz", apart)
    again = read_bank(tmp_path / "apart.npz")
    assert (again.digest(), again.digest() == deep.digest()) == (apart.digest(), False)
    assert torch.equal(again.frozen_kernels(0.1, 0.2, 0), deep.frozen_kernels(0.1, 0.2))
    assert not torch.equal(again.frozen_kernels(0.1, 0.2, 1), deep.frozen_kernels(0.1, 0.2))
    other = replace(bank, copies=np.repeat(bank.copies, 2, axis=0))
    assert replace(other, depths=2).digest() != other.digest()


def test_the_copy_for_validation_is_kept_at_all_its_depths(bank):
    deep = replace(bank, copies=np.repeat(bank.copies, 3, axis=0), depths=3)
    assert deep.training_copies == 3 * bank.training_copies


@pytest.mark.parametrize(("copies", "depths"), [(3, 2), (2, 2), (4, 0)])
def test_copies_that_are_not_all_there_at_all_depths_are_refused(bank, copies, depths):
    kernels = np.repeat(bank.copies[:1], copies, axis=0)
    with pytest.raises(ContractError, match="depth"):
        replace(bank, copies=kernels, depths=depths)


def test_several_copies_are_kept_from_training(bank, tmp_path):
    several = replace(bank, copies=np.repeat(bank.copies, 2, axis=0), validation_copies=3)
    assert several.training_copies == 1
    write_bank(tmp_path / "bank.npz", several)
    found = read_bank(tmp_path / "bank.npz")
    assert found.validation_copies == 3
    assert found.digest() == several.digest()
    assert found.digest() != replace(several, validation_copies=2).digest()
    with pytest.raises(ContractError, match="the last 4 for validation"):
        replace(several, validation_copies=4)
