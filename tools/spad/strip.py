"""Films side by side: some frames of each as one PNG, and all as one film."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.runtime.kinds.spad.products.video import write_video

GAP_PX: Final = 4
COLUMNS: Final = 2
INCH_PX: Final = 100.0


def write_strip(
    path: Path,
    films: Mapping[str, FloatArray],
    titles: Sequence[str],
    frames: Sequence[int],
    white: float,
) -> None:
    """Write chosen frames of films, one row for each.

    Args:
        path: PNG.
        films: Name -> (n, h, w) of any size.
        titles: Of the n frames.
        frames: Which to show.
        white: Shown white.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.4 * len(frames), 1.4 * len(films)), layout="constrained")
    axes = figure.subplots(len(films), len(frames), squeeze=False)
    for (name, film), row in zip(films.items(), axes, strict=True):
        for axis, frame in zip(row, frames, strict=True):
            # the screen's curve, as previews have it
            shown = np.clip(film[frame] / white, 0, 1) ** (1 / 2.2)
            axis.imshow(shown, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
            axis.set(xticks=[], yticks=[])
        row[0].set_ylabel(name, fontsize=8)
    for axis, frame in zip(axes[0], frames, strict=True):
        axis.set_title(titles[frame], fontsize=8)
    figure.savefig(path, dpi=INCH_PX)


def write_film(path: Path, films: Mapping[str, FloatArray], white: float) -> None:
    """Write films side by side as MP4; those of coarser pixels are shown as squares.

    Raises:
        UnsupportedError: If this machine's OpenCV has no encoder for it.
    """
    size = max(film.shape[1:] for film in films.values())
    gap = ((0, 0), (0, GAP_PX), (0, GAP_PX))
    large = [np.pad(_as_large(film, size), gap, constant_values=white) for film in films.values()]
    large += [np.zeros_like(large[0])] * (-len(large) % COLUMNS)
    rows = [
        np.concatenate(large[first : first + COLUMNS], axis=2)
        for first in range(0, len(large), COLUMNS)
    ]
    write_video(path, np.concatenate(rows, axis=1), white)


def _as_large(film: FloatArray, size: tuple[int, int]) -> NDArray[np.floating]:
    times = size[0] // film.shape[1]
    return film.repeat(times, axis=1).repeat(times, axis=2)
