"""The pictures of the README and of the gallery: `make pictures`.

    python -m tools.pictures.gallery -o docs/images [CAMERA ...]

NAME.jpg        three crops at 100 %: as taken, restored, truth
NAME-small.jpg  two of them, smaller, for tables
front.png       decibels gained against seconds: the front of methods
                (`tools.methods`), else cameras of the measured bench
"""

from pathlib import Path
from typing import Final

import cv2
import numpy as np

from camkit.arrays import FloatArray
from tools.methods.front_chart import RECORD, write_front_chart
from tools.pictures.arguments import read_arguments
from tools.pictures.captions import write_captioned, write_pixels
from tools.pictures.views import VIEWS, View

SMALL_PX: Final = (96, 128)
"""(height, width) of one of two pictures in a table."""
GAP_PX: Final = 4
NOTE: Final = "Simulated capture at 100 %. PSNR against the truth."


def main() -> None:
    """Write the pictures."""
    out_dir, cameras = read_arguments(__doc__.splitlines()[0], VIEWS, "CAMERA")
    total = 0
    for number, name in enumerate(cameras):
        print(f"{name} ({number + 1} of {len(cameras)}) ...", flush=True)
        view = VIEWS[name](name)
        for path in (_write_view(out_dir, name, view), _write_small(out_dir, name, view)):
            total += (size := path.stat().st_size)
            print(f"  {path}: {size / 1000:.0f} kB")
    front = out_dir / "front.png"
    write_front_chart(front, RECORD)
    total += (size := front.stat().st_size)
    print(f"{front}: {size / 1000:.0f} kB\n{total / 1000:.0f} kB in all")


def _write_view(out_dir: Path, name: str, view: View) -> Path:
    path = out_dir / f"{name}.jpg"
    write_captioned(path, f"{view.title}. {NOTE}", view.rows)
    return path


def _write_small(out_dir: Path, name: str, view: View) -> Path:
    """Write what was taken beside what was restored."""
    path = out_dir / f"{name}-small.jpg"
    row, *_ = view.rows.values()
    captured, restored, _ = map(_small, row.values())
    gap = np.ones((3, captured.shape[1], GAP_PX), np.float32)
    page = np.clip(np.concatenate([captured, gap, restored], axis=2), 0, 1)
    pixels = (page * 255 + 0.5).astype(np.uint8).transpose(1, 2, 0)[..., ::-1]
    write_pixels(path, pixels)
    return path


def _small(picture: FloatArray) -> FloatArray:
    """Return the largest middle of (3, h, w) in the shape of `SMALL_PX`, shrunk to it."""
    _, height, width = picture.shape
    share = min(height / SMALL_PX[0], width / SMALL_PX[1])
    tall, wide = (int(side * share) for side in SMALL_PX)
    top, left = (height - tall) // 2, (width - wide) // 2
    part = picture[:, top : top + tall, left : left + wide].transpose(1, 2, 0)
    shrunk = cv2.resize(np.ascontiguousarray(part), SMALL_PX[::-1], interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(shrunk.transpose(2, 0, 1))


if __name__ == "__main__":
    main()
