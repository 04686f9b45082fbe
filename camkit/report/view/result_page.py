"""Results of `camkit process` as a page: pictures to compare, maps, and what the sidecars say."""

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final

import numpy as np

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.progress import counted
from camkit.report.pages.page import Cell, Details, Page, Part, Section, Table, Widget, Words
from camkit.report.view.cell_map import TIER_WORDS, spared_cells
from camkit.report.view.photon_archive import read_archive
from camkit.report.view.photon_arrays import (
    ValueMap,
    film_of,
    maps_of,
    photons_before,
)
from camkit.report.view.picture_light import READ_AS, find_original, read_result
from camkit.report.view.record_words import (
    decision_table,
    key_table,
    range_table,
    record_sentences,
)
from camkit.report.view.result_search import ViewedResult
from camkit.report.view.view_crops import choose_crops
from camkit.report.view.viewers import film_viewer, map_viewer, picture_viewer
from camkit.runtime.kinds.spad.products.preview import white_of
from camkit.runtime.raw import is_picture

BRIGHT: Final = 1.02
"""Light from which on a picture gets an exposure slider: white itself scatters a little."""
PHOTON_SIDE_PX: Final = 768
"""About as large as pictures of few pixels are shown."""
KEYS: Final = (
    "Keys: Tab goes from control to control; in a picture the left and right arrows move the "
    "border between before and after, + and - change the exposure by half a stop, and up and down "
    "scroll; in a map the arrows move the cross."
)


def result_page(
    results: Sequence[ViewedResult],
    before_file: Path | None,
    crops: Sequence[tuple[int, int]],
    *,
    most_bytes: int,
) -> Page:
    """Return the page of results.

    Args:
        results: At least one.
        before_file: Picture or capture that stands for the capture of the one result.
        crops: (x, y) of parts to show at 100 %.
        most_bytes: Of the viewers.

    Raises:
        DecodeError: If a result cannot be read; names it.
        ContractError: If a part lies outside, `before_file` fits no result, or the viewers become
            larger.
    """
    sections, titles, size = [], _titles(results), 0
    for number, result in enumerate(counted(results, "reading", "results"), start=1):
        parts: list[Part] = [Words(f"Note: {note}.", "note") for note in result.notes]
        if result.is_archive:
            _check_no_wishes(result, before_file, crops)
            parts += _photon_parts(result)
        else:
            parts += _picture_parts(result, before_file, crops)
        size += sum(len(part.html) for part in parts if isinstance(part, Widget))
        if size > most_bytes:
            raise ContractError(
                f"the page would have more than {most_bytes / 1e6:.0f} MB with {result.path.name}, "
                f"result {number} of {len(results)}: show fewer results on it"
            )
        sections.append(
            Section(titles[number - 1], [*parts, *_record_parts(result)], f"result-{number}")
        )
    return Page(
        title="Results of camkit",
        lead=[_contents(results), Words(KEYS, "small")],
        sections=sections,
        style=_asset("viewer.css"),
        script=_asset("viewer.js"),
    )


def _check_no_wishes(
    result: ViewedResult, before_file: Path | None, crops: Sequence[tuple[int, int]]
) -> None:
    if crops or before_file is not None:
        unused = "crops" if before_file is None else "before_file"
        raise ContractError(
            f"{option_text(unused)} is for pictures; {result.path.name} holds photons"
        )


def _titles(results: Sequence[ViewedResult]) -> list[str]:
    """Return names of files, with their folders where a name comes twice."""
    names = [result.path.name for result in results]
    if len({*names}) == len(names):
        return names
    return [str(result.path) for result in results]


def _contents(results: Sequence[ViewedResult]) -> Table | None:
    if len(results) == 1:
        return None
    rows = [
        (Cell(text=result.path.name, anchor=f"result-{number}"), str(result.path.parent))
        for number, result in enumerate(results, start=1)
    ]
    return Table(header=("result", "folder"), rows=rows)


