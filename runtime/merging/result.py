"""A merged bracket as an EXR: pictures as they are, RAW developed to linear Rec.709.

1.0 is the white of the reference frame. A merged mosaic goes through the same development as a
single capture; its white is that of the shortest frame, so that highlights which no frame holds
are made neutral as they are in one photograph.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.color import color_stage
from camkit.runtime.files.raw_tags import SensorPlace
from camkit.runtime.merging.agreement import common_metadata, common_place
from camkit.runtime.merging.merge import Merged, choose_response, merge
from camkit.runtime.merging.response import ResponseName
from camkit.runtime.merging.survey import Frame, Survey
from camkit.runtime.metadata import Metadata
from camkit.runtime.options import Options
from camkit.runtime.output.origin import Origin
from camkit.runtime.output.part_file import atomic_outputs
from camkit.runtime.output.picture_writer import PictureFormat, PictureWriter
from camkit.runtime.output.tone_mapping import ToneMappedPreview
from camkit.runtime.output.writer import open_writer
from camkit.runtime.pipeline import Pipeline

_LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # ITU-R BT.709-6
_STEPS_PER_STOP: Final = 32
_STOPS: Final = 64
_TAIL: Final = 1e-4
_ROWS: Final = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """The facts about a merge.

    Attributes:
        frames: Names of the files, from the longest to the shortest.
        times_s: Their exposure times.
        response: What codes were taken for.
        reference: Name of the frame whose white is 1.0.
        range_stops: Between the darkest and the brightest 0.01 % of the picture's luminance.
        clipped_fraction: Share of samples that are clipped in every frame.
        notes: What the user should know.
    """

    frames: tuple[str, ...]
    times_s: tuple[float, ...]
    response: ResponseName
    reference: str
    range_stops: float
    clipped_fraction: float
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON values."""
        return {
            "frames": list(self.frames),
            "times_s": list(self.times_s),
            "response": self.response,
            "reference": self.reference,
            "range_stops": round(self.range_stops, 2),
            "clipped_fraction": self.clipped_fraction,
            "notes": list(self.notes),
        }


def merge_to_exr(
    survey: Survey,
    out: Path,
    *,
    response: ResponseName | None = None,
    reference: str | None = None,
    preview: Path | None = None,
) -> Report:
    """Merge a bracket and write it; the files appear complete or not at all.

    Args:
        survey: The bracket.
        out: The EXR, 32 bits.
        response: What codes stand for; None chooses, see `choose_response`.
        reference: Name of the frame whose white is 1.0; None for the middle one by time, of two
            the shorter.
        preview: A small tone-mapped JPEG to write too, see `tone_mapping`.

    Raises:
        ContractError: If response or reference do not fit the frames.
        DecodeError: If a frame cannot be read.
        OSError: If the file cannot be written.
    """
    frame = reference_frame(survey, reference)
    curve, note = choose_response(survey, response)
    merged = merge(survey, curve)
    place, place_note = common_place(survey)
    metadata, metadata_note = common_metadata(survey)
    facts = _Facts(
        metadata=replace(metadata, exposure_time_s=_metadata_time_s(frame.time_s)), place=place
    )
    luminance = _Luminance(
        None if preview is None else ToneMappedPreview(*survey.like.plane_shape[1:])
    )
    warnings: tuple[str, ...] = ()
    with atomic_outputs(out, *([] if preview is None else [preview])) as (part, *parts):
        if survey.is_raw:
            warnings = _develop(part, survey, merged, frame, facts, luminance)
        else:
            _write_picture(part, survey, merged, frame, facts, luminance)
        if luminance.preview is not None:
            luminance.preview.write(parts[0], color_stage(None), survey.like.orientation)
    return Report(
        frames=tuple(one.path.name for one in survey.frames),
        times_s=tuple(one.time_s for one in survey.frames),
        response=merged.response,
        reference=frame.path.name,
        range_stops=luminance.stops,
        clipped_fraction=merged.clipped_fraction,
        notes=tuple(
            dict.fromkeys(
                (*survey.notes, *filter(None, (note, place_note, metadata_note)), *warnings)
            )
        ),
    )


