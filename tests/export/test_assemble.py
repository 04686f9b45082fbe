"""A checkpoint becomes a bundle that proves itself, or nothing is written."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from camkit.bundle.golden import IMAGE, golden_from_bytes
from camkit.bundle.haze_file import write_haze
from camkit.bundle.psf_file import write_psf
from camkit.bundle.reader import GOLDEN, HAZE_GOLDEN, Bundle, open_bundle
from camkit.errors import ContractError, ParityError
from camkit.export import assemble
from camkit.export.assemble import export_bundle
from camkit.export.network_facts import ExportedNetwork
from camkit.export.parts import Parts
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.training.checkpoint import Checkpoint, write_checkpoint
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.runtime.plan.loss import plan_entries
from camkit.runtime.proof.golden_run import case_work
from tests.deep_bundle import deep_psf
from tests.haze_factory import CELL_PX, tiny_haze
from tests.plan_factory import MODEL
from tests.traced_once import traced_once  # noqa: F401

_MEASURED: dict[str, ExportedNetwork] = {}
ENTRIES = plan_entries(MODEL, adaptive_cost_db=0.05, draft_cost_db=0.3)

RECIPE = """
name = "small"
object_distance_mm = inf

[sensor]
width_px = 640
height_px = 560
pixel_pitch_um = 6.0
cfa = "GRBG"
black_level = 64.0
white_level = 4095.0
full_well_e = 20000.0
noise = [{ iso = 100.0, gain_e_per_dn = 5.0, read_noise_e = 3.0 }]
color_matrix = [[0.9, -0.2, -0.1], [-0.4, 1.2, 0.2], [-0.1, 0.2, 0.7]]

[sensor.channel_response]
wavelengths_um = [0.45, 0.55, 0.62]
response = [[0.0, 0.1, 1.0], [0.1, 1.0, 0.1], [1.0, 0.1, 0.0]]
source = "made up for tests"

[wiener]
block_px = 128
overlap_px = 32
prior_scale = 1e-3
prior_exponent = 2.0
clip_iterations = 2

[lens]
prescription = "none"

