"""What samples are made with goes to other processes and back; plates are found beside a recipe."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import BundleError, ContractError
from camkit.models_def.kinds.hdr import material as module
from camkit.models_def.kinds.hdr.material import HdrMaterial, compute_material, read_material
from camkit.models_def.kinds.hdr.recipe import HdrRecipe, PlateRecipe
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.patterns import StarPattern
from camkit.models_def.optics.diffraction.plate import pattern_plate
from tests.hdr_bundle import four_lines


def test_material_survives_the_disk(lines: HdrMaterial, tmp_path: Path) -> None:
    lines.write(tmp_path)
    back = read_material(tmp_path)
    assert back.digest() == lines.digest()
    np.testing.assert_array_equal(back.streaks.dense(), lines.streaks.dense())
    assert back.designed == {}
    with pytest.raises(BundleError, match="cannot read"):
        read_material(tmp_path / "none")


def test_other_optics_have_another_digest(lines: HdrMaterial) -> None:
    streaks = replace(lines.streaks, pixel_pitch_um=5.0)
    assert HdrMaterial(streaks=streaks).digest() != lines.digest()


def test_kernels_of_colours_are_whole_and_those_of_the_farthest_depth(tiny: HdrRecipe) -> None:
    streaks = four_lines(depths_mm=(1000.0, 5000.0))
    kernels = HdrMaterial(streaks=streaks).color_kernels(tiny)
    assert kernels.dtype == np.float32
    np.testing.assert_allclose(kernels.sum((-2, -1)), 1, atol=1e-5)
    far = streaks.dense()[1, 0]
    np.testing.assert_allclose(kernels[1], far / far.sum(), atol=1e-6)
    bare = HdrMaterial(streaks=streaks).color_kernels(tiny, bare=True)
    assert (np.count_nonzero(bare, axis=(-2, -1)) <= 121).all()


def test_a_plate_is_that_beside_the_recipe_or_built_in(
    tiny: HdrRecipe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = []
    plate = StarPattern(angles_deg=(0,), near_um=50.0, far_um=300.0, share=0.06)
    made_of = pattern_plate(
        "mine", plate, cells=64, bench=Bench(diameter_mm=1.0, focal_length_mm=50.0)
    )
    monkeypatch.setattr(module, "read_plate", lambda path: read.append(path) or made_of)
    monkeypatch.setattr(module, "plate_streaks", lambda *_, **settings: settings["side_px"])
    made = compute_material(tiny, tmp_path, tmp_path)
    assert made.streaks == tiny.plate.side_px  # type: ignore[comparison-overlap]
    assert b'name = "mine"' in made.designed["plate.toml"], "it goes with the checkpoint"
    (tmp_path / "streak-4").write_text("")
    compute_material(tiny, tmp_path, tmp_path)
    assert read == [Path("streak-4"), tmp_path / "streak-4"]


def test_a_plate_that_is_not_there_is_refused(tiny: HdrRecipe, tmp_path: Path) -> None:
    other = replace(tiny, plate=PlateRecipe(file="nothing"))
    with pytest.raises(ContractError, match="no plate nothing: name a file"):
        compute_material(other, tmp_path, tmp_path)