def reference_frame(survey: Survey, name: str | None) -> Frame:
    """Return the frame of a name, or the middle one by time.

    Raises:
        ContractError: If no frame, or more than one, has the name.
    """
    if name is None:
        return survey.frames[len(survey.frames) // 2]
    matches = [frame for frame in survey.frames if name in (frame.path.name, str(frame.path))]
    if len(matches) != 1:
        raise ContractError(
            f"{option_text('reference')} must name one of the frames; {name!r} names "
            f"{len(matches)} of them"
        )
    return matches[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Facts:
    """Facts that the EXR states: of the photograph, and its place on the sensor."""

    metadata: Metadata
    place: SensorPlace | None


def _write_picture(
    path: Path,
    survey: Survey,
    merged: Merged,
    frame: Frame,
    facts: _Facts,
    luminance: "_Luminance",
) -> None:
    gain = np.float32(merged.times_s[survey.frames.index(frame)] / merged.times_s[0])
    light, like = merged.light, survey.like
    bands = (light[:, top : top + _ROWS] * gain for top in range(0, like.height, _ROWS))
    origin = Origin(
        camera=like.camera,
        metadata=facts.metadata,
        orientation=like.orientation,
        window=like.window,
        place=facts.place,
    )
    picture = PictureFormat(
        width=like.width,
        height=like.height,
        color=color_stage(None),
        orientation=like.orientation,
        full_float=True,
        origin=origin,
    )
    with open_writer(path, "exr", picture) as writer:
        _write(writer, bands, luminance)


def _develop(
    path: Path,
    survey: Survey,
    merged: Merged,
    frame: Frame,
    facts: _Facts,
    luminance: "_Luminance",
) -> tuple[str, ...]:
    """Develop light of a sensor; return the warnings."""
    longest_s, shortest_s = survey.frames[0].time_s, survey.frames[-1].time_s
    light = merged.light
    light *= np.float32(shortest_s / longest_s)
    like = survey.like
    capture = Capture(
        samples=light if like.cfa is None else light[0],
        cfa=like.cfa,
        black_level=np.zeros_like(like.black_level),
        white_level=1.0,
        white_balance=like.white_balance,
        color_matrix=like.color_matrix,
        orientation=like.orientation,
        iso=None if facts.metadata.iso is None else like.iso,
        exposure_time_s=facts.metadata.exposure_time_s,
        camera=like.camera,
        metadata=facts.metadata,
    )
    options = Options(exposure_ev=math.log2(frame.time_s / shortest_s))
    work = Pipeline(None, options).start(capture)
    picture = PictureFormat(
        width=like.width,
        height=like.height,
        color=work.color,
        orientation=like.orientation,
        full_float=True,
        origin=replace(work.origin, place=facts.place),
    )
    with open_writer(path, "exr", picture) as writer:
        _write(writer, work.bands(), luminance)
    return work.warnings


def _write(writer: PictureWriter, bands: Iterator[FloatArray], luminance: "_Luminance") -> None:
    for band in bands:
        luminance.add(band)
        writer.write(band)


def _metadata_time_s(time_s: float) -> float | None:
    """Return a time as metadata can hold it; relative exposures may be beyond."""
    return time_s if 1e-7 <= time_s <= 1e6 else None


class _Luminance:
    """A histogram of the luminance over stops, and the preview."""

    def __init__(self, preview: ToneMappedPreview | None) -> None:
        self.preview = preview
        self._counts = np.zeros(_STOPS * _STEPS_PER_STOP, dtype=np.int64)

    def add(self, band: FloatArray) -> None:
        """Add a (3, rows, w) band."""
        if self.preview is not None:
            self.preview.add(band)
        luminance = np.tensordot(_LUMINANCE, band, 1)
        stops = np.log2(luminance[luminance > 0])
        bins = ((stops + _STOPS / 2) * _STEPS_PER_STOP).astype(np.int64)
        self._counts += np.bincount(
            np.clip(bins, 0, self._counts.size - 1), minlength=self._counts.size
        )

    @property
    def stops(self) -> float:
        """Return the stops between the tails."""
        shares = np.cumsum(self._counts) / max(int(self._counts.sum()), 1)
        low, high = np.searchsorted(shares, (_TAIL, 1 - _TAIL))
        return max(0.0, float(high - low) / _STEPS_PER_STOP)
