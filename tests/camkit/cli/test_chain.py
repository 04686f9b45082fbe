"""The whole chain by its commands: train, export, check, simulate, process.

For a camera behind a mosaic, and for one whose pictures somebody else developed.
"""

import json
from pathlib import Path

import cv2
import numpy as np

from camkit.bundle.psf_file import write_psf
from camkit.bundle.reader import open_bundle
from camkit.models_def.optics.frozen import FreezeGrid, freeze
from camkit.models_def.optics.lens_file.lens_file import write_lens
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.prescription import read_prescription
from camkit.models_def.training.kind import read_recipe
from tests.bayer_recipe import RECIPE, one_picture_to_validate_on, planes_text  # noqa: F401
from tests.one_thread import one_thread  # noqa: F401

PRESCRIPTION = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions" / "duet.toml"
LARGE = {"width_px = 600": "width_px = 1600", "height_px = 400": "height_px = 1200"}
"""So large a sensor that the laws of photographs hold of it: a third of the time of an export."""
SMALL = {
    'prescription = "duet"': 'prescription = "mine.zmx"\ncopies = 1\nfields = 3\nkernel_px = 65\n'
    "rays = 512",
    "steps = 12": "steps = 4",
}


def _train(camkit_command, folder: Path, recipe: str) -> None:
    """Train some steps of a small camera, and freeze its lens beside the checkpoint."""
    for old, new in SMALL.items():
        recipe = recipe.replace(old, new)
    (folder / "tiny.toml").write_text(recipe, encoding="utf-8")
    lens = read_prescription(PRESCRIPTION)
    write_lens(lens, folder / "mine.zmx")
    trained = camkit_command("train", "tiny.toml", "--size", "S", "--workers", "0", "--json")
    assert trained.code == 0, trained.err
    assert json.loads(trained.out)["steps"] == 4
    grid = FreezeGrid(fields=3, wavelengths=3, max_side_px=65, energy=0.97)
    optics = LensOptics(lens=lens, rays=512)
    frozen = freeze(optics, read_recipe(folder / "tiny.toml").sensor, grid)
    write_psf(folder / "runs" / "psf.safetensors", frozen.psf)


def test_a_recipe_becomes_a_proved_bundle_that_turns_a_capture_into_a_picture(
    camkit_command, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recipe = RECIPE
    for old, new in LARGE.items():
        recipe = recipe.replace(old, new)
    _train(camkit_command, tmp_path, recipe)
    again = camkit_command("train", "tiny.toml", "--size", "S", "--workers", "0")
    assert (again.code, "--resume to go on or --overwrite" in again.err) == (2, True)
    (tmp_path / "mine.zmx").unlink()  # the checkpoint holds the lens
    other = ("--prescription", PRESCRIPTION.parent / "duet-joint.toml")
    refused = camkit_command("export", "runs/tiny_S.pt", "-o", "tiny.camkit", *other)
    assert (refused.code, "was not frozen from the lens" in refused.err) == (2, True)
    exported = camkit_command("export", "runs/tiny_S.pt", "-o", "tiny.camkit")
    assert exported.code == 0, exported.err
    bundle = open_bundle(tmp_path / "tiny.camkit")
    assert {"prescription.toml", "golden.safetensors", "card.md"} <= set(bundle.names)
    assert "double" in bundle.manifest.laws["S"]
    assert camkit_command("check", "tiny.camkit", "--level", "golden").code == 0

    scene = ("simulate", "procedural:5", "--bundle", "tiny.camkit", "-o", "shot.dng")
    assert camkit_command(*scene, "--size-px", "192,128").code == 0
    run = ("process", "shot.dng", "--bundle", "tiny.camkit", "--size", "S", "--json")
    result = json.loads(camkit_command(*run).out)
    assert (result["status"], result["size"]) == ("ok", "S"), result["error"]


def test_a_camera_of_developed_pictures_is_trained_and_restores_a_jpeg(
    camkit_command, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _train(camkit_command, tmp_path, f"{planes_text()}\n[light]\nspread = 0.2\n")
    exported = camkit_command("export", "runs/tiny_S.pt", "-o", "tiny.camkit")
    assert exported.code == 0, exported.err
    stages = [stage.type for stage in open_bundle(tmp_path / "tiny.camkit").manifest.stages]
    assert "network" in stages
    assert "demosaic" not in stages
    assert camkit_command("check", "tiny.camkit", "--level", "golden").code == 0
    codes = np.random.default_rng(0).integers(0, 256, (12, 16, 3)).astype(np.uint8)
    codes[4:6, 4:8] = 255  # clipped, which a mask tells the network
    cv2.imwrite("shot.jpg", cv2.resize(codes, (192, 128)))
    run = ("process", "shot.jpg", "--bundle", "tiny.camkit", "--assume", "centre", "--json")
    result = json.loads(camkit_command(*run, "--tone", "srgb", "--iso", "200").out)
    assert (result["status"], result["size"]) == ("ok", "S"), result["error"]
