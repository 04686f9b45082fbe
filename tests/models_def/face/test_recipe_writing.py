"""A lens and a sensor to a recipe, from Python and from the command line."""

import json
import math
import re
from pathlib import Path

import pytest

import camkit
from camkit.cli.app import run
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.optics.lens_file.lens_file import find_lens, read_lens
from camkit.models_def.optics.paraxial import paraxial_image
from camkit.models_def.training.kind import read_recipe


def test_a_recipe_and_its_lens_are_written_and_read_back(tmp_path: Path) -> None:
    out = tmp_path / "new" / "mine.toml"
    words = camkit.CameraWords(
        sensor="3000x2000@6um",
        f_number=5.6,
        focus_m=2.0,
        object_m=(1.0, 2.0),
        distance_from="sensor",
    )
    facts = camkit.recipe("double-gauss", out, camera=words)
    recipe = read_recipe(out)
    assert isinstance(recipe, BayerRecipe)
    assert (recipe.name, recipe.sensor.width_px) == ("mine", 3000)
    lens = find_lens(recipe.lens.prescription, out.parent)
    assert lens == read_lens(Path(facts["lens"]))
    assert lens.object_distance_mm == recipe.object_distance_mm == facts["focus_mm"]
    assert recipe.lens.depths_mm == tuple(facts["objects_mm"])
    assert recipe.lens.depths_mm[1] - recipe.lens.depths_mm[0] == pytest.approx(1000)
    assert facts["f_number"] == 5.6
    # by spots, so near the paraxial image and not at it
    moved_mm = lens.surfaces[-1].thickness_mm - paraxial_image(lens).distance_mm
    assert abs(moved_mm) < 0.3
    with pytest.raises(ContractError, match="exists"):
        camkit.recipe("double-gauss", out, camera=words)


def test_a_sensor_or_a_photograph_is_needed() -> None:
    with pytest.raises(ContractError, match=r"give sensor, such as .* or a photograph by photo"):
        camkit.CameraWords()
    with pytest.raises(ContractError, match="give sensor"):
        camkit.CameraWords(sensor="IMX264", photo="a.dng")


def test_the_command_says_what_is_a_default(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine.toml"
    words = ["recipe", "duet", "--sensor", "6000x4000@5.96um", "-o", str(out)]
    assert run(words) == 0
    told = capsys.readouterr()
    assert "50 mm F/4 on 6000x4000 of 5.96 um, focused at infinity" in told.out
    assert "defaults of the sensor, not facts: cfa, black_level" in told.err
    assert run([*words, "--focus-m", "1.5", "--json", "--overwrite"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["focus_mm"] == 1500
    assert math.isinf(read_recipe(Path("models_def/recipes/duet.toml")).object_distance_mm)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "give --sensor"),
        (["--sensor", "IMX264", "--object-m", "1,x"], "--object-m takes distances A,B,C in m"),
        (["--sensor", "IMX264", "--distance-from", "mount"], "--distance-from takes one of vertex"),
        (["--sensor", "IMX264", "--focus-m", "0.01", "--distance-from", "sensor"], "lies within"),
        (["--from", "nothing.dng"], "nothing.dng"),
    ],
)
def test_wrong_words_are_one_line(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["recipe", "duet", "-o", str(tmp_path / "mine.toml"), *words]) != 0
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("optics", "says"),
    [
        ("streak-3", "streak-3 is a diffractive plate: its camera is of another kind"),
        ("thin-plate", "thin-plate has grooves, which throw a haze over the picture"),
    ],
)
def test_a_plate_is_refused_by_its_name(optics: str, says: str, tmp_path: Path) -> None:
    camera = camkit.CameraWords(sensor="3000x2000@6um")
    with pytest.raises(UnsupportedError, match=says):
        camkit.recipe(optics, tmp_path / "mine.toml", camera=camera)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("lens", ["cooke-triplet-f5", "double-gauss", "duet"])
@pytest.mark.parametrize("object_m", [(), (0.4, 2.0)])
def test_a_sensor_that_the_lens_does_not_reach_is_refused_before_any_work(
    lens: str, object_m: tuple[float, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["recipe", lens, "--focus-m", "2", "-o", str(tmp_path / "mine.toml")]
    words += ["--object-m", ",".join(map(str, object_m))] if object_m else []
    assert run([*words, "--sensor", "9000x9000@10um"]) == 2
    told = re.search(
        rf"{lens} images up to (.*) mm from its axis, but .* lies at 63.64 mm: .* (\d+)x(\d+) px",
        capsys.readouterr().err,
    )
    assert told is not None
    reach_mm, covered_px = float(told[1]), int(told[2])
    assert not list(tmp_path.iterdir())
    assert covered_px * 0.01 * math.sqrt(0.5) == pytest.approx(reach_mm, rel=1e-3)
    inside_px = int(0.98 * covered_px)
    assert run([*words, "--sensor", f"{inside_px}x{inside_px}@10um"]) == 0


@pytest.mark.parametrize(
    ("more", "note"),
    [
        (["--f-number", "4"], None),
        (["--f-number", "8"], None),
        (["--f-number", "3.9"], "F/3.9 is wider than the F/4 of the file: its rims let all of"),
        (["--f-number", "2"], r"F/2 is wider than .* rims let 3\d% of the light of F/2 through"),
        (["--stop-radius-mm", "20"], "F/1.25 is wider than the F/4 of the file"),
    ],
)
def test_a_lens_that_is_opened_beyond_its_file_is_noted(
    more: list[str], note: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["recipe", "duet", "--sensor", "3000x2000@6um", "-o", str(tmp_path / "mine.toml")]
    assert run([*words, *more]) == 0
    told = capsys.readouterr().err
    assert ("rims" not in told) if note is None else re.search(note, told) is not None
