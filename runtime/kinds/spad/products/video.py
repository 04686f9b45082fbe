"""Films: frames of counts or of light in flight, MPEG-4 in MP4.

Newer codecs make files a seventh as large and take 27 times as long: a minute for 2048 frames.
"""

from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.errors import UnsupportedError
from camkit.runtime.kinds.spad.products.preview import enlarged, grey_picture

FRAMES_PER_S: Final = 25.0


def write_video(path: Path, frames: NDArray[np.floating], white: float) -> None:
    """Write a film.

    Args:
        path: The file.
        frames: (n, h, w) photons.
        white: How many are shown white.

    Raises:
        UnsupportedError: If this machine's OpenCV has no encoder for it.
    """
    # OpenCV knows containers by their suffix alone
    draft = path.with_name(f"{path.name}.mp4")
    height, width = enlarged(grey_picture(frames[0], white), even=True).shape[:2]
    code = cv2.VideoWriter.fourcc(*"mp4v")
    film = cv2.VideoWriter(str(draft), cv2.CAP_FFMPEG, code, FRAMES_PER_S, (width, height))
    try:
        if not film.isOpened():
            raise UnsupportedError("this build of OpenCV writes no MPEG-4")
        for frame in frames:
            film.write(enlarged(grey_picture(frame, white), even=True))
        film.release()
        draft.replace(path)
    finally:
        film.release()
        draft.unlink(missing_ok=True)
