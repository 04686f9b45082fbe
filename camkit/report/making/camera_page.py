"""The page of a camera that was made: the lens, its blur, before and after, laws, seconds."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.report.figure import encode_png, levels_of, to_png
from camkit.report.making.camera_judging import FILTER, TRUTH, Judgement
from camkit.report.pages.calibration.psf_field_page import draw_field
from camkit.report.pages.page import Page, Part, Picture, Section, Table, sentences, to_html
from camkit.runtime.plan.decision import DEVELOP

NAMES: Final = {DEVELOP: "developed alone", FILTER: "filter", TRUTH: TRUTH}
_PAIR: Final = "The same capture, from left to right: {}. Three pixels of the page for one."
_BLUR: Final = "Kernels at the nearest distance. Logarithm of the light, four decades."
_ENLARGED: Final = 3
_CROP_PX: Final = 128


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeCamera:
    """A camera and what is known of it.

    Attributes:
        bundle: As it was written.
        facts: Of the lens and the sensor; see `DescribedCamera.facts`.
        judged: Method -> decibels.
        pictures: Title -> (3, h, w) sRGB values, in the order of the page.
        seconds: What was timed -> CPU-seconds.
        steps: Step -> CPU-seconds.
        layout: Drawing of the lens as PNG; None for kernels that are of none.
    """

    bundle: Bundle
    facts: Mapping[str, Any]
    judged: Mapping[str, Judgement]
    pictures: Mapping[str, FloatArray]
    seconds: Mapping[str, float]
    steps: Mapping[str, float]
    layout: bytes | None


def camera_html(camera: MadeCamera) -> str:
    """Return the page."""
    bundle, facts = camera.bundle, camera.facts
    size = "{width_px}x{height_px} of {pixel_pitch_um:g} um".format(**facts["sensor"])
    lead: list[Part] = [
        f"{facts['efl_mm']:.4g} mm F/{facts['f_number']:.3g} on {size}"
        if "efl_mm" in facts
        else f"A measured point spread function on {size}",
        sentences(*facts["notes"]),
    ]
    if facts["defaults"]:
        lead.append(f"Defaults of the sensor, not facts: {', '.join(facts['defaults'])}.")
    sections = [
        Section("Decibels", (_decibels(camera.judged),)),
        Section("Before and after", (_before_and_after(camera.pictures),)),
        Section("Blur over the field", (Picture(_BLUR, to_png(draw_field(bundle.psf))),)),
        Section("Laws of a picture", (_laws(bundle),)),
        Section("Seconds", (_seconds(camera),)),
    ]
    if camera.layout is not None:
        sections.insert(2, Section("The lens", (Picture("", camera.layout),)))
    return to_html(Page(title=f"The camera {bundle.manifest.name}", lead=lead, sections=sections))


def name_of(method: str) -> str:
    """Return what people call a method."""
    return NAMES.get(method, f"network {method}")


def _decibels(judged: Mapping[str, Judgement]) -> Table:
    rows = []
    for method, judgement in judged.items():
        gains = [
            "" if method == base else _with_error(judgement.gain_over(judged[base]))
            for base in (DEVELOP, FILTER)
        ]
        rows.append((name_of(method), f"{np.mean(judgement.psnr_db):.2f}", *gains))
    return Table(
        header=("method", "PSNR, dB", "over developed alone", "over the filter"),
        rows=rows,
        meanings=("", "Mean over captures, sRGB values", "Paired, with the error over scenes", ""),
    )


def _with_error(gain: tuple[float, float]) -> str:
    return f"{gain[0]:+.2f} ± {gain[1]:.2f}"


def _before_and_after(pictures: Mapping[str, FloatArray]) -> Picture:
    names = ", ".join(name_of(title) for title in pictures)
    return Picture(_PAIR.format(names), _strip(pictures))


def _strip(pictures: Mapping[str, FloatArray]) -> bytes:
    """Return crops side by side as PNG."""
    crops = []
    for picture in pictures.values():
        top, left = ((side - _CROP_PX) // 2 for side in picture.shape[1:])
        crops.append(picture[:, top : top + _CROP_PX, left : left + _CROP_PX])
    return encode_png(levels_of(np.concatenate(crops, axis=2), _ENLARGED))


def _laws(bundle: Bundle) -> Table | str:
    laws = bundle.manifest.laws
    rows = [
        (
            *(size, name.replace("_", " "), f"{law.worst:.3g}", f"{law.limit:.3g}", law.unit),
            "kept" if law.kept else "broken",
        )
        for size, entries in (laws or {}).items()
        for name, law in entries.items()
    ]
    if not rows:
        return "No network, so none to measure."
    return Table(header=("size", "law", "worst", "limit", "unit", ""), rows=rows)


def _seconds(camera: MadeCamera) -> Table:
    rows = [(what, f"{value:.3g}") for what, value in camera.seconds.items()]
    rows += [(f"making: {step}", f"{value:.3g}") for step, value in camera.steps.items()]
    return Table(header=("what", "CPU-seconds"), rows=rows)
