"""Place of the pixels of a file in a larger picture, and the shape of its pixels (OpenEXR).

Reference: OpenEXR, "Technical Introduction" (data window, display window, pixel aspect ratio).
"""

from dataclasses import dataclass

Box = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureWindow:
    """The windows of a file; boxes are x0, y0, x1, y1 with both ends inside.

    Attributes:
        data: Of the pixels that the file has.
        display: Of the picture that they belong to.
        pixel_aspect: Width over height of a pixel.
    """

    data: Box
    display: Box
    pixel_aspect: float = 1.0

    @property
    def size_px(self) -> tuple[int, int]:
        """Return (width, height) of the data."""
        x0, y0, x1, y1 = self.data
        return x1 - x0 + 1, y1 - y0 + 1

    @property
    def is_whole(self) -> bool:
        """Return whether the data are the whole display."""
        return self.data == self.display

    @property
    def note(self) -> str:
        """Return a note about it for people; empty for a whole picture of square pixels."""
        x0, y0, x1, y1 = self.display
        parts = []
        if not self.is_whole:
            parts.append(
                f"its data window is {self.size_px[0]}x{self.size_px[1]} px from "
                f"({self.data[0]}, {self.data[1]}) of a display window of {x1 - x0 + 1}x"
                f"{y1 - y0 + 1} px from ({x0}, {y0})"
            )
        if self.pixel_aspect != 1:
            parts.append(f"its pixels are {self.pixel_aspect:g} times as wide as high")
        return f"{' and '.join(parts)}: kept in EXR alone" if parts else ""


def common_box(boxes: list[Box]) -> Box | None:
    """Return the box that lies in all of several; None where there is none."""
    x0, y0 = (max(box[n] for box in boxes) for n in (0, 1))
    x1, y1 = (min(box[n] for box in boxes) for n in (2, 3))
    return (x0, y0, x1, y1) if x0 <= x1 and y0 <= y1 else None
