"""OpenEXR, streamed by scanlines: half by default, float as soon as half would overflow."""

import logging
import struct
from pathlib import Path
from typing import Any, Final

import Imath  # type: ignore[import-untyped]
import numpy as np
import OpenEXR

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.files.exr_attributes import COMMENTS, exr_attributes
from camkit.runtime.output.picture_writer import UPRIGHT, Codes, PictureFormat, PictureWriter

HALF_MAX: Final = 65504.0
COPY_ROWS: Final = 256
# RGB (1, 1, 1) stands for diffuse white, shown at 100 cd/m2 on a reference display (BT.2035).
WHITE_LUMINANCE: Final = 100.0
HEADER_BYTES: Final = 65536

_log = logging.getLogger(__name__)


class ExrWriter(PictureWriter):
    """Writes linear RGB or grey with chromaticities and white; PIZ for half, ZIP for float."""

    def __init__(self, path: Path, picture: PictureFormat) -> None:
        super().__init__(path, picture)
        self.is_half = not picture.full_float
        self._names = "Y" if picture.is_grey else "RGB"
        self._stored = 0
        self._file = self._open()

    def encode(self, band: FloatArray) -> Codes:
        """Return the band as float16, or as float32 where float16 would overflow."""
        peak = max(-float(band.min()), float(band.max()))
        fits = self.is_half and peak <= HALF_MAX
        return band.astype(np.float16 if fits else np.float32)

    def store(self, rows: Codes) -> None:
        """Append rows; the first float32 rows turn the file so far into a float file."""
        if self.is_half and rows.dtype == np.float32:
            self._promote()
        samples = rows.astype(np.float16 if self.is_half else np.float32, copy=False)
        planes = (np.ascontiguousarray(plane) for plane in samples)
        self._file.writePixels(dict(zip(self._names, planes, strict=True)), rows.shape[1])
        self._stored += rows.shape[1]

    def finish(self) -> None:
        """Close the file and put the chromaticities in."""
        self._file.close()
        _patch_chromaticities(self.path, self._chromaticities())

    def release(self) -> None:
        """Release the file as it is."""
        self._file.close()

    def _chromaticities(self) -> tuple[float, ...]:
        color = self.picture.color
        return tuple(v for point in (*color.primaries, color.white) for v in point)

    def _open(self) -> Any:
        header = OpenEXR.Header(*self.picture.file_size)
        kind = Imath.PixelType.HALF if self.is_half else Imath.PixelType.FLOAT
        packing = "PIZ_COMPRESSION" if self.is_half else "ZIP_COMPRESSION"
        header["compression"] = Imath.Compression(getattr(Imath.Compression, packing))
        header["channels"] = {c: Imath.Channel(Imath.PixelType(kind)) for c in self._names}
        point = Imath.point(0.0, 0.0)
        self._place(header)
        header["chromaticities"] = Imath.Chromaticities(point, point, point, point)
        header["whiteLuminance"] = WHITE_LUMINANCE
        for name, value in exr_attributes(self.picture.origin.metadata).items():
            header[name] = value
        place = self.picture.origin.place
        # a picture that was turned no longer lies as the sensor does
        if place is not None and place.text and self.picture.orientation == UPRIGHT:
            header[COMMENTS] = place.text.encode()
        return OpenEXR.OutputFile(str(self.path), header)

    def _place(self, header: Any) -> None:
        """Place the pixels where those of the capture lie, as far as they are still the same."""
        window = self.picture.origin.window
        same = window is not None and window.size_px == self.picture.file_size
        if window is None or not same or self.picture.orientation != UPRIGHT:
            return
        for name, (x0, y0, x1, y1) in (
            ("dataWindow", window.data),
            ("displayWindow", window.display),
        ):
            header[name] = Imath.Box2i(Imath.V2i(x0, y0), Imath.V2i(x1, y1))
        header["pixelAspectRatio"] = window.pixel_aspect

    def _promote(self) -> None:
        _log.info("%s: values beyond half; written as float", self.path.name)
        _, height = self.picture.file_size
        row_count, width = self._stored, self.picture.file_size[0]
        filler = np.zeros((COPY_ROWS, width), dtype=np.float16)
        for top in range(row_count, height, COPY_ROWS):
            rows = min(COPY_ROWS, height - top)
            self._file.writePixels(dict.fromkeys(self._names, filler[:rows]), rows)
        self._file.close()
        draft = self.path.with_name(f"{self.path.stem}-half{self.path.suffix}")
        self.path.replace(draft)
        self.is_half = False
        self._stored = 0
        self._file = self._open()
        try:
            self._copy_rows(draft, row_count)
        finally:
            draft.unlink()

    def _copy_rows(self, draft: Path, count: int) -> None:
        source = OpenEXR.InputFile(str(draft))
        kind = Imath.PixelType(Imath.PixelType.FLOAT)
        width = self.picture.file_size[0]
        for top in range(0, count, COPY_ROWS):
            bottom = min(top + COPY_ROWS, count)
            planes = [
                np.frombuffer(source.channel(c, kind, top, bottom - 1), np.float32)
                for c in self._names
            ]
            self.store(np.stack(planes).reshape(-1, bottom - top, width))
        source.close()


def _patch_chromaticities(path: Path, values: tuple[float, ...]) -> None:
    # OpenEXR.OutputFile cuts the attribute to whole numbers (3.5.3), and a file without true
    # chromaticities is taken for Rec.709: the numbers are put in place afterwards.
    marker = b"chromaticities\0chromaticities\0" + struct.pack("<i", 32)
    with path.open("r+b") as file:
        start = file.read(HEADER_BYTES).find(marker)
        if start < 0:
            raise ContractError(f"{path.name}: the EXR header has no chromaticities to fill in")
        file.seek(start + len(marker))
        file.write(struct.pack("<8f", *values))
