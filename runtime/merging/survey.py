"""Every frame of a bracket looked at once, before any of them is merged.

Only what a frame says of itself is kept: its pixels are read again when its turn comes, so that a
bracket takes the memory of one frame.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.noise import NoiseModel
from camkit.picture_window import PictureWindow, common_box
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files.raw_tags import SensorPlace
from camkit.runtime.metadata import Metadata
from camkit.runtime.raw import is_picture, read_capture

SAMPLED_PIXELS: Final = 20_000
SAME_TIME: Final = 1e-3
_MOST_FRAMES: Final = 256
_UNSTATED_S: Final = 1.0  # a single frame is in proportion to itself


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One frame of a bracket, its pixels left in the file.

    Attributes:
        path: The file.
        time_s: Exposure time.
        sha256: Hash of the file.
        noise: As the file states it.
        file_time_s: Exposure time as the file states it; None where it states none.
        window: Where its pixels lie in a larger picture; None if not stated.
        place: Its bundle and its place on the sensor, as the file states them.
        metadata: What the file says of its photograph.
    """

    path: Path
    time_s: float
    sha256: str | None
    noise: NoiseModel | None
    file_time_s: float | None = None
    window: PictureWindow | None = None
    place: SensorPlace = field(default_factory=SensorPlace)
    metadata: Metadata = field(default_factory=Metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """The facts about a bracket.

    Attributes:
        frames: From the longest to the shortest.
        like: The longest frame without its pixels: kind, size, levels, colour. Where frames lie at
            different places of a larger picture, only what all of them hold counts.
        is_raw: Linear samples of a sensor, and not a picture.
        codes: (frame, 3, pixel) uint8 on a lattice; None where pictures are not of 8 bits.
        mosaic: What the caller said of a headerless mosaic or of levels.
        notes: What decoders found worth a word.
        is_timed: Exposure times are known; a single frame may do without, as 1 s.
    """

    frames: tuple[Frame, ...]
    like: Capture
    is_raw: bool
    codes: NDArray[np.uint8] | None
    mosaic: MosaicOptions | None
    notes: tuple[str, ...]
    is_timed: bool = True

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Return the exposure times, longest first."""
        return np.array([frame.time_s for frame in self.frames])


def survey(
    files: Sequence[Path],
    times_s: Sequence[float] | None,
    *,
    mosaic: MosaicOptions | None = None,
    alike: bool = False,
) -> Survey:
    """Read every frame once.

    Args:
        files: Two or more, in any order.
        times_s: One for each file; None for what the files say.
        mosaic: How to read headerless mosaics, or levels in place of a RAW file's.
        alike: A single frame, or frames of one exposure, will do; a single one needs no time.

    Raises:
        ContractError: If there are not two different times, a file is given twice, or times are
            neither stated nor in the files where they are needed.
        DecodeError: If a frame cannot be read, is not finite, or differs from the others in kind
            or size.
    """
    _check_files(files, 1 if alike else 2)
    may_lack_time, is_timed = alike and len(files) == 1, True
    records: list[tuple[Frame, Capture, NDArray[np.uint8] | None]] = []
    untimed: list[str] = []
    for number, path in enumerate(files):
        capture = read_frame(path, mosaic)
        file_time_s = capture.metadata.exposure_time_s or capture.exposure_time_s
        time_s = file_time_s if times_s is None else times_s[number]
        if time_s is None:
            untimed.append(path.name)
            time_s, is_timed = _UNSTATED_S, False
        frame = Frame(
            path=path,
            time_s=time_s,
            sha256=capture.sha256,
            noise=capture.noise,
            file_time_s=file_time_s,
            window=capture.window,
            place=SensorPlace.of(capture),
            metadata=capture.metadata,
        )
        if records:
            check_alike(records[0][1], records[0][0].path, capture, path)
        records.append((frame, without_pixels(capture), _lattice(capture)))
    if untimed and not may_lack_time:
        _refuse_untimed(untimed, len(files))
    if times_s is None:
        _check_settings([(frame.path, capture) for frame, capture, _ in records])
    records.sort(key=lambda one: (-one[0].time_s, str(one[0].path)))
    if not alike:
        _check_exposures([frame for frame, _, _ in records])
    return _joined(records, mosaic, is_timed=is_timed)


def read_frame(path: Path, mosaic: MosaicOptions | None) -> Capture:
    """Read a frame; pictures of 8 bits keep their codes.

    Raises:
        DecodeError: If it cannot be read, or holds what is no number.
    """
    capture = read_capture(path, mosaic=mosaic, keep_codes=True)
    if np.issubdtype(capture.samples.dtype, np.floating):
        bad = int(capture.samples.size - np.count_nonzero(np.isfinite(capture.samples)))
        if bad:
            raise DecodeError(
                f"{path.name}: {bad} samples are NaN or infinite; a frame must be finite"
            )
    return capture


def check_alike(one: Capture, one_path: Path, other: Capture, path: Path) -> None:
    """Refuse a frame that differs from another in kind, size or levels.

    Raises:
        DecodeError: If it does.
    """
    are_placed = one.window is not None and other.window is not None
    aspects = [1.0 if c.window is None else c.window.pixel_aspect for c in (one, other)]
    for what, mine, its in (
        *([] if are_placed else [("size", (one.width, one.height), (other.width, other.height))]),
        ("shape of pixels", aspects[0], aspects[1]),
        ("mosaic", one.cfa, other.cfa),
        ("type of samples", one.samples.dtype.name, other.samples.dtype.name),
        ("white level", one.white_level, other.white_level),
        ("black level", one.black_level.tolist(), other.black_level.tolist()),
        ("orientation", one.orientation, other.orientation),
    ):
        if mine != its:
            raise DecodeError(
                f"frames differ in {what}: {one_path.name} has {mine}, {path.name} {its}; "
                "give frames of one camera and one scene"
            )


def _check_files(files: Sequence[Path], least: int) -> None:
    if not least <= len(files) <= _MOST_FRAMES:
        raise ContractError(f"a bracket has {least} to {_MOST_FRAMES} frames; got {len(files)}")
    resolved: set[Path] = set()
    for path in files:
        if path.resolve() in resolved:
            raise ContractError(f"{path} is given twice; give every frame once")
        resolved.add(path.resolve())


def _refuse_untimed(names: Sequence[str], count: int) -> NoReturn:
    which = names[0] if len(names) == 1 else f"{len(names)} of {count} frames"
    listed = "" if len(names) == 1 else f" ({', '.join(names[:3])}{', ...' * (len(names) > 3)})"
    state = "states" if len(names) == 1 else "state"
    raise ContractError(
        f"{which} {state} no exposure time{listed}; add {option_text('times_s')} with one for each "
        "file"
    )


def _check_settings(frames: Sequence[tuple[Path, Capture]]) -> None:
    """Refuse times alone where aperture or sensitivity changed too."""
    for name, what in (("f_number", "f-number"), ("iso", "ISO")):
        entries = [(path, getattr(c.metadata, name)) for path, c in frames]
        values = {value for _, value in entries if value is not None}
        if len(values) > 1:
            raise ContractError(
                f"frames differ in {what} ({', '.join(f'{v:g}' for v in sorted(values))}), so "
                f"their times do not tell their exposures; add {option_text('times_s')} with "
                "relative exposures"
            )


def _check_exposures(frames: Sequence[Frame]) -> None:
    """Refuse frames of one exposure, longest first."""
    longest, shortest = frames[0], frames[-1]
    if math.isclose(longest.time_s, shortest.time_s, rel_tol=SAME_TIME):
        raise ContractError(
            f"a bracket needs two different exposures; all {len(frames)} frames have "
            f"{longest.time_s:g} s"
        )


def _joined(
    records: list[tuple[Frame, Capture, NDArray[np.uint8] | None]],
    mosaic: MosaicOptions | None,
    *,
    is_timed: bool,
) -> Survey:
    frames = tuple(frame for frame, _, _ in records)
    like, registered = _registered(records[0][1], frames)
    is_raw = not is_picture(frames[0].path) or like.cfa is not None
    lattices = [codes for _, _, codes in records if codes is not None]
    return Survey(
        frames=frames,
        like=like,
        is_raw=is_raw,
        codes=np.stack(lattices) if lattices else None,
        mosaic=mosaic,
        notes=(*_notes([(f.path, capture.notes) for f, capture, _ in records]), *registered),
        is_timed=is_timed,
    )


def _registered(like: Capture, frames: Sequence[Frame]) -> tuple[Capture, tuple[str, ...]]:
    """Return the longest frame as far as all frames reach, and a note where that is less.

    Raises:
        DecodeError: If frames share no place.
    """
    windows = [frame.window for frame in frames if frame.window is not None]
    if len(windows) < len(frames) or len({window.data for window in windows}) == 1:
        return like, ()
    box = common_box([window.data for window in windows])
    if box is None:
        raise DecodeError(
            "the data windows of the frames share no pixel; give frames of one scene, or EXRs "
            "whose windows say where they lie"
        )
    displays = {window.display for window in windows}
    common = replace(
        windows[0], data=box, display=windows[0].display if len(displays) == 1 else box
    )
    wide, high = common.size_px
    note = (
        f"frames are aligned by their data windows: only the {wide}x{high} px from "
        f"({box[0]}, {box[1]}) that all of them share are merged"
    )
    return cropped(like, common), (note,)


def cropped(capture: Capture, window: PictureWindow | None) -> Capture:
    """Return the part of a capture that lies in a window; all of it where windows are unknown."""
    frame_window = capture.window
    if frame_window is None or window is None or frame_window.data == window.data:
        return capture
    left, top = (window.data[n] - frame_window.data[n] for n in (0, 1))
    wide, high = window.size_px
    samples = capture.samples[..., top : top + high, left : left + wide]
    return replace(capture, samples=samples, window=window)


def _notes(frames: Sequence[tuple[Path, tuple[str, ...]]]) -> tuple[str, ...]:
    """Return each note once, with the frame or the number of frames that it is about."""
    by_note: dict[str, list[str]] = {}
    for path, notes in frames:
        for note in notes:
            by_note.setdefault(note, []).append(path.name)
    return tuple(
        f"{names[0] if len(names) == 1 else f'{len(names)} frames'}: {note}"
        for note, names in by_note.items()
    )


def without_pixels(capture: Capture) -> Capture:
    """Return a capture without pixels: its samples become views of one number."""
    one: NDArray[Any] = np.zeros((), dtype=capture.samples.dtype)
    return replace(capture, samples=np.broadcast_to(one, capture.samples.shape))


def _lattice(capture: Capture) -> NDArray[np.uint8] | None:
    """Return (3, pixel) codes of a regular lattice; None for other samples than 8-bit pictures."""
    samples = capture.samples
    if samples.dtype != np.uint8 or capture.cfa is not None:
        return None
    step = max(1, math.isqrt(capture.width * capture.height // SAMPLED_PIXELS))
    picked = samples[:, step // 2 :: step, step // 2 :: step]
    return np.ascontiguousarray(picked.reshape(samples.shape[0], -1))
