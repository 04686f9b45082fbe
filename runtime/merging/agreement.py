"""Facts that all frames of a bracket state alike: the merged picture states them too."""

from dataclasses import replace
from typing import Any, Final

from camkit.runtime.files.raw_tags import SensorPlace
from camkit.runtime.merging.survey import Survey
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.picture_writer import UPRIGHT

_COMPARED: Final = {
    "make": "maker",
    "model": "camera",
    "lens_make": "maker of the lens",
    "lens_model": "lens",
    "iso": "ISO",
    "f_number": "f-number",
    "focal_length_mm": "focal length",
}


def common_place(survey: Survey) -> tuple[SensorPlace | None, str]:
    """Return the place on the sensor that all frames state, and a note where they do not agree."""
    frames, is_upright = survey.frames, survey.like.orientation == UPRIGHT
    if not any(frame.place.text for frame in frames):
        return None, ""
    windows = {None if frame.window is None else frame.window.data for frame in frames}
    if len({frame.place for frame in frames}) == len(windows) == 1 and is_upright:
        return frames[0].place, ""
    first = frames[0]
    other = next((frame for frame in frames if frame.place != first.place), None)
    reason = "the frames are turned" if not is_upright else "their data windows differ"
    if other is not None:
        reason = f"{first.path.name} states {_words(first.place)}, {other.path.name} states "
        reason += _words(other.place)
    return None, f"{reason}: the EXR states neither bundle nor place on the sensor"


def common_metadata(survey: Survey) -> tuple[Metadata, str]:
    """Return the metadata of the longest frame without what frames contradict, and a note on it."""
    differing = []
    for name in _COMPARED:
        values = [getattr(frame.metadata, name) for frame in survey.frames]
        if len({value for value in values if value not in ("", None)}) > 1:
            differing.append(name)
    empty = Metadata()
    changes: dict[str, Any] = {name: getattr(empty, name) for name in differing}
    names = ", ".join(_COMPARED[name] for name in differing)
    note = f"frames differ in {names}: the EXR states none" if names else ""
    return replace(survey.like.metadata, **changes), note


def _words(place: SensorPlace) -> str:
    if not place.text:
        return "no place"
    where = "" if place.origin_px is None else f" at {place.origin_px}"
    sensor = "" if place.sensor_size_px is None else f" of {place.sensor_size_px} px"
    psf = "" if place.psf_sha256 is None else f", PSF {place.psf_sha256[:8]}"
    return f"{place.bundle_name or 'no bundle'}{where}{sensor}{psf}"
