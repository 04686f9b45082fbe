"""All of it: photographs of a board to the geometry of a camera, judged by pictures left out."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.calibration.geometry.adjustment import rms
from camkit.calibration.geometry.board import Board
from camkit.calibration.geometry.camera_model import FOCAL, Camera, FloatGrid, distance
from camkit.calibration.geometry.choice import (
    LEAST_VIEWS,
    Judged,
    judge_all,
)
from camkit.calibration.geometry.corner_file import CornerFile
from camkit.calibration.geometry.coverage import Coverage
from camkit.calibration.geometry.detector import find_corners
from camkit.calibration.geometry.determination import Determined, determine
from camkit.calibration.geometry.distortion_profile import (
    Profile,
    RadialFit,
    fit_radial,
)
from camkit.calibration.geometry.grey import read_grey
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.progress import counted
from camkit.runtime.raw import file_sha256

MOST_PICTURES: Final = 256
MOST_ERROR: Final = 2e-3
"""Held-out error, of the diagonal, beyond which nothing was explained."""
WEAK_FOCAL: Final = 0.01
"""Standard error of the focal length, of itself, that is worth a word."""
MISSED_PX: Final = 0.2
"""By the polynomial, from which on it is worth a word."""
MOST_FOCAL_PX: Final = 1e6
_OFF_MIDDLE: Final = 0.002
"""Of the diagonal, from which on the optical centre is said to be off the middle."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """A picture that was searched for the board.

    Attributes:
        path: The file.
        size: Width and height, px.
        corners: (corner, 2) x, y; None where there is no board.
    """

    path: Path
    size: tuple[int, int]
    corners: FloatGrid | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Geometry:
    """The geometry of a camera.

    Attributes:
        board: What was photographed.
        views: All pictures, in the order given.
        size: Width and height, px.
        candidates: All models, from simple to rich.
        best: The one taken.
        coverage: Where the board was seen.
        profile: Distortion along a radius.
        radial: The same as the polynomial of `undistort`.
        undetermined: "centre_px" and "focal_px" where the pictures do not tell them: the centre is
            then the middle of the picture, the focal length the nominal one or a guess.
        notes: What people should know.
    """

    board: Board
    views: tuple[View, ...]
    size: tuple[int, int]
    candidates: tuple[Judged, ...]
    best: Judged
    coverage: Coverage
    profile: Profile
    radial: RadialFit
    notes: tuple[str, ...]
    undetermined: tuple[str, ...] = ()

    @property
    def camera(self) -> Camera:
        """Return the camera."""
        return self.best.fit.camera

    @property
    def corners(self) -> FloatGrid:
        """Return (view, corner, 2) of the views with a board, as `best` has them."""
        return np.stack([view.corners for view in self.views if view.corners is not None])

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "board": str(self.board),
            "width_px": self.size[0],
            "height_px": self.size[1],
            "model": self.camera.model.name,
            "focal_px": round(self.camera.focal_px, 4),
            "centre_px": [round(at, 4) for at in self.camera.centre_px],
            "coefficients": self.camera.coefficients.tolist(),
            "rms_px": round(self.best.fit.rms_px, 5),
            "held_out_rms_px": round(self.best.rms_px, 5),
            "held_out_worst_px": round(self.best.worst_px, 5),
            "covered_radius_px": round(self.coverage.radius_px, 3),
            "notes": list(self.notes),
            "radial": self.radial.to_record(),
            "pictures": self._pictures(),
        } | ({"undetermined": list(self.undetermined)} if self.undetermined else {})

    def _pictures(self) -> list[dict[str, Any]]:
        records: list[dict[str, Any]] = []
        fit, number = self.best.fit, 0
        for view in self.views:
            record: dict[str, Any] = {
                "file": view.path.name,
                "found": view.corners is not None,
                "rms_px": None,
            }
            if view.corners is not None:
                record["rms_px"] = round(rms(fit.residuals[number]), 5)
                if self.board.square_mm is not None:
                    squares = distance(fit.poses[number], self.board.points.mean(axis=0))
                    record["distance_mm"] = round(squares * self.board.square_mm, 2)
                number += 1
            records.append(record)
        return records


def calibrate_geometry(
    files: Sequence[Path], board: Board, focal_px: float | None = None
) -> Geometry:
    """Measure the geometry of a camera.

    Args:
        files: Photographs of a flat board at one setting of lens and focus, at every place of the
            picture and tilted.
        board: The board.
        focal_px: Nominal focal length, which is held if the pictures do not determine it.

    Raises:
        ContractError: If the nominal focal length is no number > 0.
        DecodeError: If a file cannot be read or is given twice, sizes differ, fewer than three
            pictures show the board, they contradict each other, or what explains them folds or is
            none of a lens.
    """
    _check_nominal(focal_px)
    return _measured(look_for(files, board), board, focal_px)


def calibrate_corners(file: CornerFile, focal_px: float | None = None) -> Geometry:
    """Measure the geometry of a camera from known corners.

    Args:
        file: The corners; see `corner_file.read_corners`.
        focal_px: Nominal focal length, which is held if the pictures do not determine it; None
            for that of the file, if it states one.

    Raises:
        ContractError: If the nominal focal length is no number > 0.
        DecodeError: If there are fewer than three pictures, they contradict each other, or what
            explains them folds or is none of a lens.
    """
    focal_px = file.focal_px if focal_px is None else focal_px
    _check_nominal(focal_px)
    views = [
        View(path=Path(f"picture {number}"), size=file.size, corners=corners)
        for number, corners in enumerate(file.corners, start=1)
    ]
    _check_enough(views, file.board)
    return _measured(views, file.board, focal_px)


def _check_nominal(focal_px: float | None) -> None:
    if focal_px is not None and not 0 < focal_px < MOST_FOCAL_PX:
        raise ContractError(f"the nominal focal length must be > 0 px; got {focal_px:g}")


def _measured(views: Sequence[View], board: Board, focal_px: float | None) -> Geometry:
    """Return the geometry that views show."""
    with_board = [view for view in views if view.corners is not None]
    corners = np.stack([view.corners for view in with_board if view.corners is not None])
    size = views[0].size
    judged, outliers = judge_all(corners, board.points, size)
    _check_agree(judged, outliers, with_board, size)
    determined = determine(judged, corners, board.points, size, focal_px)
    radial = fit_radial(
        determined.profile, float(np.hypot(*size)) / 2, determined.coverage.corner_px
    )
    return Geometry(
        board=board,
        views=tuple(views),
        size=size,
        candidates=tuple(determined.judged),
        best=determined.best,
        coverage=determined.coverage,
        profile=determined.profile,
        radial=radial,
        notes=_notes(views, size, determined, radial),
        undetermined=determined.undetermined,
    )


def look_for(files: Sequence[Path], board: Board) -> list[View]:
    """Read pictures one after the other and search them for the board.

    Raises:
        DecodeError: If a file cannot be read or is given twice, sizes differ, or fewer than three
            pictures show the board.
    """
    if len(files) > MOST_PICTURES:
        raise DecodeError(f"expected at most {MOST_PICTURES} pictures; got {len(files)}")
    views: list[View] = []
    hashes: dict[str, Path] = {}
    for path in counted(files, "finding corners", "pictures"):
        grey = read_grey(path)
        sha256 = file_sha256(path)
        if sha256 in hashes:
            raise DecodeError(
                f"{hashes[sha256]} and {path} are the same picture; give every picture once"
            )
        hashes[sha256] = path
        size = (grey.shape[1], grey.shape[0])
        views.append(View(path=path, size=size, corners=find_corners(grey, board)))
    _check_sizes(views)
    _check_enough(views, board)
    return views


def _check_enough(views: Sequence[View], board: Board) -> None:
    count = sum(view.corners is not None for view in views)
    if count < LEAST_VIEWS:
        what = f"a board of {board} inner corners"
        problem = f"{count} of {len(views)} pictures show {what}" if count else f"no picture shows {what}"  # noqa: E501 # fmt: skip
        cure = (
            "give more pictures"
            if len(views) < LEAST_VIEWS
            else f"check {option_text('board')} (inner corners, not squares), and show the whole "
            "board with white around it"
        )
        raise DecodeError(f"{problem}, {LEAST_VIEWS} are needed: {cure}")


def _check_sizes(views: Sequence[View]) -> None:
    (usual, _), *others = Counter(view.size for view in views).most_common()
    if others:
        odd = next(view for view in views if view.size != usual)
        raise DecodeError(
            f"{odd.path.name} has {odd.size[0]}x{odd.size[1]} px, others {usual[0]}x{usual[1]}: "
            "give pictures of one camera"
        )


def _check_agree(
    judged: Sequence[Judged],
    outliers: Mapping[int, float],
    views: Sequence[View],
    size: tuple[int, int],
) -> None:
    """Refuse views that contradict each other."""
    if not judged:
        raise DecodeError("no camera explains the corners: the pictures are not of one flat board")
    if outliers:
        outlier_text = ", ".join(
            f"{views[n].path.name} ({error_px:.2f} px rms)" for n, error_px in outliers.items()
        )
        raise DecodeError(
            f"the camera that the other pictures show does not fit {outlier_text}: check "
            f"{option_text('board')}, leave it out, or photograph one flat board at one setting of "
            "lens and focus"
        )
    best = min(judged, key=lambda one: one.rms_px)
    if best.rms_px > MOST_ERROR * np.hypot(*size):
        worst = views[int(best.of_views_px.argmax())].path.name
        raise DecodeError(
            f"the pictures contradict each other: left out, corners are off by {best.rms_px:.2f} "
            f"px rms, most in {worst}; check {option_text('board')}, photograph one flat board at "
            "one setting, and 10 pictures or more"
        )


def _nominal_notes(determined: Determined, size: tuple[int, int]) -> list[str]:
    """Return notes on numbers that the pictures do not determine, and their replacements."""
    notes = []
    if "centre_px" in determined.undetermined:
        x, y = determined.best.fit.camera.centre_px
        notes.append(
            f"the pictures do not determine the optical centre: it is held at the middle of the "
            f"{size[0]}x{size[1]} px, ({x:g}, {y:g}); tilt the board to every side"
        )
    if "focal_px" in determined.undetermined:
        notes.append(f"the pictures do not determine the focal length: {_focal_text(determined)}")
    return notes


def _focal_text(determined: Determined) -> str:
    focal_px = determined.best.fit.camera.focal_px
    if determined.nominal.focal_px is not None:
        return f"it is held at its nominal {focal_px:g} px; tilt the board by 20 degrees or more"
    return (
        f"{focal_px:.0f} px explains them best, with a standard error of "
        f"{determined.focal_error:.0%} by leaving out one after the other; give the nominal one "
        f"({option_text('focal_px')}), or tilt the board by 20 degrees or more"
    )


def _notes(
    views: Sequence[View],
    size: tuple[int, int],
    determined: Determined,
    radial: RadialFit,
) -> tuple[str, ...]:
    best, coverage = determined.best, determined.coverage
    notes = [f"{view.path.name}: no board found" for view in views if view.corners is None]
    if not coverage.is_whole:
        notes.append(
            f"corners were seen to {coverage.radius_px:.0f} px from the optical centre, the "
            f"picture reaches to {coverage.corner_px:.0f} px ({coverage.share:.0%} of it lay "
            "within a board); the distortion beyond is a guess: do not use it"
        )
    notes += _nominal_notes(determined, size)
    error = float(best.formal[FOCAL]) / best.fit.camera.focal_px
    if error > WEAK_FOCAL and not determined.undetermined:
        notes.append(f"the focal length is uncertain by {error:.1%}: tilt the board more")
    middle = ((size[0] - 1) / 2, (size[1] - 1) / 2)
    offset_px = float(np.hypot(*np.subtract(best.fit.camera.centre_px, middle)))
    if offset_px > _OFF_MIDDLE * np.hypot(*size):
        notes.append(
            f"the optical centre lies {offset_px:.1f} px off the middle of the picture, about "
            "which a bundle undistorts unless it states `optical_centre_px`"
        )
    if radial.residual_px > MISSED_PX:
        notes.append(
            f"the radial polynomial misses the model by up to {radial.residual_px:.2f} px within "
            "what was seen"
        )
    return tuple(notes)
