"""Tolerances for people: yield curve, classes of errors, worst single errors, table and JSON."""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.models_def.design.ranking import Offender, Ranked, rank_agreement
from camkit.models_def.design.tolerance import Measured, ToleranceResult
from camkit.models_def.optics.tolerance.deviation import Single
from camkit.models_def.optics.tolerance.error_table import in_file_units
from camkit.report.figure import (
    TICK_PT,
    Figure,
    Panel,
    chart,
    field_color,
    new_figure,
    to_png,
    to_svg,
)
from camkit.units import UM_PER_MM, to_degrees

PERCENTS: Final = (10, 50, 90)
LOSSES_DB: Final = (0.25, 0.5, 1.0, 2.0, 3.0)
_WORST: Final = 10


def chart_paths(folder: Path, name: str) -> tuple[Path, Path, Path]:
    """Return the files of a run: PNG, SVG, JSON."""
    endings = (".png", ".svg", ".json")
    png, svg, text = (folder / f"{name}-tolerance{ending}" for ending in endings)
    return png, svg, text


def write_tolerance(result: ToleranceResult, folder: Path, name: str) -> tuple[Path, ...]:
    """Write chart and JSON; give the files."""
    folder.mkdir(parents=True, exist_ok=True)
    png, svg, text = chart_paths(folder, name)
    figure = draw_yield(result)
    svg.write_text(to_svg(figure), encoding="utf-8")
    png.write_bytes(to_png(figure))
    text.write_text(json.dumps(to_json(result), indent=1) + "\n", encoding="utf-8")
    return png, svg, text


@chart
def draw_yield(result: ToleranceResult) -> Figure:
    """Draw the yield over PSNR and RMS spot, what each class costs alone, and the worst errors."""
    figure = new_figure(11, 7.8)
    (left, middle), (right, last) = figure.subplots(2, 2)
    _draw_share(left, result)
    rms_um = _overall_um(result.copies)
    order = np.sort(rms_um)
    middle.step(order, np.arange(1, len(order) + 1) / len(order) * 100, where="post")
    middle.axvline(_overall_um(result.nominal)[0], color="black", linewidth=0.8, linestyle="--")
    middle.set_xlabel("RMS spot over all fields, at most, µm")
    _draw_classes(right, result)
    _draw_worst(last, result)
    for panel in (left, middle):
        panel.set(ylabel="share of Monte-Carlo samples, %", ylim=(0, 102))
    return figure


def _draw_share(panel: Panel, result: ToleranceResult) -> None:
    order = np.sort(result.copies.mean_db)
    share = 100 * (1 - np.arange(len(order)) / len(order))
    panel.step([*order, order[-1]], [*share, 0], where="pre", color=field_color(0))
    nominal = result.nominal.mean_db[0]
    panel.axvline(nominal, color="black", linewidth=0.8, linestyle="--", label="as designed")
    for percent in PERCENTS:
        label = "10, 50, 90 % of the samples are below" if percent == PERCENTS[0] else None
        place = result.percentile_db(percent), 100 - percent
        panel.plot(*place, "o", color=field_color(2), label=label)
    panel.set(
        title=f"{result.lens.name}: {len(order)} Monte-Carlo samples",
        xlabel="PSNR after recovery, at least, dB",
    )
    panel.legend(loc="lower left")
    # the same downwards is upwards
    loss = panel.secondary_xaxis("top", functions=(lambda x: nominal - x, lambda x: nominal - x))
    loss.set_xlabel("loss against the design, at most, dB")
    loss.tick_params(labelsize=TICK_PT)


def _draw_classes(panel: Panel, result: ToleranceResult) -> None:
    classes = result.classes[::-1]
    names = [
        f"{c.error_class.replace('_', ' ')} {in_file_units(c.error_class, c.half_width)}"
        for c in classes
    ]
    mean = [float(c.loss_db.mean()) for c in classes]
    panel.barh(names, mean, color=field_color(0))
    for place, sensitivity in enumerate(classes):
        panel.plot(
            sensitivity.loss_db, [place] * len(sensitivity.loss_db), ".", color=field_color(2)
        )
    panel.axvline(0, color="black", linewidth=0.8)
    panel.set_title("each class alone at its limit: mean loss, dB (dot: one sample)")
    panel.grid(visible=False)


