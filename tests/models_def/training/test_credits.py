import cv2
import numpy as np

from camkit.models_def.training.credits import describe_data, joined_credits
from tests.data_folder import data_path


def test_procedural_training_is_said_to_be_that(recipe):
    assert (
        describe_data(recipe.data, None)
        == "2 procedural scenes (camkit.scenes) only; no photographs"
    )


def test_licences_are_counted_from_the_table(recipe, tmp_path):
    for name in ("a.png", "b.png", "c.png"):
        cv2.imwrite(str(tmp_path / name), np.zeros((4, 4, 3), np.uint8))
    rows = [
        "| file | title | author | licence | source |",
        "| `a.png` | A | x | CC0-1.0 | s |",
        "| `b.png` | B | y | CC0-1.0 (as stated) | s |",
        "| `gone.png` | G | y | CC-BY | s |",
    ]
    (tmp_path / "README.md").write_text("\n".join(rows), encoding="utf-8")
    text = describe_data(recipe.data, tmp_path)
    assert "3 photographs" in text
    assert "CC0-1.0: 2" in text
    assert "CC-BY" not in text


def test_every_picture_of_the_training_set_has_a_licence(recipe):
    text = describe_data(recipe.data, data_path("train_open"))
    counts = [
        int(part.rsplit(": ", 1)[1].split(")")[0])
        for part in text.split("licences ")[1].split(", ")
    ]
    assert sum(counts) == 186


def test_what_networks_share_is_said_once():
    small, large = (
        "a; first weights: x S, trained on the same",
        "a; first weights: x M, trained on b",
    )
    assert joined_credits([small, large, small]) == (
        "a; first weights: x S, trained on the same; first weights: x M, trained on b"
    )
    assert joined_credits(["a", "b", "a", small]) == "a; first weights: x S, trained on the same; b"


def test_parts_of_one_training_name_their_first_weights_once():
    same = "; first weights: x S, trained on the same"
    assert joined_credits([f"a{same}{same}; first weights: y S, trained on b"]) == (
        f"a{same}; first weights: y S, trained on b"
    )
