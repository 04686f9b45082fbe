"""Sharp pictures take the places of some true ones, as bright as those."""

import numpy as np
import pytest
import torch

from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError
from camkit.models_def.training.adversarial.sharp import SharpCrops


def light(pictures):
    return decode_srgb(pictures.numpy()).mean((1, 2, 3))


def test_a_share_is_replaced_by_crops_as_bright_as_what_they_replace(sharp_folder):
    real = torch.rand(8, 3, 32, 32) * torch.linspace(0.2, 0.6, 8).reshape(-1, 1, 1, 1)
    before = real.clone()
    mixed = SharpCrops(sharp_folder).put_among(np.random.default_rng(3), real, 0.5)
    replaced = (mixed != real).flatten(1).any(1)
    assert 0 < int(replaced.sum()) < 8
    assert np.allclose(light(mixed), light(real), rtol=0.05)
    assert torch.equal(real, before)


def test_none_and_all_are_replaced_at_the_ends_and_the_generator_decides(sharp_folder):
    real, crops = torch.rand(4, 3, 32, 32), SharpCrops(sharp_folder)
    assert torch.equal(crops.put_among(np.random.default_rng(3), real, 0.0), real)
    drawn = [crops.put_among(np.random.default_rng(seed), real, 1.0) for seed in (3, 3, 4)]
    assert (drawn[0] != real).flatten(1).any(1).all()
    assert torch.equal(drawn[0], drawn[1])
    assert not torch.equal(drawn[0], drawn[2])


def test_a_folder_without_pictures_is_refused(tmp_path):
    with pytest.raises(ContractError, match="holds no picture"):
        SharpCrops(tmp_path)
