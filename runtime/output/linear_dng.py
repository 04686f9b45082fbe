"""LinearRaw DNG from bands: camera space, white balance divided out, AsShotNeutral kept."""

from pathlib import Path
from typing import Final

import numpy as np

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.output.dng import DngTags, write_linear_dng
from camkit.runtime.output.picture_writer import Codes, PictureFormat, PictureWriter

# Black is 0, though it cuts the negative half of the noise: darktable (4.2.1) subtracts no black
# level from linear DNGs, and any other makes its pictures magenta. 1.0 of the raw signal is white.
BLACK: Final = 0
WHITE: Final = 65535


class LinearDngWriter(PictureWriter):
    """Collects 16-bit planes in sensor orientation and writes them at the end."""

    def __init__(
        self,
        path: Path,
        picture: PictureFormat,
    ) -> None:
        """Open the writer.

        Args:
            path: The file.
            picture: Its format: colour "camera", orientation 1 (the tag tells the viewer); its
                origin gives the tags, and the gains that are divided out.

        Raises:
            ContractError: If the bands are not upright camera colour.
        """
        super().__init__(path, picture)
        if picture.color.space != "camera" or picture.orientation != 1:
            raise ContractError("a DNG takes upright camera RGB; choose --color camera")
        origin = picture.origin
        gains = origin.white_balance
        # one channel comes as three planes of grey
        self._gains = gains * 3 if len(gains) == 1 else gains
        red, green, blue = self._gains
        self._tags = DngTags(
            cfa=None,
            black=BLACK,
            white=WHITE,
            color_matrix=origin.color_matrix,
            as_shot_neutral=(1 / red, 1 / green, 1 / blue),
            camera_model=origin.camera or "camkit",
            iso=origin.iso,
            exposure_time_s=origin.exposure_time_s,
            orientation=origin.orientation,
        )
        self._planes = np.empty((3, picture.height, picture.width), dtype=np.uint16)
        self._stored = 0

    def encode(self, band: FloatArray) -> Codes:
        """Give the band as (3, rows, w) uint16 DN of the raw signal."""
        scale = WHITE / np.array(self._gains)
        codes = band * scale.astype(np.float32)[:, None, None]
        return np.asarray(np.clip(np.rint(codes), 0, WHITE), dtype=np.uint16)

    def store(self, rows: Codes) -> None:
        """Keep rows."""
        end = self._stored + rows.shape[1]
        self._planes[:, self._stored : end] = rows
        self._stored = end

    def finish(self) -> None:
        """Write the file."""
        write_linear_dng(self.path, self._planes, tags=self._tags)

    def release(self) -> None:
        """Nothing is open before the end."""
