from dataclasses import replace

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.kernel_bank import fabricated_copies
from camkit.models_def.training import lens_bank
from camkit.models_def.training.lens_bank import build_lens_bank


@pytest.fixture(scope="module")
def small(recipe):
    lens = replace(recipe.lens, copies=1, fields=2, rays=300, kernel_px=65)
    return replace(recipe, lens=lens)


@pytest.fixture(scope="module")
def traced(small):
    return build_lens_bank(small)


def test_bank_has_the_copies_to_train_on_and_one_to_validate(traced):
    assert traced.training_copies == 1
    assert traced.copies.shape == (2, 2, 3, 65, 65)
    assert traced.frozen.shape == (2, 3, 65, 65)
    assert np.allclose(traced.copies.sum((-1, -2)), 1, atol=1e-4)
    assert traced.relative_illumination[0] == pytest.approx(1.0)


def test_copies_are_focused_like_the_design(small, traced, monkeypatch):
    """Copies that are not focused afresh differ more from the design on the axis."""
    monkeypatch.setattr(lens_bank, "focused_copies", fabricated_copies)
    unfocused = build_lens_bank(small)
    gaps = [np.abs(b.copies[:, 0] - b.frozen[0]).sum() for b in (traced, unfocused)]
    assert 0 < gaps[0] < 0.8 * gaps[1]


def test_a_traced_bank_is_kept_and_read_again(small, traced, tmp_path, monkeypatch):
    first = build_lens_bank(small, tmp_path)
    monkeypatch.setattr(lens_bank, "_trace", lambda *_: pytest.fail("traced twice"))
    assert build_lens_bank(small, tmp_path).digest() == first.digest() == traced.digest()


def test_kernels_that_lose_light_are_refused(small):
    narrow = replace(small, lens=replace(small.lens, kernel_px=3))
    with pytest.raises(ContractError, match=r"raise lens\.kernel_px"):
        build_lens_bank(narrow)
