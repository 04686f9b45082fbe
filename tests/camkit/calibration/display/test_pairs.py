"""A pair holds the same capture, whatever kind of file the camera wrote."""

import cv2
import numpy as np
import pytest

from camkit.calibration.display.camera_file import Lens, Tone
from camkit.calibration.display.pairs import Pair, Pairs, References, draw_pairs
from camkit.calibration.display.screen import Screen
from camkit.calibration.display.targets import Target, Targets
from camkit.calibration.geometry.board import Board
from camkit.runtime.output.dng import open_linear_dng
from tests.camkit.calibration.display.screen_factory import Booth
from tests.dng_factory import dng_tags

GAINS = (2.0, 1.0, 1.6)
SCREEN = (480, 320)
BOOTH = Booth(screen=SCREEN, size=(120, 80), noisy=False, blur_px=4.0, level=0.4)


def _planes(path, planes):
    """Write what the camera saw as a DNG that was demosaicked."""
    counts = np.rint(planes * 65535).astype(np.uint16)
    file = open_linear_dng(path, planes.shape[1:], dng_tags(cfa=None, black=0, white=65535))
    file.append(counts.transpose(1, 2, 0))
    file.finish(counts[:, ::4, ::4])
    return path


def _drawn(path, folder):
    """Give the capture (h, w, 3) of a pair, 1 at white."""
    target = Target(file="p.png", name="p", kind="picture", place_px=(0, 0, *SCREEN))
    lens = Lens(camera=BOOTH.camera, size=BOOTH.size, covered_px=100.0)
    shown = Targets(
        screen=Screen(width_px=SCREEN[0], height_px=SCREEN[1]),
        board=Board(columns=9, rows=6),
        targets=(target,),
    )
    given = References(folder=folder, targets=shown, lens=lens, tone=Tone.read(None))
    pair = Pair(
        path=path,
        target=target,
        to_picture=np.eye(3),
        residual_px=0.0,
        correlation=1.0,
        places_px=np.zeros((0, 2)),
        shifts_px=np.zeros((0, 2)),
        reference_px=(0, 0, 32, 32),
    )
    pairs = Pairs(
        pairs=(pair,), primaries=None, size=BOOTH.size, iso=100.0, white_balance=GAINS, notes=()
    )
    ((counts, _),) = draw_pairs(pairs, given)
    return counts / 65535


def test_a_demosaicked_capture_holds_the_gains_that_pairs_toml_states(tmp_path):
    rng = np.random.default_rng(3)
    codes = cv2.resize(rng.integers(40, 255, (8, 12, 3)).astype(np.uint8), SCREEN)
    assert cv2.imwrite(str(tmp_path / "p.png"), codes[..., ::-1])
    mosaic = _drawn(BOOTH.write(tmp_path / "mosaic.dng", codes), tmp_path)
    planes = _drawn(_planes(tmp_path / "planes.dng", BOOTH.planes(codes)), tmp_path)
    inside = np.s_[8:-8, 8:-8]
    assert planes[inside] == pytest.approx(mosaic[inside], abs=0.01)
    wanted = BOOTH.planes(codes).transpose(1, 2, 0) * GAINS
    assert planes == pytest.approx(np.clip(wanted, 0, 1), abs=1e-4)
