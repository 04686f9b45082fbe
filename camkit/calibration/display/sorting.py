"""Assignment of captures to the targets that they show, with the rough place of the screen."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.calibration.display.camera_file import Lens
from camkit.calibration.display.marks import SeenMarks, find_marks
from camkit.calibration.display.targets import COLOURS, Target, Targets
from camkit.calibration.display.view import View
from camkit.caller import option_text
from camkit.errors import DecodeError

FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sorted:
    """A capture and what it shows.

    Attributes:
        path: The capture.
        target: What it shows.
        to_screen: (3, 3) places without distortion -> px of the screen, by the marks.
    """

    path: Path
    target: Target
    to_screen: FloatGrid


def sort_view(view: View, lens: Lens, targets: Targets) -> Sorted:
    """Return the target that a capture shows, and the rough place of the screen.

    Raises:
        DecodeError: If it has no marks, or such that no target has.
    """
    marks = find_marks(np.sqrt(np.maximum(view.grey, 0)))
    if marks is None:
        raise DecodeError(
            f"{view.path.name} shows no marks; give captures of whole screens with marks, of "
            "colours and pictures alone"
        )
    target = targets.by_code.get(marks.number)
    if target is None:
        raise DecodeError(
            f"the marks of {view.path.name} say {marks.number}, which none of the targets has; "
            f"captures and {option_text('targets')} are of two sets"
        )
    return Sorted(path=view.path, target=target, to_screen=_to_screen(marks, view, lens, targets))


def _to_screen(marks: SeenMarks, view: View, lens: Lens, targets: Targets) -> FloatGrid:
    corners = np.concatenate(list(marks.corners.values()))
    ideal_corners = np.concatenate([targets.screen.corners[number] for number in marks.corners])
    ideal = lens.without_distortion(view.places(corners))
    matrix, _ = cv2.findHomography(ideal, ideal_corners)
    if matrix is None:
        raise DecodeError(f"the marks of {view.path.name} lie on no plane")
    return np.asarray(matrix, dtype=np.float64)


def check_whole(captures: Sequence[Sorted], targets: Targets) -> None:
    """Refuse captures and targets that are not one to one.

    Raises:
        DecodeError: If two captures show one target, a picture has none, or some of the colours
            have and others not.
    """
    paths: dict[str, Path] = {}
    for one in captures:
        other = paths.get(one.target.name)
        if other is not None:
            raise DecodeError(
                f"{other.name} and {one.path.name} both show {one.target.file}; give one of them"
            )
        paths[one.target.name] = one.path
    pictures = [target for target in targets.targets if target.kind == "picture"]
    colours = [target for target in targets.targets if target.kind == "colour"]
    some = any(target.name in paths for target in colours)
    expected = [*pictures, *(colours if some else [])]
    missing = [target.file for target in expected if target.name not in paths]
    if missing:
        raise DecodeError(
            f"no capture shows {', '.join(missing)}; give one of every picture, and of all "
            f"{len(COLOURS)} colours or of none"
        )
    if not pictures:
        raise DecodeError("the targets hold no picture; give some to camkit calibrate targets")
