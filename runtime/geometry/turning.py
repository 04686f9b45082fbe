"""Pictures turned as EXIF says, and back: orientation 1..8 (CIPA DC-008, tag 274)."""

from typing import Any, Final

from numpy.typing import NDArray

# a quarter turn is undone by the other one; all others undo themselves
_BACK: Final = {6: 8, 8: 6}


def turn(planes: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Rotate a stored picture as a viewer would.

    Args:
        planes: (..., h, w) as stored by the sensor.
        orientation: 1..8.

    Returns:
        A view; (..., w, h) for 5 to 8.
    """
    if orientation >= 5:
        planes = planes.swapaxes(-1, -2)
    # After the transposition of 5..8, these are the mirrors that remain.
    if orientation in {2, 3, 6, 7}:
        planes = planes[..., ::-1]
    if orientation in {3, 4, 7, 8}:
        planes = planes[..., ::-1, :]
    return planes


def turn_back(planes: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Rotate an upright (..., h, w) picture as it was stored; undoes `turn`."""
    return turn(planes, _BACK.get(orientation, orientation))
