"""Configurations of a lens live in one file by name; a bundle has one of them in use."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from safetensors.numpy import load, save

from camkit.bundle.frozen_optics import FrozenOptics, optics_from_bytes, optics_of_states
from camkit.bundle.optics import PSF, FrozenPsfOptics, StatesEntry
from camkit.bundle.psf_file import STATES, psf_from_bytes, psf_to_bytes, read_psf
from camkit.bundle.reader import bundle_from_bytes
from camkit.bundle.writer import bundle_to_bytes
from camkit.errors import BundleError, ContractError
from tests.bundle_factory import tiny_members, tiny_psf
from tests.deep_bundle import deep_psf, write_deep_bundle
from tests.states_bundle import states_manifest, two_states, write_states_bundle

Tensors = dict[str, NDArray[Any]]


def test_states_come_back_bit_for_bit_in_their_order() -> None:
    optics = two_states()
    name, data = optics.member
    back = optics_from_bytes(data, what=name, channels=3)
    assert (name, back.member, back.state) == (PSF, optics.member, "wide")
    assert [state.name for state in back.states] == ["wide", "long / near"]
    for ours, theirs in zip(back.states, optics.states, strict=True):
        assert psf_to_bytes(ours.psf) == psf_to_bytes(theirs.psf)
        numbers = [(s.efl_mm, s.f_number, s.object_distance_mm) for s in (ours, theirs)]
        assert numbers[0] == numbers[1]
    assert back.with_state("long / near").psf is back.states[1].psf
    assert back.with_state(2).state == "long / near"
    with pytest.raises(ContractError, match=r"wide, long / near, or a number 1..2; got 'tele'"):
        back.with_state("tele")


def test_who_knows_one_psf_refuses_several(tmp_path: Path) -> None:
    _, data = two_states().member
    with pytest.raises(BundleError, match=r"holds several configurations .* with configuration"):
        psf_from_bytes(data)
    (tmp_path / "psf.safetensors").write_bytes(data)
    with pytest.raises(BundleError, match="holds several configurations"):
        read_psf(tmp_path / "psf.safetensors")


def _without(key: str) -> Callable[[Tensors], Tensors]:
    return lambda tensors: {name: a for name, a in tensors.items() if name != key}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_without("wide/efl_mm"), "wide/efl_mm must be float64"),
        (_without("wide/kernels"), "configuration wide must hold .* missing: kernels"),
        (lambda t: t | {"tele/efl_mm": np.ones(1)}, "tele/efl_mm is of none of the conf"),
        (lambda t: t | {"efl_mm": np.ones(1)}, "efl_mm is of none of the configurations"),
        (lambda t: t | {"wide/f_number": np.zeros(1)}, "f_number must be > 0"),
        (lambda t: t | {"wide/pixel_pitch_um": np.ones(1)}, "differ in pixel pitch"),
        (lambda t: t | {STATES: np.frombuffer(b"wide\n\nlong / near", np.uint8)}, "names in UTF-8"),
        (lambda t: t | {STATES: np.frombuffer(b"wide\nwide", np.uint8)}, "each once"),
        (lambda t: t | {STATES: np.frombuffer(b"\xff", np.uint8)}, "names in UTF-8"),
        (lambda t: t | {STATES: np.ones(4)}, "names in UTF-8"),
    ],
)
def test_a_damaged_file_of_states_is_refused(
    change: Callable[[Tensors], Tensors], message: str
) -> None:
    tensors = change(load(two_states().member[1]))
    with pytest.raises(BundleError, match=message):
        optics_from_bytes(save(tensors), what=PSF, channels=3)


def test_states_are_of_one_lens_and_named() -> None:
    wide, long = two_states().states
    with pytest.raises(ContractError, match="names of their own"):
        optics_of_states((wide, replace(long, name="wide")))
    with pytest.raises(ContractError, match="differ in pixel pitch"):
        optics_of_states((wide, replace(long, psf=tiny_psf(pitch_um=5.0))))
    for name in ("", "a\nb"):
        with pytest.raises(ContractError, match="a name of one line"):
            replace(wide, name=name)
    with pytest.raises(ContractError, match="are not those of configuration wide"):
        FrozenOptics(psf=deep_psf(), states=(wide, long), state="wide")


def test_a_bundle_has_one_state_in_use_and_all_by_name(tmp_path: Path) -> None:
    bundle = write_states_bundle(tmp_path)
    assert bundle.configurations == ("wide", "long / near")
    assert (bundle.configuration, bundle.reference_depth_mm) == ("wide", np.inf)
    assert bundle.psf.kernels.shape[-1] == 5
    near = bundle.with_configuration(2)
    assert (near.configuration, near.reference_depth_mm) == ("long / near", 1000.0)
    assert (near.psf.kernels.shape[-1], near.sha256) == (13, bundle.sha256)
    assert near.with_configuration(None).configuration == "wide"
    one = write_deep_bundle(tmp_path)
    assert (one.configurations, one.configuration) == ((), "")
    assert one.with_configuration(None) is one
    with pytest.raises(ContractError, match="has one configuration; leave configuration out"):
        one.with_configuration("wide")


def test_a_manifest_that_contradicts_the_file_is_refused() -> None:
    manifest, members = states_manifest(), tiny_members() | two_states().members
    entry = manifest.optics
    assert isinstance(entry, StatesEntry)
    swapped = entry.model_copy(update={"configurations": entry.configurations[::-1]})
    plain = FrozenPsfOptics(pixel_pitch_um=entry.pixel_pitch_um)
    for optics, message in ((swapped, "long / near, wide"), (plain, "the manifest says none")):
        data = bundle_to_bytes(manifest.model_copy(update={"optics": optics}), members)
        with pytest.raises(BundleError, match=message):
            bundle_from_bytes(data, path=Path("x.camkit"))
    old = manifest.model_copy(update={"format_version": "2.11"})
    with pytest.raises(BundleError, match=r"several configurations, which format 2\.12 brought"):
        bundle_from_bytes(bundle_to_bytes(old, members), path=Path("x.camkit"))
    data = bundle_to_bytes(manifest, tiny_members())
    with pytest.raises(BundleError, match="configurations none, the manifest says wide"):
        bundle_from_bytes(data, path=Path("x.camkit"))
