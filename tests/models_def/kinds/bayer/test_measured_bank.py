"""Training samples behind a measured PSF have its kernels, and copies within its uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.psf_file import write_psf
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.kinds.bayer.material import read_material, trace_material
from camkit.models_def.kinds.bayer.measured_bank import build_measured_bank
from camkit.models_def.kinds.bayer.samples import draw_exposure, layout_of, scene_side_px
from camkit.models_def.kinds.bayer.training import BayerMaker
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.measured import MeasuredOptics, measured_psf
from camkit.models_def.training.kind import read_recipe
from camkit.psf import PsfUncertainty
from camkit.runtime.bank.psf import color_kernels
from tests.bayer_recipe import RECIPE
from tests.psf_files import PITCH_UM, counts

COLOURS = (0.46, 0.54, 0.6)
GRID = (np.array([-1.5, -0.5, 0.5, 1.5]), np.array([-1.0, 0.0, 1.0]))
RESPONSE = RECIPE.index("[sensor.channel_response]"), RECIPE.index("[wiener]")
RECIPE = RECIPE[: RESPONSE[0]] + RECIPE[RESPONSE[1] :]
STATED = """
[sensor.channel_response]
wavelengths_um = [0.45, 0.65]
response = [[0.1, 1.0], [1.0, 1.0], [1.0, 0.1]]
source = "stated"
"""
SMALL = PsfUncertainty(noise=0.01, shift_px=0.1, width=0.02)


def grid_psf(pitch_um=5.96, waves=COLOURS):
    kernels = counts()[:, :, ::-1][:, :, : len(waves)]
    return measured_psf(kernels, pixel_pitch_um=pitch_um, wavelengths_um=waves, grid_mm=GRID)


def recipe_of(folder, lens='psf = "lab.safetensors"', tables="", psf=None, uncertainty=SMALL):
    text = RECIPE.replace('prescription = "duet"', lens) + tables
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    write_psf(folder / "lab.safetensors", psf or grid_psf(), uncertainty)
    return read_recipe(folder / "mine.toml")


def test_the_kernels_of_a_grid_lie_as_the_runtime_has_them(tmp_path):
    recipe, psf = recipe_of(tmp_path), grid_psf()
    bank = trace_material(recipe, tmp_path, tmp_path).bank
    lookup = color_kernels(psf, *recipe.sensor.response_arrays())
    for place in ((-1.5, -1.0), (0.2, -0.7), (9.0, 9.0)):
        found = bank.frozen_kernels(*place)[0].numpy()
        assert np.array_equal(found, lookup.at(*place))
    own = counts()[0, 0, 0] / counts()[0, 0, 0].sum()  # red, top left
    np.testing.assert_allclose(bank.frozen_kernels(-1.5, -1.0)[0, 0].numpy(), own, atol=1e-6)


def test_copies_differ_within_the_uncertainty_of_file_or_recipe(tmp_path):
    recipe = recipe_of(tmp_path, lens='psf = "lab.safetensors"\ncopies = 3')
    bank = trace_material(recipe, tmp_path, tmp_path).bank
    assert (bank.training_copies, len(bank.copies)) == (3, 4)
    gaps = [np.abs(copy - bank.frozen).sum((-2, -1)).mean() for copy in bank.copies]
    assert len({round(float(gap), 6) for gap in gaps}) == 4
    assert 0.01 < min(gaps) <= max(gaps) < 0.3
    wide = 'psf = "lab.safetensors"\ncopies = 3\nuncertainty = [0.01, 0.4, 0.02]'
    far = trace_material(recipe_of(tmp_path, lens=wide), tmp_path, tmp_path).bank
    assert np.abs(far.copies - far.frozen).mean() > 2 * np.abs(bank.copies - bank.frozen).mean()
    none = recipe_of(tmp_path, uncertainty=None)
    assert np.ptp(trace_material(none, tmp_path, tmp_path).bank.copies, axis=0).max() > 0


def test_a_bank_travels_to_another_process(tmp_path):
    material = trace_material(recipe_of(tmp_path), tmp_path, tmp_path)
    material.write(tmp_path)
    back = read_material(tmp_path)
    assert back.digest() == material.digest()
    assert np.array_equal(
        back.bank.blur_kernels(1, 0.3, 0.4).numpy(), material.bank.blur_kernels(1, 0.3, 0.4).numpy()
    )


def test_samples_are_made_and_never_turned(tmp_path):
    recipe = recipe_of(tmp_path)
    assert not layout_of(recipe).turned
    bank = trace_material(recipe, tmp_path, tmp_path).bank
    sample = BayerMaker(recipe, bank, None, 1).make(0)
    assert sample.target.shape == (3, 64, 64)
    exposure = draw_exposure(np.random.default_rng(0), recipe, bank)
    assert 0 <= exposure.copy < bank.training_copies
    assert scene_side_px(recipe, bank) == 64 + 2 * (16 + bank.radius_px)


def test_another_pitch_is_resampled_to_the_pixels_of_the_sensor(tmp_path):
    recipe = recipe_of(tmp_path, psf=grid_psf(PITCH_UM))
    material = trace_material(recipe, tmp_path, tmp_path)
    assert material.bank.frozen.shape[-1] == 5  # 11 samples of 2.5 um
    assert material.bank.copies.shape[-1] == 5


def test_one_place_and_fields_of_a_lens_of_revolution_are_taken_too(tmp_path):
    recipe = recipe_of(tmp_path)
    one = measured_psf(counts()[0, 0], pixel_pitch_um=5.96, wavelengths_um=COLOURS)
    bank = build_measured_bank(recipe, MeasuredOptics(psf=one, name="one"))
    assert np.array_equal(bank.frozen_kernels(1, 0).numpy(), bank.frozen_kernels(0, -1).numpy())
    fields = np.array([0.0, 1.0])
    radial = replace(
        one,
        kernels=np.concatenate([one.kernels, one.kernels]),
        field_heights_mm=fields,
        relative_illumination=np.array([1.0, 0.5]),
        symmetry="radial",
    )
    bank = build_measured_bank(recipe, MeasuredOptics(psf=radial, name="two"))
    assert bank.illumination_at(0.0, 0.5) == pytest.approx(0.75)
    right, down = (bank.frozen_kernels(*place)[0, 0].numpy() for place in ((1.0, 0), (0, 1.0)))
    np.testing.assert_allclose(right, down.T, atol=1e-6)


def test_light_of_a_grid_is_linear_between_its_places(tmp_path):
    recipe, psf = recipe_of(tmp_path), grid_psf()
    light = np.linspace(1, 0.4, 12)
    bank = build_measured_bank(
        recipe, MeasuredOptics(psf=replace(psf, relative_illumination=light), name="grid")
    )
    grid = light.reshape(3, 4)
    assert bank.illumination_at(-1.5, -1.0) == 1
    expected = [(grid[0, 1] + grid[1, 2]) / 2, grid[2, 3]]
    found = bank.illumination_at(np.array([0.0, 7.0]), np.array([-0.5, 7.0]))
    np.testing.assert_allclose(found, expected)


def test_a_response_belongs_to_wavelengths_and_not_to_colours(tmp_path):
    with pytest.raises(ContractError, match=r"leave sensor\.channel_response out"):
        trace_material(recipe_of(tmp_path, tables=STATED), tmp_path, tmp_path)
    waves = grid_psf(waves=(0.5, 0.6))
    with pytest.raises(ContractError, match=r"state sensor\.channel_response"):
        trace_material(recipe_of(tmp_path, psf=waves), tmp_path, tmp_path)
    recipe = recipe_of(tmp_path, psf=waves, tables=STATED)
    assert trace_material(recipe, tmp_path, tmp_path).bank.frozen.shape[1] == 3
    grey = recipe_of(tmp_path, psf=grid_psf(waves=(0.54,)))
    frozen = trace_material(grey, tmp_path, tmp_path).bank.frozen
    assert np.array_equal(frozen[:, 0], frozen[:, 2])


@pytest.mark.parametrize(
    ("lens", "words"),
    [
        ("copies = 2", "prescription = .* or psf = "),
        ('prescription = "duet"\npsf = "lab.safetensors"', "one of them"),
        ('psf = "lab.safetensors"\nuncertainty = [0.1]', r"\[noise, shift_px, width\]"),
        ('psf = "lab.safetensors"\nbank_in_focus = true', "needs a lens"),
        ('psf = "lab.npy"', "convert it by `camkit psf import`"),
        ('psf = "no.safetensors"', "make it by `camkit psf import`"),
        ('prescription = "lab.safetensors"', r"is a PSF and no lens: .* psf in \[lens\]"),
    ],
)
def test_a_wrong_table_says_what_helps(tmp_path, lens, words):
    tables = "" if lens.startswith("psf") else STATED
    with pytest.raises((ContractError, UnsupportedError), match=words):
        trace_material(recipe_of(tmp_path, lens=lens, tables=tables), tmp_path, tmp_path)


@pytest.mark.parametrize("name", ["psf_grid.npy", "psf.mat", "crops.png", "huygens.txt"])
def test_kernels_in_place_of_a_lens_are_told_their_command(tmp_path, name):
    (tmp_path / name).touch()
    with pytest.raises(UnsupportedError, match="convert it by `camkit psf import`"):
        find_lens(name, tmp_path)