def _draw_worst(panel: Panel, result: ToleranceResult) -> None:
    worst = result.ranking[:_WORST][::-1]
    names = [
        f"{one.single.error_class.replace('_', ' ')}{_part(one.single, ' ')} "
        f"{in_file_units(one.single.error_class, one.single.value)}"
        for one in worst
    ]
    panel.barh(names, [one.loss_db for one in worst], color=field_color(0))
    for place, one in enumerate(worst):
        panel.text(max(one.loss_db, 0), place, f" {one.spot_place}", va="center", fontsize=7)
    panel.axvline(0, color="black", linewidth=0.8)
    panel.set_title("worst single errors: loss, dB (number: place by spots)")
    panel.margins(x=0.08)
    panel.grid(visible=False)


def _part(single: Single, space: str = "") -> str:
    return "" if single.part is None else f"{space}{single.part}"


def _overall_um(measured: Measured) -> "np.ndarray[Any, np.dtype[np.float64]]":
    return np.asarray(np.sqrt((measured.spot_rms_mm**2).mean(1)) * UM_PER_MM)


def to_json(result: ToleranceResult) -> dict[str, Any]:
    """Return the object that `camkit lens tolerance --json` prints."""
    nominal, copies, run = result.nominal, result.copies, result.run
    nominal_db = float(nominal.mean_db[0])
    return {
        "name": result.lens.name,
        "samples": run.copies,
        "seed": run.seed,
        "compensator": result.tolerances.compensator,
        "compensator_gap": result.tolerances.compensator_gap,
        "pixel_pitch_um": run.pitch_um,
        "noise": run.noise,
        "kernel_px": result.kernel_px,
        "energy_kept": min(nominal.energy_kept, copies.energy_kept),
        "nominal_psnr_db": nominal_db,
        "psnr_db": sorted(copies.mean_db.tolist()),
        "percentiles_db": {f"p{p}": result.percentile_db(p) for p in PERCENTS},
        "yield": [
            {
                "loss_db": loss,
                "psnr_db": nominal_db - loss,
                "share": result.share_at_least(nominal_db - loss),
            }
            for loss in LOSSES_DB
        ],
        "nominal_spot_rms_mm": float(_overall_um(nominal)[0] / UM_PER_MM),
        "spot_rms_mm": sorted((_overall_um(copies) / UM_PER_MM).tolist()),
        "refocus_mm": _range(copies.refocus_mm),
        "gap_mm": _range(copies.gap_mm),
        "fields": [_field(result, i) for i in range(len(result.fields))],
        "sensitivity": [
            {
                "class": c.error_class,
                "half_width": in_file_units(c.error_class, c.half_width),
                "loss_db": float(c.loss_db.mean()),
                "worst_loss_db": float(c.loss_db.max()),
                "spot_growth_mm": c.spot_growth_mm,
            }
            for c in result.classes
        ],
        "worst_offenders": [_offender(offender) for offender in result.offenders[:_WORST]],
        "ranking": [_ranked(one) for one in result.ranking],
        "rank_agreement": rank_agreement(result.ranking),
    }


def _range(values: "np.ndarray[Any, np.dtype[np.float64]]") -> dict[str, float]:
    return {"min": float(values.min()), "max": float(values.max())}


def _field(result: ToleranceResult, number: int) -> dict[str, Any]:
    share, azimuth_deg = result.fields[number]
    edge_slope = np.tan(max(result.lens.field_angles_rad, default=0.0))
    psnr, spot = result.copies.psnr_db[:, number], result.copies.spot_rms_mm[:, number]
    return {
        "field_angle_deg": round(to_degrees(float(np.arctan(share * edge_slope))), 9),
        "azimuth_deg": azimuth_deg,
        "nominal_psnr_db": float(result.nominal.psnr_db[0, number]),
        "psnr_db": {f"p{p}": float(np.percentile(psnr, p)) for p in PERCENTS},
        "nominal_spot_rms_mm": float(result.nominal.spot_rms_mm[0, number]),
        "spot_rms_mm": {f"p{p}": float(np.percentile(spot, p)) for p in PERCENTS},
    }


