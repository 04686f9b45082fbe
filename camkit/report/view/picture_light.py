"""A result, and the capture that it was made of, as linear light: (3, h, w), upright, Rec.709."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import find_bundle, open_bundle
from camkit.caller import option_text
from camkit.errors import CamkitError, ContractError, DecodeError
from camkit.report.view.result_search import ViewedResult, is_there
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files.picture import read_orientation, read_scene
from camkit.runtime.geometry.turning import turn
from camkit.runtime.pipeline import load
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.raw import file_sha256, is_picture

_SAME: Final = ("exposure_ev", "demosaic", "scale")
"""Options of a sidecar with which its capture is developed anew, beside the white balance."""
_SAME_OF_BUNDLE: Final = (
    *("configuration", "vignetting", "undistort", "assume", "force_bundle", "depth_m"),
)
"""Likewise those that mean something with its bundle alone."""
_NONE: Final = "none"
READ_AS: Final = (
    "Its codes are read by the colour space that the file states, else as sRGB; floats as linear "
    "light"
)
"""Sentence on a picture of which no sidecar says more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Original:
    """The capture before its restoration.

    Attributes:
        light: (3, h, w) float32 linear Rec.709, as large as the result; None where it is unknown.
        note: What it is, or why it is unknown.
    """

    light: FloatArray | None
    note: str


def read_result(path: Path) -> FloatArray:
    """Read a picture, developing it where it is a RAW file or a linear DNG.

    Raises:
        DecodeError: If it cannot be read; names it.
    """
    try:
        if is_picture(path):
            return np.ascontiguousarray(turn(read_scene(path), read_orientation(path)))
        return _developed(path, {}, None)
    except OSError as error:
        raise DecodeError(f"cannot read {path}: {error.strerror or error}") from error


def find_original(
    result: ViewedResult, before_file: Path | None, size_px: tuple[int, int]
) -> Original:
    """Return the capture of a result, developed alone.

    Args:
        result: The result.
        before_file: A picture or capture that stands for it, or the very capture where it lies
            elsewhere now; None for that which the sidecar names.
        size_px: (height, width) that it must have.

    Raises:
        ContractError: If what is given is of another size.
        DecodeError: If what is given cannot be read.
    """
    if before_file is None or _is_capture(before_file, result.record):
        original = _own_original(result, before_file, size_px)
        if original.light is not None or before_file is None:
            return original
    light = read_result(before_file)
    if light.shape[1:] != size_px:
        raise ContractError(
            f"{before_file} is {_size_text(light.shape[1:])}, the result "
            f"{_size_text(size_px)}: {option_text('before_file')} must be of the same size"
        )
    reading = f" {READ_AS}." if is_picture(before_file) else ""
    return Original(light=light, note=f"Before is {before_file.name}.{reading}")


def doubt_of(before_file: Path, result: ViewedResult) -> tuple[str, ...]:
    """Return a note where a capture stands for another one than that of the sidecar; else none.

    Raises:
        DecodeError: If the file cannot be read.
    """
    record = result.record
    if record is None or _is_capture(before_file, record):
        return ()
    try:
        is_capture = before_file.is_file() and not is_picture(before_file)
    except OSError as error:
        raise DecodeError(f"cannot read {before_file}: {error.strerror or error}") from error
    named_file = Path(str(record["input"]))
    if not is_capture and before_file.suffix.lower() != named_file.suffix.lower():
        return ()  # a picture that somebody developed
    return (
        f"{before_file.name} is not the capture {named_file.name} that the sidecar names: its hash "
        "differs, and before may be another scene",
    )


