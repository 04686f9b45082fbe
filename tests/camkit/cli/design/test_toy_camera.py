"""A camera that no file of camkit knows is exported by the same command, and processes captures.

Two networks in a row, one channel, a picture twice as fine as the sensor: see `tests/toy_camera`.
"""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.golden import IMAGE, golden_from_bytes
from camkit.bundle.reader import GOLDEN, open_bundle
from camkit.cli.app import run
from camkit.errors import ContractError
from camkit.export.assemble import export_bundle
from camkit.export.parts import Parts
from camkit.models_def.training.checkpoint import read_checkpoint, write_checkpoint
from camkit.models_def.training.trainer import TrainOptions, train
from tests.toy_camera.install import toy_installed  # noqa: F401
from tests.toy_camera.recipe import ROLES, STREAKS, write_toy
from tests.traced_once import traced_once  # noqa: F401

pytestmark = pytest.mark.usefixtures("toy_installed")
PSF_NAME = "psf.safetensors"
STEPS = 12


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory: pytest.TempPathFactory, toy_installed: None) -> list[Path]:  # noqa: F811
    """Both networks, hardly trained, beside the PSF that was measured."""
    folder = tmp_path_factory.mktemp("toy")
    recipe = write_toy(folder)
    shutil.copy(folder / STREAKS, folder / PSF_NAME)
    return [
        train(recipe, TrainOptions(out_dir=folder, size="S", role=role, steps=STEPS)).checkpoint
        for role in ROLES
    ]


@pytest.fixture(scope="module")
def exported(checkpoints: list[Path]) -> Path:
    """The camera as a bundle, by the command."""
    path = checkpoints[0].parent / "toy.camkit"
    assert run(["export", *map(str, checkpoints), "-o", str(path)]) == 0
    return path


def test_it_is_exported_proved_and_processes_what_it_photographs(
    exported: Path, tmp_path: Path, camkit_command: Any
) -> None:
    path, bundle = exported, open_bundle(exported)
    manifest = bundle.manifest
    assert (manifest.kind, manifest.sizes, set(manifest.networks)) == ("toy", ("S",), set(ROLES))
    assert manifest.optics is not None
    assert manifest.optics.symmetry == "grid"
    facts = bundle.network_facts("upscale", "S")
    assert (facts.input_channels, facts.output_channels, facts.output_scale) == (1, 1, 2)
    assert 0 < facts.reach_px <= 8
    assert facts.halo_error[-1].max_abs == 0
    for case in golden_from_bytes(bundle.member(GOLDEN)).values():
        side = 2 * case.capture.shape[-1]
        assert case.outputs[IMAGE]["S"].shape == case.reference.shape == (3, side, side)
    checked = camkit_command("check", path, "--json")
    assert checked.code == 0, checked.err
    states = {layer["name"]: layer["status"] for layer in json.loads(checked.out)["layers"]}
    assert states == dict.fromkeys(states, "pass") | {"laws": "skip"}
    shot = tmp_path / "shot.tif"
    camkit_command("simulate", "procedural:3", "--bundle", path, "-o", shot, "--size-px", "96,64")
    done = camkit_command("process", shot, "--bundle", path, "--out-dir", tmp_path / "out")
    assert done.code == 0, done.err
    assert (tmp_path / "out" / "shot.exr").is_file()


def test_the_golden_picture_is_that_of_the_scene(exported: Path) -> None:
    typical = golden_from_bytes(open_bundle(exported).member(GOLDEN))["typical"]
    inside = np.s_[:, 24:-24, 24:-24]
    gap = typical.outputs[IMAGE]["S"][inside] - typical.reference[inside]
    assert np.sqrt(np.mean(gap**2)) < 0.5 * typical.reference[inside].std()


def test_every_role_must_be_there_in_the_same_sizes(
    checkpoints: list[Path], tmp_path: Path
) -> None:
    psf = checkpoints[0].parent / PSF_NAME
    with pytest.raises(ContractError, match="no checkpoint of the role upscale, size S"):
        export_bundle(Parts(checkpoints=(checkpoints[0],), psf=psf), tmp_path / "x.camkit")
    larger = tmp_path / "m.pt"
    write_checkpoint(larger, replace(read_checkpoint(checkpoints[0]), size="M"))
    with pytest.raises(ContractError, match="no checkpoint of the role upscale, size M"):
        export_bundle(Parts(checkpoints=(*checkpoints, larger), psf=psf), tmp_path / "x.camkit")
    assert not list(tmp_path.glob("*.camkit"))
