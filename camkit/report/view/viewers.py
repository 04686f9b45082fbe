"""Viewers of a page: markup that works from the keyboard, with the data that its script draws."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.report.pages.page import Widget, escaped
from camkit.report.view.cell_map import TIER_WORDS
from camkit.report.view.page_data import (
    coded_bytes,
    coded_colours,
    coded_floats,
    coded_light,
    coded_picture,
    light_scale,
)
from camkit.report.view.photon_arrays import Film, ValueMap
from camkit.report.view.view_crops import Crop

MOST_EV: Final = 6
Cells = Sequence[tuple[int, int, int, int, str]]


def picture_viewer(
    name: str,
    after: FloatArray,
    before: FloatArray | None,
    crops: Sequence[Crop],
    *,
    is_bright: bool,
    cells: Cells | None = None,
) -> Widget:
    """Return the viewer of a picture: before and after, exposure, and where work was spared.

    Args:
        name: Of the result.
        after: (3, h, w) float32 linear Rec.709.
        before: The same of the capture; None for no slider.
        crops: Parts that can be chosen, the whole picture first.
        is_bright: Whether light above white is kept, for the exposure slider.
        cells: See `spared_cells`; None for none.
    """
    peak = max(float(p.max()) for p in (after, before) if p is not None) if is_bright else 1.0
    scale = light_scale(peak)

    def coded(picture: FloatArray | None, crop: Crop) -> str | None:
        if picture is None:
            return None
        part = crop.of(picture)
        return (
            coded_light(part, scale) if is_bright else coded_picture(part, is_exact=crop.step == 1)
        )

    views = [
        {
            "name": crop.name,
            "left": crop.left,
            "top": crop.top,
            "step": crop.step,
            "width": crop.width // crop.step,
            "height": crop.height // crop.step,
            "before": coded(before, crop),
            "after": coded(after, crop),
        }
        for crop in crops
    ]
    data: dict[str, Any] = {"views": views, "cells": cells or [], "tiers": TIER_WORDS}
    if is_bright:
        data["stops"] = scale.stops
    controls = [_buttons("Part of the picture", [crop.name for crop in crops])]
    controls.append(_stage(name, has_before=before is not None))
    if before is not None:
        controls.append(
            '<label class="control"><span>Before</span><input class="split" type="range" min="0" '
            'max="100" step="0.5" value="50" aria-label="Border between before, left, and after, '
            'right"><span>After</span></label>'
        )
    if is_bright:
        low = -int(np.ceil(np.log2(max(peak, 1.0)))) - 1
        controls.append(
            f'<label class="control"><span>Exposure</span><input class="exposure" type="range" '
            f'min="{low}" max="{MOST_EV}" step="0.25" value="0"><output>0 EV</output></label>'
        )
    if cells:
        controls.append(
            '<label class="check"><input class="cells" type="checkbox"> Show where work was spared'
            "</label>"
        )
    controls.append('<button type="button" class="zoom">Fit into the page</button>')
    controls.append('<p class="readout small"></p>')
    return _viewer("picture", name, controls, data)


def map_viewer(name: str, maps: Sequence[ValueMap]) -> Widget:
    """Return the viewer of maps of values: colours with a scale, and the values at the pointer."""
    height, width = maps[0].values.shape
    data = {
        "width": width,
        "height": height,
        "stride": maps[0].stride,
        "maps": [
            {
                "name": one.name,
                "unit": one.unit,
                "low": one.low,
                "high": one.high,
                "turned": one.is_turned,
                "values": coded_floats(one.values),
                "colours": coded_colours(one.colours),
            }
            for one in maps
        ],
    }
    controls = [
        _buttons("Map", [one.name for one in maps]),
        f'<div class="stage" tabindex="0" role="group" aria-label="{escaped(name)}: arrow keys '
        'move the cross, the values stand below"><div class="layers">'
        '<canvas class="values" role="img"></canvas><div class="cross" hidden></div></div></div>',
        '<div class="scale"><output class="low"></output><canvas class="ramp" width="256" '
        'height="1" aria-hidden="true"></canvas><output class="high"></output></div>',
        '<p class="readout" aria-live="polite">Point at a pixel, or press an arrow key in the map, '
        "to read its values.</p>",
    ]
    return _viewer("maps", name, controls, data)


def film_viewer(name: str, film: Film) -> Widget:
    """Return the viewer of a film: frames by a slider, or played."""
    count, height, width = film.codes.shape
    data = {
        "width": width,
        "height": height,
        "labels": film.labels,
        "frames": coded_bytes(film.codes),
    }
    label = f"{escaped(name)}: {escaped(film.name)}"
    controls = [
        f'<div class="stage"><div class="layers"><canvas class="values" role="img" '
        f'aria-label="{label}"></canvas></div></div>',
        '<label class="control"><button type="button" class="play" aria-pressed="false">Play'
        f'</button><input class="frame" type="range" min="0" max="{count - 1}" step="1" value="0" '
        f'aria-label="Frame"><output></output></label>',
    ]
    return _viewer("film", name, controls, data)


def _stage(name: str, *, has_before: bool) -> str:
    text = "before on the left, after on the right" if has_before else "the result"
    sides = ("before", "after") if has_before else ("after",)
    canvases = "".join(f'<canvas class="{side}" role="img"></canvas>' for side in sides)
    line = '<div class="line"><span></span></div>' if has_before else ""
    return (
        f'<div class="stage" tabindex="0" role="group" aria-label="{escaped(name)}: {text}">'
        f'<div class="layers">{canvases}<canvas class="cover" aria-hidden="true" hidden></canvas>'
        f"{line}</div></div>"
    )


def _buttons(label: str, names: Sequence[str]) -> str:
    if len(names) < 2:
        return ""
    buttons = "".join(
        f'<button type="button" aria-pressed="{str(not number).lower()}">{escaped(text)}</button>'
        for number, text in enumerate(names)
    )
    return f'<div class="choice" role="group" aria-label="{label}">{buttons}</div>'


def _viewer(kind: str, name: str, controls: Sequence[str], data: Mapping[str, Any]) -> Widget:
    # in a script of a page, only "<" could end it early
    text = json.dumps({"name": name, **data}, allow_nan=False).replace("<", "\\u003c")
    return Widget(
        f'<div class="viewer" data-kind="{kind}">{"".join(controls)}'
        f'<script type="application/json">{text}</script></div>'
        "<noscript><p class=note>The pictures of this page need JavaScript.</p></noscript>"
    )
