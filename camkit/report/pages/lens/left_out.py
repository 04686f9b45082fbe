"""The fields that charts leave out, said below them."""

from camkit.report.figure import Figure
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import to_degrees


def left_out_text(facts: LensFacts) -> str:
    """Return which fields charts leave out and why; empty for none."""
    reasons: dict[str, list[str]] = {}
    for number, angle_rad in enumerate(facts.lens.field_angles_rad):
        why = facts.dark_reason(number)
        if why:
            reasons.setdefault(why, []).append(f"{to_degrees(angle_rad):.4g}°")
    return "; ".join(f"left out: {', '.join(fields)} ({why})" for why, fields in reasons.items())


def say_left_out(figure: Figure, facts: LensFacts, words: str = "") -> None:
    """Write below a figure which fields it leaves out, after other words."""
    text = left_out_text(facts)
    both = "\n".join(part for part in (words, text) if part)
    if both:
        figure.supxlabel(both)
