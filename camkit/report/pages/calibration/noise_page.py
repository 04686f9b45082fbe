"""The page of a sensor's noise: photon transfer of every ISO, with what the line leaves."""

from typing import Final

import numpy as np

from camkit.calibration.noise.sensor_noise import IsoFacts, NoiseFacts
from camkit.report.figure import (
    CHANNEL_COLORS,
    Figure,
    Panel,
    chart,
    field_color,
    new_figure,
    to_png,
)
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html

_COLORS: Final = {**CHANNEL_COLORS, "G1": CHANNEL_COLORS["G"], "G2": "#8fbc5a", "Y": "#444444"}
_HEADER: Final = (
    *("ISO", "gain, e-/DN", "error, %", "read noise, e-", "at white, e-", "black, DN"),
    *("white, DN", "PRNU, %", "DSNU, e-", "linearity, %", "levels"),
)
_CAPTION: Final = (
    "Above: variance of the noise in time over the mean, and the line fitted. Below: how far "
    "points lie off it; bars are two standard deviations."
)
_SURE: Final = 2.0


def noise_html(facts: NoiseFacts) -> str:
    """Return the page."""
    table = Table(header=_HEADER, rows=[_row(iso) for iso in facts.isos])
    sections = [Section("Noise by ISO", (sentences(*facts.notes), table))]
    for iso in facts.isos:
        rows = [
            (name, f"{1 / line.dn_per_e:.5g}", f"{100 * line.error / line.dn_per_e:.2g}")
            for name, line in iso.transfers.items()
        ]
        colours = Table(header=("colour", "gain, e-/DN", "error, %"), rows=rows)
        picture = Picture(_CAPTION, to_png(draw_transfer(iso)))
        sections.append(Section(f"ISO {iso.iso:g}", (colours, picture)))
    return to_html(Page(title=f"Noise of {facts.camera or 'a sensor'}", sections=sections))


@chart
def draw_transfer(facts: IsoFacts) -> Figure:
    """Draw the photon transfer of every colour at one ISO, and its residuals."""
    figure = new_figure(7.5, 5.4)
    curve, rest = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for number, (name, line) in enumerate(facts.transfers.items()):
        color = _COLORS.get(name, field_color(number))
        signal = np.array([point.signal for point in line.points])
        variance = np.array([point.variance for point in line.points])
        shade = np.geomspace(signal.min() / 2, signal.max() * 1.2, 60)
        curve.loglog(signal, variance, "o", color=color, label=name)
        curve.loglog(shade, [line.variance_at(float(s)) for s in shade], color=color, linewidth=0.8)
        bars = 100 * _SURE * np.sqrt([2 / point.samples for point in line.points])
        place = signal * 1.02 ** (number - 1.5)
        rest.errorbar(place, 100 * line.misfits(), bars, fmt="o", color=color, elinewidth=0.7)
    _level(curve, facts.read.value**2, resolved=facts.read.resolved)
    curve.set_ylabel("variance, DN²")
    curve.legend()
    rest.axhline(0, color="black", linewidth=0.6)
    rest.set(ylabel="off the line, %", xlabel="signal, DN above the dark")
    return figure


def _level(panel: Panel, variance: float, *, resolved: bool) -> None:
    """Mark the read noise, or what it lies below."""
    panel.axhline(variance, color="black", linewidth=0.6, linestyle="-" if resolved else ":")
    words = "read noise" if resolved else "read noise lies below"
    panel.annotate(
        words, (0.01, variance), xycoords=("axes fraction", "data"), fontsize=7, va="bottom"
    )


def _row(facts: IsoFacts) -> tuple[str, ...]:
    record = facts.to_record()
    prefix = "" if facts.read.resolved else "below "
    return (
        f"{facts.iso:g}",
        f"{facts.gain_e_per_dn:.5g}",
        f"{100 * facts.gain_error:.2g}",
        f"{prefix}{facts.read_noise_e:.3g}",
        f"{record['full_well_e']:.5g}",
        f"{facts.black_level:.2f}",
        f"{facts.white_level:g}",
        f"{100 * facts.prnu:.2g}",
        f"{record['dsnu_e']:.2g}",
        "-" if facts.linearity is None else f"{100 * facts.linearity:.2g}",
        f"{facts.pairs}",
    )