def _picture_parts(
    result: ViewedResult, before_file: Path | None, centres: Sequence[tuple[int, int]]
) -> list[Part]:
    after = read_result(result.path)
    height, width = after.shape[1:]
    before = find_original(result, before_file, (height, width))
    peak = float(after.max())
    is_bright = peak > BRIGHT
    cells = None if result.record is None else spared_cells(result.record, (height, width))
    facts = f"The picture has {width} x {height} px."
    if result.record is None:
        reading = READ_AS if is_picture(result.path) else "RAW files are developed, not restored"
        facts += f" {reading}."
    if is_bright:
        facts += (
            f" Its brightest sample is {peak:.4g} times white: lower the exposure to look into "
            "lights. The page keeps light from 1/4096 of white to the brightest sample."
        )
    viewer = picture_viewer(
        result.path.name,
        after,
        before.light,
        choose_crops(after, before.light, centres),
        is_bright=is_bright,
        cells=cells,
    )
    return [facts, before.note, viewer, _spared_note(result, cells)]


def _spared_note(result: ViewedResult, cells: object) -> Part:
    if cells:
        letters = ", ".join(f"{letter} {text}" for letter, text in TIER_WORDS.items())
        return Words(
            f"Letters of the cells in which work was spared: {letters}. Cells lie where they are "
            "on the sensor, before distortion is corrected.",
            "small",
        )
    if result.record is None:
        return None
    is_whole = cells is not None or not result.record.get("plan", {}).get("decisions")
    text = "no cell was spared" if is_whole else "the sidecar has no map of cells"
    return Words(f"Where work was spared: {text}; see the decisions below.", "small")


def _photon_parts(result: ViewedResult) -> list[Part]:
    arrays = read_archive(result.path)
    maps, film = maps_of(arrays), film_of(arrays)
    parts: list[Part] = []
    if set(arrays) == {"intensity"} and arrays["intensity"].ndim == 2:
        parts += _photon_picture(result, arrays["intensity"])
    if maps:
        parts += [_map_note(maps), map_viewer(result.path.name, maps)]
    if film is not None:
        parts += [film.note, film_viewer(result.path.name, film)]
    return parts


def _photon_picture(result: ViewedResult, photons: np.ndarray) -> list[Part]:
    coarse, note = photons_before(result, photons.shape)
    white = white_of(photons) or 1.0
    times = max(1, PHOTON_SIDE_PX // max(photons.shape))

    def light_of(values: np.ndarray) -> np.ndarray:
        large = np.maximum(values / white, 0).astype(np.float32)
        return np.stack([large.repeat(times, axis=0).repeat(times, axis=1)] * 3)

    after = light_of(photons)
    before = None if coarse is None else light_of(coarse)
    facts = (
        f"The picture has {photons.shape[1]} x {photons.shape[0]} px, each drawn {times} px wide. "
        f"White is {white:.4g} photons."
    )
    crops = choose_crops(after, before, ())
    return [facts, note, picture_viewer(result.path.name, after, before, crops, is_bright=True)]


def _map_note(maps: Sequence[ValueMap]) -> str:
    height, width = maps[0].size_px
    part = "" if maps[0].stride == 1 else f" One of {maps[0].stride} px along each side is shown."
    return (
        f"The map has {width} x {height} px, {maps[0].valid:.1%} of them valid; others are grey."
        f"{part} Colours run between the percentiles 2 and 98, values beyond have the colours of "
        "the ends."
    )


def _record_parts(result: ViewedResult) -> list[Part]:
    record = result.record
    if record is None:
        return []
    decisions, ranges = decision_table(record), range_table(record)
    parts: list[Part] = [Words("How it was made", "head"), *record_sentences(record)]
    if decisions is not None:
        parts += [Words("What was decided and spared", "head"), decisions]
    if ranges is not None:
        parts += [Words("The capture in the measured range of its bundle", "head"), ranges]
    return [*parts, Details("All keys of the sidecar", key_table(record))]


@cache
def _asset(name: str) -> str:
    return (files("camkit.report.view") / name).read_text(encoding="utf-8")
