"""A folder of one pair of a camera of developed pictures: by a tone curve, in halves."""

import cv2
import numpy as np

from camkit.scenes import procedural_scene

GAMMA = 1.7
EXPOSURE = np.array([0.9, 0.8, 0.7])
FALL = 0.2
SHIFT_PX = 0.4
BLUR_PX = 1.5
SETTINGS = """
iso = 100
reference = "photographed"
tone = "maker.toml"
halves = ["_l", "_r"]
"""


def write_halves(path, light):
    """Write (3, h, w) light as two halves of 8-bit codes whose mean it is."""
    for half, factor in (("_l", 1.05), ("_r", 0.95)):
        codes = np.rint(255 * np.clip(factor * light, 0, 1) ** (1 / GAMMA)).astype(np.uint8)
        cv2.imwrite(f"{path}{half}.png", codes[::-1].transpose(1, 2, 0))


def write_developed_pair(home, sensor):
    """Photograph a scene sharp, and blurred, a little shifted, darker towards the corners."""
    height, width = sensor.height_px, sensor.width_px
    sharp = (0.6 * np.clip(procedural_scene(11, height, width), 0, 1)).astype(np.float32)
    sharp[:, 40:60, 300:330] = 2.0
    moved = np.array([[1, 0, SHIFT_PX], [0, 1, -SHIFT_PX]])
    blurred = [
        cv2.GaussianBlur(cv2.warpAffine(p, moved, (width, height)), (0, 0), BLUR_PX) for p in sharp
    ]
    y, x = np.mgrid[0:height, 0:width]
    centre = (np.array([width, height]) - 1) / 2
    square = ((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / (centre**2).sum()
    for name, light in (
        ("capture", np.stack(blurred) * EXPOSURE[:, None, None] * (1 - FALL * square)),
        ("reference", sharp),
    ):
        (home / name).mkdir()
        write_halves(home / name / "one", light)
    (home / "pairs.toml").write_text(SETTINGS, encoding="utf-8")
    levels = np.arange(0, 256, 5)
    text = f"levels = {levels.tolist()}\nluminance = {((levels / 255) ** GAMMA).tolist()}\n"
    (home / "maker.toml").write_text(text, encoding="utf-8")
