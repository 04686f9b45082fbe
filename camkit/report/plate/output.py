"""All files of a plate: the page and each picture as SVG and PNG."""

from importlib import util
from pathlib import Path

from camkit.errors import UnsupportedError
from camkit.report.figure import to_png, to_svg
from camkit.report.plate.cut_chart import draw_cuts
from camkit.report.plate.facts import PlateFacts
from camkit.report.plate.height_chart import draw_heights
from camkit.report.plate.page import to_html
from camkit.report.plate.psf_chart import draw_psf
from camkit.runtime.output.part_file import atomic_outputs


def page_path(folder: Path, name: str) -> Path:
    """Return the page's file."""
    return folder / f"{name}.html"


def write_plate_page(facts: PlateFacts, folder: Path, name: str) -> list[Path]:
    """Write NAME.html, and NAME-PICTURE.svg and .png beside it; all of them or none.

    Returns:
        The files, the page first.

    Raises:
        UnsupportedError: If matplotlib is not installed.
    """
    if util.find_spec("matplotlib") is None:
        raise UnsupportedError("pictures need matplotlib; install it with: pip install matplotlib")
    charts = {"psf": draw_psf, "cuts": draw_cuts, "heights": draw_heights}
    pictures, files = {}, {}
    for chart, draw in charts.items():
        figure = draw(facts)
        pictures[chart] = to_svg(figure)
        files[folder / f"{name}-{chart}.svg"] = pictures[chart].encode()
        files[folder / f"{name}-{chart}.png"] = to_png(figure)
    page = page_path(folder, name)
    files[page] = to_html(facts, pictures).encode()
    folder.mkdir(parents=True, exist_ok=True)
    with atomic_outputs(*files) as parts:
        for part, data in zip(parts, files.values(), strict=True):
            part.write_bytes(data)
    return [page, *(path for path in files if path != page)]
