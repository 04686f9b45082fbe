"""Confocal captures of light that went around a corner: transient video, never depth.

The wall is bin 0 and is blanked; what comes later is light of the hidden scene. A film of it shows
wave fronts. That it holds the scene is shown by putting it through a light-cone transform here,
which camkit does not do.

References: O'Toole, Lindell, Wetzstein, "Confocal non-line-of-sight imaging based on the light-cone
transform", Nature 555 (2018): with v = z^2 and t^2 the capture is a convolution.
"""

from pathlib import Path
from typing import Final

import cv2
import numpy as np
import scipy.io
from numpy.typing import NDArray

import camkit
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from tools.spad.real.claim import Claim
from tools.spad.real.face import timing_file
from tools.spad.real.panels import Panel, write_panels

FILES: Final = ("lct_s_u.mat", "lct_resolution_chart_40cm.mat", "lct_outdoor_s.mat")
BIN_PS: Final = 4.0
WALL_BINS: Final = 600
DEEP: Final = 256
"""Planes of the transform."""
NOISE: Final = 0.3
"""Of the mean power of its kernel: what the transform takes for noise."""
TIMING: Final = """
[timing]
orientation = "histogram"
time_bin_ps = 4
[array]
axes = "yxt"
key = "rect_data"
"""


def measure(folder: Path, out: Path) -> list[Claim]:
    """Make transient video of every capture, and a picture of what it holds."""
    claims, panels = [], []
    for name in FILES:
        with timing_file(TIMING) as timing:
            pipeline = camkit.load(None, kind="spad", timing=str(timing), product="transient")
            made = pipeline.make(folder / name)
            film = out / f"{Path(name).stem}.mp4"
            made.writers[".mp4"](film)
        frames = np.asarray(made.arrays["transient"])
        stored = scipy.io.loadmat(folder / name)
        same = np.array_equal(frames, stored["rect_data"].transpose(2, 0, 1))
        width_m = float(stored["width"].item())
        late = frames.copy()
        late[:WALL_BINS] = 0
        at = int(late.sum(axis=(1, 2)).argmax())
        hidden = light_cone(late, width_m).max(axis=0)
        panels += [
            Panel(title=f"{name[:-4]}: all photons", values=frames.sum(axis=0), colors="gray"),
            Panel(
                title=f"in flight, {at * BIN_PS:.0f} ps",
                values=late[at - 8 : at + 8].sum(axis=0),
                colors="gray",
            ),
            Panel(title="light-cone transform, brightest", values=hidden, colors="gray"),
        ]
        claims += [
            Claim(capture=name, what="counts equal those of the file", value=float(same), least=1),
            Claim(capture=name, what="frames of the film", value=_frame_count(film)),
            Claim(capture=name, what="photons", value=float(frames.sum(dtype=np.float64))),
        ]
    write_panels(out / "confocal.png", panels, columns=3)
    return claims


def light_cone(frames: NDArray[np.floating], half_width_m: float) -> NDArray[np.float64]:
    """Return the hidden scene (depth, h, w) behind a confocal capture (t, h, w)."""
    bins = DEEP
    merged = frames.reshape(bins, -1, *frames.shape[1:]).sum(axis=1).astype(np.float64)
    range_m = len(frames) * BIN_PS * LIGHT_M_PER_PS
    t = (np.arange(bins) + 0.5) / bins
    merged *= (t**4)[:, None, None]  # what is farther is fainter
    # from times to their squares and back
    squared = np.stack([np.interp(t, t**2, line) for line in merged.reshape(bins, -1).T])
    cube = squared.T.reshape(merged.shape)
    slope = half_width_m / (range_m / 2)
    v, y, x = np.meshgrid(
        np.linspace(0, 2, 2 * bins),
        *(np.linspace(-2, 2, 2 * n) * slope for n in frames.shape[1:]),
        indexing="ij",
    )
    cone = np.abs(x**2 + y**2 - v)
    kernel = (cone == cone.min(axis=0, keepdims=True)).astype(np.float64)
    kernel /= np.linalg.norm(kernel)
    kernel = np.roll(kernel, [-n for n in frames.shape[1:]], axis=(1, 2))
    spectrum = np.fft.rfftn(kernel)
    padded = np.fft.rfftn(cube, s=kernel.shape, axes=(0, 1, 2))
    power = np.abs(spectrum) ** 2
    wiener = np.conj(spectrum) / (power + NOISE * power.mean())
    found = np.fft.irfftn(padded * wiener, s=kernel.shape, axes=(0, 1, 2))
    return np.asarray(found[tuple(slice(n) for n in cube.shape)])


def _frame_count(film: Path) -> int:
    reader = cv2.VideoCapture(str(film))
    try:
        return int(reader.get(cv2.CAP_PROP_FRAME_COUNT))
    finally:
        reader.release()
