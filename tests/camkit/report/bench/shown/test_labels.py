"""Labels: none covers another, a marker or the rim while there is room."""

import itertools

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from camkit.report.bench.shown.labels import Label, place_labels, places_along, places_around


def test_labels_of_crowded_points_find_places_of_their_own() -> None:
    figure = Figure(figsize=(6, 4), dpi=100)
    FigureCanvasAgg(figure)
    panel = figure.add_subplot()
    panel.set_xlim(0, 1)
    panel.set_ylim(0, 1)
    points = [(0.45 + 0.01 * n, 0.5) for n in range(12)]
    labels = [
        Label(
            text=f"method {n}",
            point=point,
            places=places_around(4.0),
            color="black",
            size_pt=9,
            gap_pt=4.0,
        )
        for n, point in enumerate(points)
    ]
    level = Label(
        text="input 20.00 dB", point=(1.0, 0.2), places=places_along(), color="black", size_pt=7.5
    )
    figure.canvas.draw()
    taken = []
    place_labels(panel, [*labels, level, level], taken)
    figure.canvas.draw()
    assert len(panel.texts) == 14
    for one, other in itertools.combinations(taken, 2):
        wide = min(one.x1, other.x1) - max(one.x0, other.x0)
        high = min(one.y1, other.y1) - max(one.y0, other.y0)
        assert min(wide, high) <= 0
    for box in taken:
        assert panel.bbox.x0 <= box.x0
        assert box.x1 <= panel.bbox.x1
    leads = [text.arrow_patch is not None for text in panel.texts]
    assert any(leads)  # the farthest has a line to its marker
    assert not leads[0]


@pytest.mark.parametrize("places", [places_around(3.0), places_along()])
def test_every_place_is_offered_once(places: list) -> None:
    assert len(set(places)) == len(places)
