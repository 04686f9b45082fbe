"""A recipe and a PSF are a camera: no network, a filter that restores, kernels the right way up."""

import json

import numpy as np
import OpenEXR
import pytest
import rawpy
import tifffile

from camkit import train
from camkit.bundle.reader import open_bundle
from camkit.cli.app import run
from camkit.errors import ContractError
from camkit.export import bundle as export
from tests.psf_files import SPAN, counts

RECIPE = """
name = "lab"
object_distance_mm = inf

[sensor]
width_px = 384
height_px = 256
pixel_pitch_um = 25.0
cfa = "RGGB"
black_level = 256.0
white_level = 4095.0
full_well_e = 45000.0
color_matrix = [[0.664, -0.1847, -0.0503], [-0.5238, 1.301, 0.2474], [-0.0993, 0.1673, 0.6527]]
noise = [{ iso = 100.0, gain_e_per_dn = 11.72, read_noise_e = 3.0 }]

[wiener]
prior_scale = 3e-4
prior_exponent = 2.5
block_px = 128
overlap_px = 48

[lens]
psf = "lab.safetensors"

[networks.S]
network = "lean_s"
"""


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A folder with kernels, their PSF, the recipe and its bundle, all by commands."""
    folder = tmp_path_factory.mktemp("lab")
    np.save(folder / "psf.npy", counts())
    (folder / "lab.toml").write_text(RECIPE, encoding="utf-8")
    psf, recipe, out = (str(folder / f"lab.{end}") for end in ("safetensors", "toml", "camkit"))
    given = ["--pitch-um", "25", "--span-mm", SPAN]
    assert run(["psf", "import", str(folder / "psf.npy"), "-o", psf, *given]) == 0
    assert run(["export", recipe, "--no-network", "-o", out]) == 0
    return folder


def test_the_bundle_has_a_filter_and_no_network_and_passes_its_check(lab, capsys):
    manifest = open_bundle(lab / "lab.camkit").manifest
    assert not manifest.networks
    assert [stage.type for stage in manifest.stages][-5:] == [
        *("wiener", "raise_clipped", "illumination", "undistort", "color")
    ]
    assert manifest.optics.symmetry == "grid"
    assert run(["check", str(lab / "lab.camkit")]) == 0
    assert "pass  golden" in capsys.readouterr().out


def test_the_filter_is_what_process_does_of_itself(lab, tmp_path):
    shot, bundle = str(tmp_path / "shot.dng"), str(lab / "lab.camkit")
    assert run(["simulate", "procedural:7", "--bundle", bundle, "-o", shot]) == 0
    for name, more in (("usual", []), ("wiener", ["--method", "wiener"])):
        out = ["--out-dir", str(tmp_path / name), "--format", "tiff"]
        assert run(["process", shot, "--bundle", bundle, *out, *more]) == 0
    usual, wiener = (tifffile.imread(tmp_path / n / "shot.tif") for n in ("usual", "wiener"))
    assert np.array_equal(usual, wiener)


def test_a_point_off_the_axis_is_photographed_with_its_tails_as_in_the_array(lab, tmp_path):
    """Tails lie 2 px right of the middle and 4 px below in every kernel, as `counts` says."""
    row, column = 60, 80
    star = np.zeros((256, 384), np.float32)
    star[row, column] = 20.0
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, dict.fromkeys("RGB", star)) as file:
        file.write(str(tmp_path / "star.exr"))
    shot = str(tmp_path / "star.dng")
    star_file, bundle = str(tmp_path / "star.exr"), str(lab / "lab.camkit")
    assert run(["simulate", star_file, "--bundle", bundle, "-o", shot]) == 0
    with rawpy.imread(shot) as raw:
        mosaic = raw.raw_image.astype(float) - 256
    tails = {(2, 0): mosaic[row + 2, column], (4, 0): mosaic[row + 4, column]}
    tails |= {(0, 2): mosaic[row, column + 2], (0, -2): mosaic[row, column - 2]}
    tails |= {(-4, 0): mosaic[row - 4, column]}
    assert tails[0, 2] > 1.5 * tails[0, -2]
    assert tails[4, 0] > 3 * max(tails[-4, 0], 1)


def test_a_network_behind_a_measured_psf_carries_it_into_its_bundle(lab, tmp_path):
    """No file beside the checkpoint: what it was trained behind comes along."""
    small = """config = { widths = [16, 16], encoder_blocks = [0], decoder_blocks = [0] }

