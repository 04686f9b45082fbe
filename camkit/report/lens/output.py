"""All files of a lens: the page and each picture as SVG and PNG."""

from collections.abc import Callable
from importlib import util
from pathlib import Path
from typing import TYPE_CHECKING

from camkit.errors import UnsupportedError
from camkit.report.figure import to_png, to_svg
from camkit.report.lens.colour_chart import draw_colour
from camkit.report.lens.facts import LensFacts
from camkit.report.lens.field_chart import draw_field
from camkit.report.lens.layout import draw_layout
from camkit.report.lens.mtf_chart import draw_mtf
from camkit.report.lens.page import to_html
from camkit.report.lens.seidel_chart import draw_seidel
from camkit.report.lens.spot_chart import draw_spots

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def page_path(folder: Path, name: str) -> Path:
    """Return the page's file."""
    return folder / f"{name}.html"


def write_lens_page(facts: LensFacts, folder: Path, name: str) -> list[Path]:
    """Write NAME.html, and NAME-PICTURE.svg and .png beside it.

    Returns:
        The files, the page first.

    Raises:
        UnsupportedError: If matplotlib is not installed.
    """
    if util.find_spec("matplotlib") is None:
        raise UnsupportedError("pictures need matplotlib; install it with: pip install matplotlib")
    folder.mkdir(parents=True, exist_ok=True)
    page, written, pictures = page_path(folder, name), [], {}
    for chart, draw in _charts(facts).items():
        figure = draw()
        pictures[chart] = to_svg(figure)
        svg, png = (folder / f"{name}-{chart}.{kind}" for kind in ("svg", "png"))
        svg.write_text(pictures[chart], encoding="utf-8")
        png.write_bytes(to_png(figure))
        written += [svg, png]
    page.write_text(to_html(facts, pictures), encoding="utf-8")
    return [page, *written]


def _charts(facts: LensFacts) -> "dict[str, Callable[[], Figure]]":
    charts: dict[str, Callable[[], Figure]] = {
        "layout": lambda: draw_layout(facts),
        "spots": lambda: draw_spots(facts),
        "mtf": lambda: draw_mtf(facts),
        "field": lambda: draw_field(facts),
        "colour": lambda: draw_colour(facts),
    }
    sums = facts.seidel
    if sums is not None:
        charts["seidel"] = lambda: draw_seidel(sums)
    return charts