def _own_original(result: ViewedResult, capture: Path | None, size_px: tuple[int, int]) -> Original:
    """Return the capture of a result, developed as the result was.

    Args:
        result: The result.
        capture: Where its capture lies now; None for where the sidecar says.
        size_px: (height, width) that it must have.
    """
    if result.record is None:
        return Original(light=None, note=f"There is no before: {_advice()}.")
    source, reason = (capture, "") if capture is not None else find_capture(result)
    if source is None:
        return Original(light=None, note=f"There is no before: {reason}; {_advice()}.")
    bundle = _bundle_of(result.record)
    try:
        light = _developed(source, *_settings(result.record, bundle), bundle=bundle)
    except (CamkitError, OSError) as error:
        return Original(light=None, note=f"There is no before: {error}; {_advice()}.")
    if light.shape[1:] != size_px:
        sizes = f"it is {_size_text(light.shape[1:])}, the result {_size_text(size_px)}"
        return Original(light=None, note=f"There is no before: {sizes}; {_advice()}.")
    is_same = bundle != _NONE or not result.record.get("bundle")
    geometry = "as in the result" if is_same else "not corrected, so that edges may be shifted"
    return Original(
        light=light,
        note=f"Before is {source.name}, only developed: demosaicked, white balance and colour "
        f"applied, nothing restored; vignetting and distortion are {geometry}.",
    )


def _is_capture(file: Path, record: Mapping[str, Any] | None) -> bool:
    """Return whether a file is the very capture of a sidecar, wherever it lies now."""
    if record is None or not file.is_file():
        return False
    return bool(file_sha256(file) == record["input_sha256"])


def _bundle_of(record: Mapping[str, Any]) -> str:
    """Return the bundle of a sidecar where this very one is at hand, else none."""
    name = record.get("bundle")
    if not name:
        return _NONE
    try:
        bundle = open_bundle(find_bundle(str(name)))
    except (CamkitError, OSError):
        return _NONE
    return str(bundle.path) if bundle.sha256 == record["bundle_sha256"] else _NONE


def find_capture(result: ViewedResult) -> tuple[Path | None, str]:
    """Return the capture that a sidecar names, if it is there and unchanged, else why not."""
    record = result.record or {}
    named_file = Path(str(record.get("input")))
    output, base = Path(str(record.get("output"))), result.path.resolve().parent
    # the sidecar's paths count from the folder in which camkit process ran
    ran_in = base
    if not output.is_absolute():
        for _ in output.parent.parts:
            ran_in = ran_in.parent
    places = (
        named_file,
        ran_in / named_file,
        base / named_file.name,
        base.parent / named_file.name,
    )
    files = [place for place in places if is_there(place)]
    if not files:
        return None, f"the capture {named_file} is not there"
    try:
        for file in files:
            if file_sha256(file) == record.get("input_sha256"):
                return file, ""
    except OSError as error:
        return None, f"the capture cannot be read: {error.strerror}"
    return None, f"{files[0]} is not the capture that was processed: its hash differs"


def _settings(
    record: Mapping[str, Any], bundle: str
) -> tuple[dict[str, Any], MosaicOptions | None]:
    options = record.get("options")
    if not isinstance(options, dict):
        return {}, None
    if options.get("tone") is not None or options.get("halves") is not None:
        raise ContractError("the capture was read with a tone curve, or as two halves")
    names = _SAME if bundle == _NONE else (*_SAME, *_SAME_OF_BUNDLE)
    choices = {name: options[name] for name in names if name in options}
    if choices.get("depth_m") == "inf":
        choices["depth_m"] = math.inf
    for name in ("white_balance", "origin_px"):
        if options.get(name) is not None and (name != "origin_px" or bundle != _NONE):
            choices[name] = tuple(options[name])
    if bundle != _NONE:
        choices["method"] = DEVELOP
    mosaic = options.get("mosaic")
    return choices, None if mosaic is None else MosaicOptions(**mosaic)


def _developed(
    path: Path,
    choices: Mapping[str, Any],
    mosaic: MosaicOptions | None,
    *,
    bundle: str = _NONE,
) -> FloatArray:
    developed = load(bundle, **choices).process(path, mosaic=mosaic)
    return np.ascontiguousarray(turn(developed.image, developed.orientation))


def _size_text(size_px: tuple[int, ...]) -> str:
    return f"{size_px[1]} x {size_px[0]} px"


def _advice() -> str:
    return f"{option_text('before_file')} gives one"
