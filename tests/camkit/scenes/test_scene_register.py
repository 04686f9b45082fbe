import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.scenes import is_scene_name, named_scene, procedural_scene
from camkit.scenes.scene_register import scene_sources


def test_a_name_gives_the_scene_of_its_source_and_seed():
    assert np.array_equal(named_scene("procedural:7", 24, 40), procedural_scene(7, 24, 40))


@pytest.mark.parametrize("source", scene_sources())
def test_every_source_of_the_register_draws_what_is_asked_for(source):
    scene = named_scene(f"{source}:3", 30, 44)
    assert (scene.shape, scene.dtype) == ((3, 30, 44), np.float32)
    assert np.isfinite(scene).all()
    assert scene.min() >= 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("procedural:7", True),
        ("procedural:x", True),
        ("procedural", False),
        ("nite:7", True),
        ("C:7", False),
        ("nite:7.exr", False),
        ("room.exr", False),
    ],
)
def test_a_name_of_a_scene_is_told_from_that_of_a_file(text, expected):
    assert is_scene_name(text) is expected


@pytest.mark.parametrize("seed", ["", "x", "-1", "1.5", "²", "1" * 19, "9" * 5000])
def test_a_seed_that_is_no_whole_number_is_refused_in_one_line(seed):
    with pytest.raises(ContractError, match="procedural:SEED with a whole number") as refused:
        named_scene(f"procedural:{seed}", 4, 4)
    assert len(str(refused.value)) < 160


def test_an_unknown_source_is_refused_with_the_known_ones():
    with pytest.raises(ContractError, match="expected one of procedural:SEED"):
        named_scene("moonlit:3", 4, 4)
