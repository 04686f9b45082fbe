"""Frames that lie at different places of a picture are merged where they show the same."""

import numpy as np
import OpenEXR
import pytest

from camkit.errors import DecodeError
from camkit.runtime.merging.result import merge_to_exr
from camkit.runtime.merging.survey import survey
from tests.data_folder import data_path

SCENE = np.random.default_rng(2).uniform(0.01, 0.1, (3, 60, 80)).astype(np.float32)
DISPLAY = (0, 0, 79, 59)


def write(path, box, time_s, *, display=DISPLAY, **more):
    x0, y0, x1, y1 = box
    windows = {
        name: (np.array(b[:2], np.int32), np.array(b[2:], np.int32))
        for name, b in (("dataWindow", box), ("displayWindow", display))
    }
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    planes = SCENE[:, y0 : y1 + 1, x0 : x1 + 1] * np.float32(time_s)
    channels = dict(zip("RGB", np.ascontiguousarray(planes), strict=True))
    OpenEXR.File(header | windows | {"expTime": float(time_s)} | more, channels).write(str(path))
    return path


def merged(tmp_path, files):
    report = merge_to_exr(survey(files, None), tmp_path / "out.exr", response=None, reference=None)
    with OpenEXR.File(str(tmp_path / "out.exr"), separate_channels=True) as file:
        header = dict(file.header())
        planes = np.stack([np.array(file.channels()[name].pixels) for name in "RGB"])
    boxes = [
        tuple(int(n) for corner in header[name] for n in corner)
        for name in ("dataWindow", "displayWindow")
    ]
    return report, planes, *boxes


@pytest.mark.parametrize(
    ("boxes", "common"),
    [
        ([(20, 10, 69, 49), (5, 30, 54, 55)], (20, 30, 54, 49)),
        ([(0, 0, 79, 59), (10, 20, 39, 49)], (10, 20, 39, 49)),
        ([(10, 20, 39, 49), (0, 0, 79, 59), (12, 0, 79, 40)], (12, 20, 39, 40)),
        ([(4, 4, 70, 50), (4, 4, 70, 50)], (4, 4, 70, 50)),
    ],
)
def test_frames_are_registered_by_their_data_windows(tmp_path, boxes, common):
    files = [write(tmp_path / f"{n}.exr", box, 2.0**n) for n, box in enumerate(boxes)]
    report, planes, data, display = merged(tmp_path, files)
    assert (data, display) == (common, DISPLAY)
    x0, y0, x1, y1 = common
    truth = SCENE[:, y0 : y1 + 1, x0 : x1 + 1] * report.times_s[len(files) // 2]
    assert np.abs(planes / truth - 1).max() < 1e-4
    told = any("aligned by their data windows" in note for note in report.notes)
    assert told == (len(set(boxes)) > 1)


def test_windows_of_crops_with_displays_of_their_own_are_registered_too(tmp_path):
    boxes = [(20, 10, 69, 49), (5, 30, 54, 55)]
    files = [write(tmp_path / f"{n}.exr", b, 2.0**n, display=b) for n, b in enumerate(boxes)]
    _, planes, data, display = merged(tmp_path, files)
    assert data == display == (20, 30, 54, 49)
    assert np.abs(planes / SCENE[:, 30:50, 20:55] / 1 - 1).max() < 1e-4


def test_frames_that_share_nothing_or_differ_in_pixels_are_refused(tmp_path):
    one = write(tmp_path / "a.exr", (0, 0, 19, 19), 1)
    with pytest.raises(DecodeError, match="share no pixel"):
        survey([one, write(tmp_path / "b.exr", (40, 0, 59, 19), 2)], None)
    with pytest.raises(DecodeError, match="shape of pixels"):
        survey([one, write(tmp_path / "c.exr", (0, 0, 19, 19), 2, pixelAspectRatio=2.0)], None)


def test_the_frames_of_reports_show_one_scene(tmp_path):
    files = [data_path(f"reports/exr_window_{name}.exr") for name in "ab"]
    report, planes, data, display = merged(tmp_path, files)
    assert (data, display) == ((20, 30, 284, 209), (0, 0, 319, 239))
    with OpenEXR.File(str(files[0]), separate_channels=True) as file:
        short = np.stack([np.array(file.channels()[name].pixels) for name in "RGB"])
    part = short[:, 20:, :][:, : planes.shape[1], : planes.shape[2]]
    assert np.abs(planes - part).max() < 0.01 * part.max()
    assert report.reference == "exr_window_a.exr"
