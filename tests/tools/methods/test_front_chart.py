"""Names in the chart of the front stand where they meet nothing."""

from itertools import combinations

from tools.methods.front_chart import _label_box, _meet, label_offsets


def test_names_of_near_points_do_not_meet() -> None:
    places = [(100.0, 100.0), (103.0, 102.0), (101.0, 97.0), (300.0, 100.0)]
    titles = ["one", "another one", "third", "far away"]
    offsets = label_offsets(places, titles, 0.0)
    boxes = [_label_box(*p, o, t) for p, o, t in zip(places, offsets, titles, strict=True)]
    assert not [pair for pair in combinations(boxes, 2) if _meet(*pair)]
    assert offsets[3] == (7, 3)


def test_a_name_stays_within_the_panel() -> None:
    (offset,) = label_offsets([(4.0, 50.0)], ["a long name"], 0.0)
    assert offset[0] > 0
