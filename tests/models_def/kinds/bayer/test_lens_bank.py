import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer import lens_bank
from camkit.models_def.kinds.bayer.lens_bank import build_lens_bank
from camkit.models_def.optics.kernel_bank import fabricated_copies
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import format_prescription
from tests.gaussian_bank import gaussian_bank

DUET = find_lens("duet")
GAUSSIAN = {"sensor_height_mm": 2.0, "axis_px": 1.0, "corner_px": 2.0}


@pytest.fixture(scope="module")
def small(recipe):
    lens = replace(recipe.lens, copies=1, fields=2, rays=300, kernel_px=65)
    return replace(recipe, lens=lens)


@pytest.fixture(scope="module")
def traced(small):
    return build_lens_bank(small, DUET)


def test_bank_has_the_copies_to_train_on_and_one_to_validate(traced):
    assert traced.training_copies == 1
    assert traced.copies.shape == (2, 2, 3, 65, 65)
    assert traced.frozen.shape == (2, 3, 65, 65)
    assert np.allclose(traced.copies.sum((-1, -2)), 1, atol=1e-4)
    assert traced.relative_illumination[0] == pytest.approx(1.0)


def test_copies_are_focused_like_the_design(small, traced, monkeypatch):
    """Copies that are not focused afresh differ more from the design on the axis."""
    monkeypatch.setattr(lens_bank, "focused_copies", fabricated_copies)
    unfocused = build_lens_bank(small, DUET)
    gaps = [np.abs(b.copies[:, 0] - b.frozen[0]).sum() for b in (traced, unfocused)]
    assert 0 < gaps[0] < 0.8 * gaps[1]


def test_a_traced_bank_is_kept_and_read_again(small, traced, tmp_path, monkeypatch):
    first = build_lens_bank(small, DUET, tmp_path)
    monkeypatch.setattr(lens_bank, "_trace", lambda *_: pytest.fail("traced twice"))
    assert build_lens_bank(small, DUET, tmp_path).digest() == first.digest() == traced.digest()


def test_kernels_that_lose_light_are_refused(small):
    narrow = replace(small, lens=replace(small.lens, kernel_px=3))
    with pytest.raises(ContractError, match=r"raise lens\.kernel_px"):
        build_lens_bank(narrow, DUET)


def test_several_depths_give_every_copy_at_each_and_their_mean_kernel(small, traced):
    lens = replace(small.lens, depths_mm=(2e4, math.inf), kernel_px=97)
    deep = build_lens_bank(replace(small, lens=lens), DUET)
    assert (deep.copies.shape[0], deep.training_copies, deep.depths) == (4, 2, 2)
    far = deep.copies[:, :, :, 16:-16, 16:-16][1::2]
    assert np.allclose(far / far.sum((-1, -2), keepdims=True), traced.copies, atol=1e-4)
    near = replace(lens, depths_mm=(2e4,))
    each = [build_lens_bank(replace(small, lens=near), DUET).frozen]
    each.append(build_lens_bank(replace(small, lens=replace(lens, depths_mm=())), DUET).frozen)
    assert np.allclose(deep.frozen, np.mean(each, axis=0), atol=1e-7)
    assert np.abs(each[0] - each[1]).max() > 1e-3
    assert deep.frozen_depths is None
    known = replace(small.data, known_depth_share=0.5)
    apart = build_lens_bank(replace(small, lens=lens, data=known), DUET).frozen_depths
    assert np.allclose(apart, each, atol=1e-7)


def test_banks_without_depths_keep_the_names_of_their_files(small, tmp_path, monkeypatch):
    """Named by prescription, plan, camera and way of tracing; a plan without depths has no word."""
    monkeypatch.setattr(lens_bank, "_trace", lambda *_: gaussian_bank(**GAUSSIAN))
    build_lens_bank(small, DUET, tmp_path)
    (made,) = tmp_path.iterdir()
    names = ("prescription", "copies", "fields", "kernel_px", "rays", "seed")
    plan = {name: getattr(small.lens, name) for name in names}
    content = format_prescription(DUET) + json.dumps(plan) + small.sensor.model_dump_json()
    content += str(lens_bank.TRACING)
    assert made.name == f"bank-{hashlib.sha256(content.encode()).hexdigest()[:16]}.npz"
    monkeypatch.setattr(lens_bank, "TRACING", lens_bank.TRACING + 1)
    build_lens_bank(small, DUET, tmp_path)
    assert len([*tmp_path.iterdir()]) == 2
