"""Each configuration is frozen as it would be alone, and all go into one file."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.frozen_optics import read_optics_file
from camkit.bundle.sensor import Extent
from camkit.errors import ContractError
from camkit.export.designed_optics import designed_members
from camkit.export.parts import Parts
from camkit.models_def.face.optics_freezing import freeze
from camkit.models_def.face.state_freezing import freeze_states
from camkit.models_def.optics.freezer import FreezeRequest, freeze_optics
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.optics_file import read_states
from camkit.models_def.optics.paraxial import paraxial_data
from tests.planes_bundle import planes_sensor

PRESCRIPTIONS = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions"
STATES = """
[[configuration]]
name = "far"

[[configuration]]
name = "near"
thickness_mm = { 2 = 1.1 }
object_distance_mm = 2000.0
"""
EXTENT = Extent(width_px=32, height_px=32, pixel_pitch_um=20.0)
REQUEST = FreezeRequest(sensor=planes_sensor(("a",), extent=EXTENT), quick=True, psf_model="rays")


@pytest.fixture(name="lens_file")
def fixture_lens_file(tmp_path: Path) -> Path:
    path = tmp_path / "focusing.toml"
    path.write_text((PRESCRIPTIONS / "cooke-triplet.toml").read_text() + STATES)
    return path


def test_every_state_has_the_psf_that_it_has_alone(lens_file: Path, tmp_path: Path) -> None:
    sources = [LensOptics(lens=one.lens, rays=256) for one in read_states(lens_file)]
    frozen = freeze_states(sources, lambda _: REQUEST)
    path = tmp_path / "psf.safetensors"
    path.write_bytes(frozen.optics.member[1])
    back = read_optics_file(path, channels=1)
    assert [state.name for state in back.states] == ["far", "near"]
    for source, state in zip(sources, back.states, strict=True):
        alone = freeze_optics(source, REQUEST)
        np.testing.assert_array_equal(state.psf.kernels, alone.optics.psf.kernels)
        data = paraxial_data(source.lens)
        numbers = (data.efl_mm, data.f_number, source.lens.object_distance_mm)
        assert (state.efl_mm, state.f_number, state.object_distance_mm) == numbers
        assert frozen.facts[f"{state.name}.side_px"] == alone.facts["side_px"]
    assert frozen.facts["configurations"] == "far, near"
    parts = Parts(checkpoints=(), psf=path, prescription=lens_file)
    assert b'name = "near"' in designed_members(parts, {}, back)["prescription.toml"]
    lens_file.write_text(lens_file.read_text().replace('"near"', '"close"'))
    with pytest.raises(ContractError, match=r"the configurations near, which the lens .* lacks"):
        designed_members(parts, {}, back)


def test_states_are_chosen_by_name_or_number_the_usual_one_first(lens_file: Path) -> None:
    text = lens_file.read_text()
    lens_file.write_text('default_configuration = "near"\n' + text)
    assert [one.lens.state for one in read_states(lens_file)] == ["near", "far"]
    assert [one.lens.state for one in read_states(lens_file, configurations=("far", 2))] == [
        "far",
        "near",
    ]
    assert [one.lens.state for one in read_states(lens_file, configurations="far")] == ["far"]
    with pytest.raises(ContractError, match="one of far, near"):
        read_states(lens_file, configurations=["tele"])
    with pytest.raises(ContractError, match="has no configurations"):
        read_states(Path("cooke-triplet"))
    with pytest.raises(ContractError, match="is no lens"):
        read_states(Path("no.safetensors"))


def test_what_is_for_one_state_is_refused_beside_several(lens_file: Path, tmp_path: Path) -> None:
    for options in ({"configuration": "far"}, {"haze": "h"}, {"stress_out": "s"}):
        with pytest.raises(ContractError, match="does not apply with configurations"):
            freeze(lens_file, tmp_path / "p.safetensors", configurations="all", **options)