def _offender(offender: Offender | Ranked) -> dict[str, Any]:
    single = offender.single
    return {
        "class": single.error_class,
        "part": single.part,
        "error": in_file_units(single.error_class, single.value),
        "loss_db": offender.loss_db,
        "spot_growth_mm": offender.spot_growth_mm,
    }


def _ranked(one: Ranked) -> dict[str, Any]:
    places = {"place": one.loss_place, "place_by_spots": one.spot_place}
    return {**places, **_offender(one), "worst_spot_growth_mm": one.worst_spot_growth_mm}


def to_text(result: ToleranceResult) -> str:
    """Return the table for the terminal."""
    nominal = float(result.nominal.mean_db[0])
    spots = _overall_um(result.copies)
    low, middle, high = (result.percentile_db(p) for p in PERCENTS)
    yields = ", ".join(
        f"{100 * result.share_at_least(nominal - loss):.0f} % within {loss:g} dB"
        for loss in LOSSES_DB
    )
    lines = [
        f"{result.lens.name}: {result.run.copies} Monte-Carlo samples, refocused at assembly: "
        f"{result.tolerances.compensator}{_gap_text(result)}",
        f"PSNR after recovery: {nominal:.2f} dB as designed; of the samples 10 % are below "
        f"{low:.2f}, half below {middle:.2f}, 90 % below {high:.2f} dB",
        f"of the design: {yields}",
        f"RMS spot over all fields: {_overall_um(result.nominal)[0]:.2f} um as designed, samples "
        f"{spots.min():.2f} to {spots.max():.2f} um",
    ]
    if result.classes:
        first, count = result.classes[0], len(result.classes[0].loss_db)
        if first.loss_db.mean() > 0:
            lines.append(f"tighten first: {first.error_class} ({first.loss_db.mean():.2f} dB)")
        lines += [
            "",
            f"each class alone, all its errors at their limits with random signs, {count} samples:",
            f"{'class':<19} {'half-width':>12} {'mean loss dB':>12} {'worst':>7}",
        ]
    lines += [
        f"{c.error_class:<19} {in_file_units(c.error_class, c.half_width):>12} "
        f"{c.loss_db.mean():12.2f} {c.loss_db.max():7.2f}"
        for c in result.classes
    ]
    return "\n".join([*lines, *_worst_lines(result)])


def _worst_lines(result: ToleranceResult) -> list[str]:
    """Return both orders of single errors: by loss each part once, by spots each limit.

    Beside its place by spots an error has the growth at the limit with the larger spots.
    """
    if not result.offenders:
        return []
    head = f"{'part':>4} {'error':>13} {'loss dB':>8}"
    grows = "spot grows um"
    lines = [
        "",
        f"{'worst by loss':<19} {head} {grows + ', either limit':>27} {'place by spots':>15}",
    ]
    lines += [
        f"{_row(one)} {one.worst_spot_growth_mm * UM_PER_MM:+27.3f} {one.spot_place:15d}"
        for one in result.ranking[:_WORST]
    ]
    lines += ["", f"{'worst by spots':<19} {head} {grows:>13}"]
    lines += [
        f"{_row(one)} {one.spot_growth_mm * UM_PER_MM:+13.3f}" for one in result.offenders[:_WORST]
    ]
    agreement = rank_agreement(result.ranking)
    if agreement is not None:
        lines += ["", f"order by loss against order by spots: {agreement:.2f} (Spearman, 1 = same)"]
    return lines


def _row(one: Offender | Ranked) -> str:
    single = one.single
    error = in_file_units(single.error_class, single.value)
    return f"{single.error_class:<19} {_part(single) or '-':>4} {error:>13} {one.loss_db:8.3f}"


def _gap_text(result: ToleranceResult) -> str:
    number, moves = result.tolerances.compensator_gap, result.copies.gap_mm
    if number is None:
        return ""
    return f" after surface {number} ({moves.min():+.3f} to {moves.max():+.3f} mm)"
