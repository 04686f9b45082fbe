"""A camera behind a mosaic so small that training it takes seconds; fixtures to import."""

import pytest

from camkit.models_def.kinds.bayer import validation
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.kinds.bayer.samples import corner_height_mm
from camkit.models_def.training.kind import read_recipe
from tests.gaussian_bank import gaussian_bank

RECIPE = """
name = "tiny"
object_distance_mm = inf
scale = 64.0

[sensor]
width_px = 600
height_px = 400
pixel_pitch_um = 5.96
cfa = "RGGB"
black_level = 256.0
white_level = 4095.0
full_well_e = 45000.0
color_matrix = [[0.664, -0.1847, -0.0503], [-0.5238, 1.301, 0.2474], [-0.0993, 0.1673, 0.6527]]
noise = [{ iso = 100.0, gain_e_per_dn = 11.72, read_noise_e = 3.0 }]

[sensor.channel_response]
wavelengths_um = [0.46, 0.54, 0.6]
response = [[0.0, 0.1, 1.0], [0.1, 1.0, 0.1], [1.0, 0.1, 0.0]]
source = "made up for tests"

[wiener]
prior_scale = 3e-4
prior_exponent = 2.5
overlap_px = 32

[lens]
prescription = "duet"

[data]
procedural_scenes = 2
scene_px = 160
sample_px = 64
margin_px = 16
pool_samples = 48
first_samples = 6
steps_per_sample = 4
block_jitter_px = 8.0

[schedule]
steps = 12
batch = 2
patch_px = 32
warmup_steps = 2

[networks.S]
network = "lean_s"
config = { widths = [16, 16], encoder_blocks = [0], decoder_blocks = [0] }

[networks.M]
network = "lean_s"
config = { widths = [16, 16], encoder_blocks = [1], decoder_blocks = [1] }
schedule = { steps = 60, precision = "float32", learning_rate = 4e-3 }
"""


def write_recipe(tmp_path_factory, tables=""):
    """Write the recipe with more tables behind it, and give its path."""
    path = tmp_path_factory.mktemp("recipe") / "tiny.toml"
    path.write_text(RECIPE + tables, encoding="utf-8")
    return path


@pytest.fixture(scope="module", autouse=True)
def one_picture_to_validate_on():
    """Ten validation cases instead of eighty."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation, "PROCEDURAL_PICTURES", 1)
        yield


@pytest.fixture(scope="session")
def recipe_path(tmp_path_factory):
    return write_recipe(tmp_path_factory)


@pytest.fixture(scope="session")
def recipe(recipe_path):
    return read_recipe(recipe_path)


def planes_text(channels="RGB"):
    """Return the recipe of a camera without a mosaic, whose pictures are developed."""
    mosaic = [line for line in RECIPE.splitlines() if line.startswith(("cfa", "color_matrix"))]
    planes = f'type = "planes"\nchannels = {list(channels)}'.replace("'", '"')
    text = RECIPE.replace(mosaic[0], planes).replace(mosaic[1], "")
    if len(channels) == 1:
        text = text.replace("[[0.0, 0.1, 1.0], [0.1, 1.0, 0.1], [1.0, 0.1, 0.0]]", "[[1, 1, 1]]")
    return text


@pytest.fixture(scope="session")
def planes_recipe_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipe") / "planes.toml"
    path.write_text(planes_text(), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def planes_recipe(planes_recipe_path):
    return read_recipe(planes_recipe_path)


@pytest.fixture(scope="session")
def bank(recipe):
    return gaussian_bank(sensor_height_mm=corner_height_mm(recipe), axis_px=0.9, corner_px=1.8)


@pytest.fixture(scope="session")
def material(bank):
    return BayerMaterial(bank=bank)
