"""tools/lens/physics_camera.py: a recipe and optics become a camera without network."""

from dataclasses import replace
from pathlib import Path

import pytest

from camkit.bundle.haze_file import write_haze
from camkit.bundle.reader import open_bundle
from camkit.models_def.optics.thin.recipe import RECIPES
from tests.bundle_factory import tiny_psf
from tests.haze_factory import tiny_haze
from tests.tiny_design import run_tool


def test_recipes_with_and_without_a_haze_become_cameras(
    hazy: str, clear: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    haze = replace(tiny_haze(tiny_psf(pitch_um=5.96)), cell_px=16)
    write_haze(tmp_path / "haze.safetensors", haze)
    for recipe, optics, has_haze in (
        ("thin_plate", hazy.split("+"), True),
        ("thin_plate_stop", [clear], False),
    ):
        out = tmp_path / f"{recipe}.camkit"
        run_tool(monkeypatch, "lens.physics_camera", RECIPES / f"{recipe}.toml", *optics, "-o", out)
        manifest = open_bundle(out).manifest
        assert (manifest.has_haze, manifest.sizes) == (has_haze, ())


def test_a_haze_that_the_recipe_does_not_undo_is_refused(
    hazy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit, match="undoes no haze"):
        run_tool(
            monkeypatch,
            "lens.physics_camera",
            *(RECIPES / "thin_plate_stop.toml", *hazy.split("+"), "-o", tmp_path / "x.camkit"),
        )
