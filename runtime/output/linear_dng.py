"""LinearRaw DNG from bands: camera space, white balance divided out, AsShotNeutral kept."""

from pathlib import Path
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.output.dng import DngTags, open_linear_dng
from camkit.runtime.output.dng_preview import Averages
from camkit.runtime.output.picture_writer import Codes, PictureFormat, PictureWriter

# Black is 0, though it cuts the negative half of the noise: darktable (4.2.1) subtracts no black
# level from linear DNGs, and any other makes its pictures magenta. 1.0 of the raw signal is white.
BLACK: Final = 0
WHITE: Final = 65535
LEAST_PREVIEW_STEP: Final = 2
"""The preview must be smaller than the picture, see `DngFile.finish`."""


class LinearDngWriter(PictureWriter):
    """Streams 16-bit rows in sensor orientation; the averages of its preview follow at the end."""

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
            raise ContractError(
                f"a DNG takes upright camera RGB; choose {option_text('color', 'camera')}"
            )
        origin = picture.origin
        gains = origin.white_balance
        # one channel comes as three planes of grey
        self._gains = gains * 3 if len(gains) == 1 else gains
        red, green, blue = self._gains
        tags = DngTags(
            cfa=None,
            black=BLACK,
            white=WHITE,
            color_matrix=origin.color_matrix,
            as_shot_neutral=(1 / red, 1 / green, 1 / blue),
            camera_model=origin.camera.encode("ascii", "replace").decode() or "camkit",
            metadata=origin.metadata,
            orientation=origin.orientation,
        )
        self._preview = Averages(picture.height, picture.width, least_step=LEAST_PREVIEW_STEP)
        self._file = open_linear_dng(path, (picture.height, picture.width), tags)

    def encode(self, band: FloatArray) -> Codes:
        """Return the band as (3, rows, w) uint16 DN of the raw signal."""
        scale = WHITE / np.array(self._gains)
        codes = band * scale.astype(np.float32)[:, None, None]
        return np.asarray(np.clip(np.rint(codes), 0, WHITE), dtype=np.uint16)

    def store(self, rows: Codes) -> None:
        """Append rows, interleaved."""
        self._file.append(rows.transpose(1, 2, 0))
        self._preview.add(rows)

    def finish(self) -> None:
        """Write preview and directories."""
        self._file.finish(self._preview.planes())

    def release(self) -> None:
        """Release the file as it is."""
        self._file.release()