[networks.S]
network = "lean_s"
"""


def _psf() -> FrozenPsf:
    at = np.arange(-4, 5)
    gaussian = np.exp(-np.add.outer(at**2, at**2) / 4.5)
    kernels = np.tile(gaussian / gaussian.sum(), (3, 1, 3, 1, 1)).astype(np.float32)
    return FrozenPsf(
        kernels=kernels,
        field_heights_mm=np.array([0.0, 1.3, 2.6]),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array([0.45, 0.55, 0.62]),
        pixel_pitch_um=6.0,
        distortion=RadialDistortion(
            coefficients=np.tile([1.0, -0.02, 0.0, 0.0], (3, 1)), radius_mm=2.55
        ),
        relative_illumination=np.array([1.0, 0.9, 0.8]),
    )


def _checkpoint(size: str = "S") -> Checkpoint:
    torch.manual_seed(0)
    network = build_network("lean_s")
    for parameter in network.parameters():
        if not parameter.abs().max():
            torch.nn.init.normal_(parameter, std=1e-3)
    return Checkpoint(
        recipe_toml=RECIPE,
        size=size,
        network="lean_s",
        config={},
        bank_digest="",
        training_data="nothing",
        step=0,
        elapsed_s=0.0,
        cpu_s=0.0,
        valid_db=None,
        weights=network.state_dict(),
        average=network.state_dict(),
        optimizer={},
    )


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Parts:
    folder = tmp_path_factory.mktemp("parts")
    write_psf(folder / "psf.safetensors", _psf())
    write_checkpoint(folder / "s.pt", _checkpoint())
    return Parts(checkpoints=(folder / "s.pt",), psf=folder / "psf.safetensors")


@pytest.fixture(autouse=True, scope="module")
def _measure_each_network_once() -> Iterator[None]:
    """The facts of the one network of these tests are measured in the first of them."""
    honest = assemble.measure_network

    def remembered(draft: ExportedNetwork, network: Any, windows: Any) -> ExportedNetwork:
        name = draft.facts.member
        if name not in _MEASURED:
            _MEASURED[name] = honest(draft, network, windows)
        return _MEASURED[name]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assemble, "measure_network", remembered)
        yield


@pytest.fixture(scope="module")
def exported(
    parts: Parts, tmp_path_factory: pytest.TempPathFactory, _measure_each_network_once: None
) -> tuple[dict[str, Any], Bundle]:
    """What export says, and the bundle: with a calibration."""
    folder = tmp_path_factory.mktemp("exported")
    text = json.dumps({name: entry.model_dump() for name, entry in ENTRIES.items()})
    (folder / "plan.json").write_text(text, encoding="utf-8")
    report = export_bundle(replace(parts, plan=folder / "plan.json"), folder / "small.camkit")
    return report, open_bundle(folder / "small.camkit")


def test_an_exported_bundle_states_measured_facts_and_repeats_its_golden_cases(
    exported: tuple[dict[str, Any], Bundle],
) -> None:
    report, bundle = exported
    facts = bundle.network_facts("restore", "S")
    assert facts.reach_px <= 64
    assert facts.halo_error[-1].max_abs == 0
    assert facts.halo_error[0].max_abs > 0
    assert facts.fp16_safe
    assert {case.name for case in bundle.manifest.golden} == {"typical", "saturated", "very_dark"}
    arrays = golden_from_bytes(bundle.member(GOLDEN))
    for case in bundle.manifest.golden:
        again = case_work(bundle, case, arrays[case.name], "S").fill()
        stored = arrays[case.name].outputs[IMAGE]["S"]
        np.testing.assert_array_equal(again.astype(np.float16), stored.astype(np.float16))
    assert report["warning"] == "the network S was not trained: step 0"
    assert report["bytes"] == Path(report["bundle"]).stat().st_size
    assert b"95 % energy" in bundle.member("card.md")


def test_nothing_is_written_when_the_bundle_fails_its_check(
    parts: Parts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = assemble.add_outputs

    def lie(*arguments: object) -> object:
        cases = honest(*arguments)  # type: ignore[arg-type]
        return {
            name: replace(case, outputs={IMAGE: {"S": case.outputs[IMAGE]["S"] + 1.0}})
            for name, case in cases.items()
        }

    monkeypatch.setattr(assemble, "add_outputs", lie)
    with pytest.raises(ParityError, match="fails its own check"):
        export_bundle(parts, tmp_path / "wrong.camkit")
    assert not list(tmp_path.iterdir())


def test_two_checkpoints_of_one_size_are_refused(parts: Parts, tmp_path: Path) -> None:
    twice = replace(parts, checkpoints=parts.checkpoints * 2)
    with pytest.raises(ContractError, match="keep one"):
        export_bundle(twice, tmp_path / "x.camkit")


def test_a_size_that_no_bundle_holds_must_be_alone(parts: Parts, tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "other.pt", _checkpoint("trimmed"))
    both = replace(parts, checkpoints=(*parts.checkpoints, tmp_path / "other.pt"))
    with pytest.raises(ContractError, match="alone in its role"):
        export_bundle(both, tmp_path / "x.camkit")


def test_sizes_that_differ_from_checkpoint_to_checkpoint_are_of_one_camera(
    parts: Parts, tmp_path: Path
) -> None:
    other = replace(
        _checkpoint("M"), recipe_toml=RECIPE.replace("full_well_e = 20000", "full_well_e = 10000")
    )
    write_checkpoint(tmp_path / "m.pt", other)
    both = replace(parts, checkpoints=(*parts.checkpoints, tmp_path / "m.pt"))
    with pytest.raises(ContractError, match=r"m\.pt has another sensor"):
        export_bundle(both, tmp_path / "x.camkit")


def test_a_role_that_the_kind_does_not_have_is_refused(parts: Parts, tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "m.pt", replace(_checkpoint("M"), role="sharpen"))
    both = replace(parts, checkpoints=(*parts.checkpoints, tmp_path / "m.pt"))
    with pytest.raises(ContractError, match=r"role 'sharpen'.*has restore"):
        export_bundle(both, tmp_path / "x.camkit")


def test_no_checkpoint_is_refused(parts: Parts, tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="at least one"):
        export_bundle(replace(parts, checkpoints=()), tmp_path / "x.camkit")


def test_a_calibration_becomes_the_plan_of_the_bundle(
    exported: tuple[dict[str, Any], Bundle],
) -> None:
    assert exported[1].manifest.plan == ENTRIES


@pytest.mark.parametrize("text", ["no JSON", "[]", '{"exact.level": 3}'])
def test_what_is_no_calibration_is_refused(parts: Parts, tmp_path: Path, text: str) -> None:
    (tmp_path / "plan.json").write_text(text, encoding="utf-8")
    with pytest.raises(ContractError, match=r"plan\.json is no calibration"):
        export_bundle(replace(parts, plan=tmp_path / "plan.json"), tmp_path / "x.camkit")


HAZY_RECIPE = RECIPE.replace("[wiener]", f"[haze]\nshrink = {CELL_PX}\nterms = 8\n\n[wiener]")


@pytest.fixture(scope="module")
def hazy_parts(tmp_path_factory: pytest.TempPathFactory) -> Parts:
    folder = tmp_path_factory.mktemp("hazy")
    write_psf(folder / "psf.safetensors", _psf())
    write_haze(folder / "haze.safetensors", tiny_haze(_psf()))
    # of a size of its own: its network is measured behind the haze
    write_checkpoint(folder / "m.pt", replace(_checkpoint("M"), recipe_toml=HAZY_RECIPE))
    return Parts(
        checkpoints=(folder / "m.pt",),
        psf=folder / "psf.safetensors",
        haze=folder / "haze.safetensors",
    )


@pytest.fixture(scope="module")
def stress_parts(hazy_parts: Parts, tmp_path_factory: pytest.TempPathFactory) -> Parts:
    """The same with what it is at other distances."""
    folder = tmp_path_factory.mktemp("stress")
    stress, beside = (folder / f"{name}.safetensors" for name in ("psf", "haze"))
    write_psf(stress, _psf())
    write_haze(beside, tiny_haze(_psf(), share=0.4))
    return replace(hazy_parts, stress_psf=stress, stress_haze=beside)


def test_a_camera_with_a_haze_is_exported_with_its_case_of_cells_and_other_distances(
    stress_parts: Parts, tmp_path: Path
) -> None:
    report = export_bundle(stress_parts, tmp_path / "hazy.camkit")
    bundle = open_bundle(tmp_path / "hazy.camkit")
    assert bundle.manifest.format_version == "2.12"
    types = [stage.type for stage in bundle.manifest.stages]
    assert types[types.index("demosaic") + 1 :][:3] == ["haze", "wiener", "network"]
    assert HAZE_GOLDEN in bundle.names
    assert any("the haze of 80 x 70 cells" in str(line) for line in report.values())
    found = bundle.stress_haze()
    assert found is not None
    np.testing.assert_array_equal(found.kernels, tiny_haze(_psf(), share=0.4).kernels)


def test_a_haze_of_other_distances_goes_with_its_psf_and_a_haze(
    parts: Parts, stress_parts: Parts, tmp_path: Path
) -> None:
    beside = stress_parts.stress_haze
    for bad in (replace(stress_parts, stress_psf=None), replace(parts, stress_haze=beside)):
        with pytest.raises(ContractError, match="haze of kernels off the design point"):
            export_bundle(bad, tmp_path / "x.camkit")
    write_haze(tmp_path / "deep.safetensors", tiny_haze(deep_psf()))
    deep = replace(stress_parts, stress_haze=tmp_path / "deep.safetensors")
    with pytest.raises(ContractError, match=r"different (depths|field_heights)_mm"):
        export_bundle(deep, tmp_path / "x.camkit")
    assert not (tmp_path / "x.camkit").exists()


def test_a_haze_and_the_stage_that_undoes_it_come_together(
    parts: Parts, hazy_parts: Parts, tmp_path: Path
) -> None:
    with pytest.raises(ContractError, match=r"the recipe small removes veiling glare: .* add haze"):
        export_bundle(replace(hazy_parts, haze=None), tmp_path / "x.camkit")
    with pytest.raises(ContractError, match=r"undoes no haze, but there is .*haze\.safetensors"):
        export_bundle(replace(parts, haze=hazy_parts.haze), tmp_path / "x.camkit")
