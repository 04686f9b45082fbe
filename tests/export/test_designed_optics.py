"""A bundle holds the lens or the plate that its PSF was frozen from, or none."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import PLATE, PLATE_HEIGHTS, PRESCRIPTION
from camkit.errors import ContractError
from camkit.export.designed_optics import (
    SAME_PLATE_SHARE,
    designed_members,
    designed_of,
)
from camkit.export.parts import Parts
from camkit.models_def.optics.diffraction.etching import Etching
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.patterns import PeakPattern, StarPattern
from camkit.models_def.optics.diffraction.plate import (
    Plate,
    pattern_plate,
    plate_members,
    plate_of_members,
    write_plate,
)
from camkit.models_def.optics.diffraction.plate_optics import plate_kernels
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import format_prescription
from camkit.models_def.training.checkpoint import Checkpoint
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion

BENCH = Bench(diameter_mm=2.0, focal_length_mm=20.0, focus_mm=2000.0)
WAVELENGTHS_UM = (0.47, 0.55, 0.63)
PSF = Path("psf.safetensors")
PARTS = Parts(checkpoints=(), psf=PSF)


def _star(share: float = 0.06, angles_deg: tuple[float, ...] = (0.0, 90.0)) -> Plate:
    pattern = StarPattern(angles_deg=angles_deg, near_um=24.0, far_um=120.0, share=share)
    return pattern_plate("star", pattern, cells=128, bench=BENCH, etching=Etching(range_um=0.3))


def _psf(plate: Plate) -> FrozenPsf:
    light = plate_kernels(
        plate, depths_m=(2.0,), wavelengths_um=WAVELENGTHS_UM, side_px=61, pitch_um=6.0
    )
    return FrozenPsf(
        kernels=(light / light.sum((-2, -1), keepdims=True))[None],
        field_heights_mm=np.zeros(1),
        depths_mm=np.array([2000.0]),
        wavelengths_um=np.array(WAVELENGTHS_UM),
        pixel_pitch_um=6.0,
        distortion=RadialDistortion(
            coefficients=np.tile([[1.0, 0.0, 0.0, 0.0]], (3, 1)), radius_mm=1.0
        ),
        relative_illumination=np.ones(1),
        symmetry="uniform",
    )


def _checkpoint(designed: Mapping[str, bytes]) -> Checkpoint:
    return Checkpoint(
        recipe_toml="",
        size="S",
        network="lean_s",
        config={},
        bank_digest="",
        training_data="",
        step=0,
        elapsed_s=0.0,
        cpu_s=0.0,
        valid_db=None,
        weights={},
        average={},
        optimizer={},
        designed=dict(designed),
    )


def _members(parts: Parts, checkpoints: list[Checkpoint], psf: FrozenPsf) -> dict[str, bytes]:
    return designed_members(parts, designed_of(checkpoints), FrozenOptics(psf=psf))


@pytest.fixture(scope="module")
def star() -> Plate:
    return _star()


@pytest.fixture(scope="module")
def psf(star: Plate) -> FrozenPsf:
    return _psf(star)


def test_the_plate_of_the_checkpoints_is_packed_as_it_is(star: Plate, psf: FrozenPsf) -> None:
    members = plate_members(star)
    assert members.keys() == {PLATE}
    both = [_checkpoint(members), _checkpoint({}), _checkpoint(members)]
    assert _members(PARTS, both, psf) == members


def test_heights_travel_beside_the_plate(star: Plate, psf: FrozenPsf) -> None:
    full = replace(star, pattern=None)
    members = _members(PARTS, [_checkpoint(plate_members(full))], psf)
    assert members.keys() == {PLATE, PLATE_HEIGHTS}
    back = plate_of_members(members, "the bundle")
    assert (back.name, back.bench, back.etching) == (full.name, full.bench, full.etching)
    assert torch.equal(back.height_um, full.height_um)


def test_another_plate_may_be_named_and_none_too(
    star: Plate, psf: FrozenPsf, tmp_path: Path
) -> None:
    own = tmp_path / "mine.toml"
    write_plate(replace(star, name="mine"), own)
    carried = [_checkpoint(plate_members(star))]
    named = _members(replace(PARTS, plate=own), carried, psf)
    assert named == {PLATE: own.read_bytes()}
    assert _members(replace(PARTS, plate=own), [_checkpoint({})], psf) == named
    assert _members(replace(PARTS, without_plate=True), carried, psf) == {}


@pytest.mark.parametrize(
    "other",
    [_star(share=0.12), _star(angles_deg=(45.0, 135.0))],
    ids=["more light", "turned"],
)
def test_a_psf_of_another_plate_is_refused(other: Plate, psf: FrozenPsf) -> None:
    with pytest.raises(ContractError, match=r"not frozen from the plate star: .*use plate=.none."):
        _members(PARTS, [_checkpoint(plate_members(other))], psf)


def test_a_psf_that_holds_its_plate_as_well_as_freezing_asks_is_taken(star: Plate) -> None:
    """Core, arms and haze misplace a part of the light: half of what is allowed."""
    peak = PeakPattern(right_um=72.0, down_um=60.0, share=SAME_PLATE_SHARE / 2)
    aside = pattern_plate("peak", peak, cells=128, bench=BENCH)
    own, off = _psf(star), _psf(aside)
    mixed = own.kernels * (1 - SAME_PLATE_SHARE / 2) + off.kernels * (SAME_PLATE_SHARE / 2)
    near = replace(own, kernels=mixed.astype(np.float32))
    assert _members(PARTS, [_checkpoint(plate_members(star))], near) != {}


def test_a_lens_and_a_plate_are_not_both_packed(star: Plate, psf: FrozenPsf) -> None:
    lens = find_lens("duet", Path())
    text = format_prescription(lens).encode()
    with pytest.raises(ContractError, match="a lens or a plate; here are the lens duet and the pl"):
        _members(PARTS, [_checkpoint({PRESCRIPTION: text, **plate_members(star)})], psf)


def test_checkpoints_of_different_optics_are_refused(star: Plate, psf: FrozenPsf) -> None:
    several = [_checkpoint(plate_members(plate)) for plate in (star, _star(share=0.1))]
    with pytest.raises(ContractError, match="trained with different optics"):
        _members(PARTS, several, psf)


def test_a_plate_that_lost_its_heights_is_refused(star: Plate, psf: FrozenPsf) -> None:
    members = plate_members(replace(star, pattern=None))
    del members[PLATE_HEIGHTS]
    with pytest.raises(ContractError, match=r"lacks its heights, plate\.safetensors"):
        _members(PARTS, [_checkpoint(members)], psf)


def test_optics_that_were_not_designed_here_leave_nothing_to_pack(psf: FrozenPsf) -> None:
    assert _members(PARTS, [_checkpoint({})], psf) == {}
