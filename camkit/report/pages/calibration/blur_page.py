"""The page of a blur that was measured on photographs: kernels, the field, what is not known."""

from camkit.calibration.blur.blur_facts import COLOURS, FREQUENCIES, GREY, PhotoBlur
from camkit.calibration.blur.sharp_edges import DIRECTIONS
from camkit.report.figure import CHANNEL_COLORS, Figure, chart, new_figure, to_png
from camkit.report.pages.calibration.psf_field_page import draw_field
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html

_KERNELS = "Kernels from the axis to the corner, away from the axis downwards; logarithm of light."
_TRANSFER = (
    "Transfer at each height, along the radius (left) and across it; the bars are standard errors."
)
SHOWN_NUMBERS = (1, 3)


def blur_html(result: PhotoBlur) -> str:
    """Return the page."""
    held_out = result.held_out
    summary = (
        f"{result.edges} edges in {len(result.photos)} photographs, {result.sharp} as sharp as "
        f"the lens. {held_out.edges} edges were held out: kernels predict them to "
        f"{held_out.percent:.2f} % of their step ({held_out.in_noise:.2f} of the noise), a round "
        f"Gaussian to {held_out.gaussian_percent:.2f} %."
    )
    field = (
        sentences(summary),
        Picture(_KERNELS, to_png(draw_field(result.psf))),
        Picture(_TRANSFER, to_png(draw_transfer(result))),
        Table(
            header=("height, mm", *DIRECTIONS, "spread, px (radial, tangential)"),
            rows=_rows(result),
        ),
    )
    sections = [
        Section("The blur over the field", field),
        Section("What is not determined", (sentences(*result.notes),)),
    ]
    return to_html(Page(title="The blur of a lens, by photographs", sections=sections))


def _rows(result: PhotoBlur) -> list[tuple[str, ...]]:
    rows = []
    for height in result.heights:
        names = COLOURS if len(height.spread_px) == len(COLOURS) else GREY
        spread = "; ".join(
            f"{name} {one[0]:.2f}, {one[1]:.2f}"
            for name, one in zip(names, height.spread_px, strict=True)
        )
        rows.append((f"{height.height_mm:.2f}", *map(str, height.edges), spread))
    return rows


@chart
def draw_transfer(result: PhotoBlur) -> Figure:
    """Draw the transfer at two frequencies over the height, with its standard error."""
    figure = new_figure(8.0, 3.2)
    panels = figure.subplots(1, 2, sharey=True)
    heights = [one.height_mm for one in result.heights]
    letters = "RGB" if len(result.heights[0].spread_px) == len(COLOURS) else "G"
    for way, panel in enumerate(panels):
        for c, letter in enumerate(letters):
            for number, line in zip(SHOWN_NUMBERS, ("-", ":"), strict=True):
                panel.errorbar(
                    heights,
                    [one.transfer[c, way, number] for one in result.heights],
                    [one.transfer_error[c, way, number] for one in result.heights],
                    fmt=line,
                    color=CHANNEL_COLORS[letter],
                    label=f"{letter}, {FREQUENCIES[number]:g} c/px",
                )
        panel.set(xlabel="height, mm", title=("radial", "tangential")[way], ylim=(0, 1))
    panels[0].legend(fontsize=7)
    return figure