[data]
procedural_scenes = 2
scene_px = 128
sample_px = 32
margin_px = 16
pool_samples = 40
first_samples = 4

[schedule]
batch = 2
patch_px = 16
"""
    (lab / "small.toml").write_text(RECIPE + small, encoding="utf-8")
    train(lab / "small.toml", tmp_path, size="S", steps=2, workers=0)
    export(tmp_path / "lab_S.pt", tmp_path / "net.camkit")
    with_network, alone = (
        open_bundle(path) for path in (tmp_path / "net.camkit", lab / "lab.camkit")
    )
    assert with_network.manifest.sizes == ("S",)
    assert with_network.member("psf.safetensors") == alone.member("psf.safetensors")


def test_a_recipe_and_checkpoints_are_not_taken_for_each_other(lab):
    with pytest.raises(ContractError, match=r"is a recipe; .* network=False"):
        export(lab / "lab.toml", lab / "no.camkit")
    with pytest.raises(ContractError, match="takes one recipe"):
        export(lab / "lab_S.pt", lab / "no.camkit", network=False)


def test_a_lens_without_a_psf_is_told_to_freeze(lab, tmp_path):
    text = RECIPE.replace('psf = "lab.safetensors"', 'prescription = "duet"')
    response = """
[sensor.channel_response]
wavelengths_um = [0.45, 0.65]
response = [[0.1, 1.0], [1.0, 1.0], [1.0, 0.1]]
source = "stated"
"""
    (tmp_path / "duet.toml").write_text(text + response, encoding="utf-8")
    with pytest.raises(ContractError, match="make it with `camkit freeze`"):
        export(tmp_path / "duet.toml", tmp_path / "no.camkit", network=False)


def test_other_kernels_and_another_pitch_go_into_a_copy(lab, tmp_path, capsys):
    psf = str(tmp_path / "fine.safetensors")
    given = ["--pitch-um", "12.5", "--span-mm", "8x5"]
    assert run(["psf", "import", str(lab / "psf.npy"), "-o", psf, *given]) == 0
    out = str(tmp_path / "fine.camkit")
    capsys.readouterr()
    command = ["calibrate", "bundle", str(lab / "lab.camkit"), "--psf", psf, "-o", out, "--json"]
    assert run(command) == 0
    notes = " ".join(json.loads(capsys.readouterr().out)["notes"])
    assert "samples of 12.5 um and were resampled to 25 um" in notes
    assert open_bundle(tmp_path / "fine.camkit").psf.grid_x_mm.tolist()[-1] == 4.0


def test_a_frozen_psf_of_other_kernels_is_refused(lab, tmp_path, capsys):
    """One that lies beside a recipe by chance would take the place of the one it names."""
    recipe = (lab / "lab.toml").read_text(encoding="utf-8")
    (tmp_path / "lab.toml").write_text(recipe, encoding="utf-8")
    (tmp_path / "lab.safetensors").write_bytes((lab / "lab.safetensors").read_bytes())
    words = ["--recipe", str(tmp_path / "lab.toml"), "--quick"]
    frozen = ["-o", str(tmp_path / "psf.safetensors")]
    assert run(["freeze", str(tmp_path / "lab.safetensors"), *frozen, *words]) == 0
    packed = ["export", str(tmp_path / "lab.toml"), "--no-network"]
    assert run([*packed, "-o", str(tmp_path / "own.camkit")]) == 0
    noted = "psf.safetensors is of camkit freeze of lab.safetensors: give its report by --freeze"
    assert noted in capsys.readouterr().err
    np.save(tmp_path / "other.npy", counts(seed=4))
    other = ["-o", str(tmp_path / "lab.safetensors"), "--overwrite"]
    given = ["--pitch-um", "25", "--span-mm", SPAN]
    assert run(["psf", "import", str(tmp_path / "other.npy"), *other, *given]) == 0
    with pytest.raises(ContractError, match="was not frozen from the PSF that the recipe names"):
        export(tmp_path / "lab.toml", tmp_path / "other.camkit", network=False)
