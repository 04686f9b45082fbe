"""Axes too many, channels, routers and frames are asked about; nothing is summed or folded."""

import struct
from pathlib import Path

import h5py
import numpy as np
import ptufile
import pytest
import scipy.io
import tifffile

from camkit.errors import ContractError, DecodeError, UnsupportedError
from camkit.runtime.kinds.spad.files.counts_file import Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts

RNG = np.random.default_rng(3)
CUBE = RNG.poisson(1, (12, 3, 5, 6)).astype(np.uint16)
"""(t, c, y, x)."""


def _rows(path: Path, **hints: str) -> np.ndarray:
    with open_counts(path, Hints(**hints)) as file:
        return np.asarray(file.rows(0, file.height))


@pytest.mark.parametrize("suffix", ["npz", "h5", "mat", "tif"])
def test_a_fourth_axis_is_asked_about_and_taken_where_it_is_named(
    suffix: str, tmp_path: Path
) -> None:
    path = tmp_path / f"a.{suffix}"
    if suffix == "npz":
        np.savez(path, histogram=CUBE)
    elif suffix == "h5":
        with h5py.File(path, "w") as file:
            file["histogram"] = CUBE
    elif suffix == "mat":
        scipy.io.savemat(path, {"histogram": CUBE})
    else:
        tifffile.imwrite(path, CUBE, photometric="minisblack")
    with pytest.raises(ContractError, match=r"expected time, rows and columns.*\[array\] axes"):
        open_counts(path, Hints())
    for place in range(3):
        found = _rows(path, axes=f"tc{place}yx")
        np.testing.assert_array_equal(found, CUBE[:, place].transpose(1, 2, 0))
    with pytest.raises(ContractError, match='"tc3yx" does not fit'):
        open_counts(path, Hints(axes="tc3yx"))


@pytest.mark.parametrize(
    ("axes", "shape", "key", "told"),
    [
        ("TCYX", (12, 3, 5, 6), "channel 1", "channel 0, channel 1, channel 2; choose one"),
        ("TZYX", (12, 3, 5, 6), "slice 1", "slice 0, slice 1, slice 2; choose one"),
        ("TZCYX", (12, 2, 3, 5, 6), "slice 1, channel 2", "slice 0, slice 1; channel 0"),
    ],
)
@pytest.mark.parametrize("kind", ["imagej", "ome"])
def test_named_axes_of_tiff_are_asked_about_by_name(
    kind: str, axes: str, shape: tuple[int, ...], key: str, told: str, tmp_path: Path
) -> None:
    cube = RNG.poisson(1, shape).astype(np.uint16)
    path = tmp_path / ("a.ome.tif" if kind == "ome" else "a.tif")
    tifffile.imwrite(path, cube, **{kind: True}, metadata={"axes": axes})
    with pytest.raises(ContractError, match=told):
        open_counts(path, Hints())
    places = [slice(None), *(int(part.split()[-1]) for part in key.split(","))]
    np.testing.assert_array_equal(_rows(path, key=key), cube[tuple(places)].transpose(1, 2, 0))


def test_slices_and_channels_without_time_are_no_time(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, CUBE, imagej=True, metadata={"axes": "ZCYX"})
    with pytest.raises(ContractError, match="nothing says which axis is time"):
        open_counts(path, Hints())
    np.testing.assert_array_equal(_rows(path, axes="tc2yx"), CUBE[:, 2].transpose(1, 2, 0))
    tifffile.imwrite(path, CUBE[0], imagej=True, metadata={"axes": "CYX"})
    with pytest.raises(ContractError, match="channel 0, channel 1, channel 2; choose one"):
        open_counts(path, Hints())


def test_routers_of_a_stream_are_asked_about(tmp_path: Path) -> None:
    records = [1 << 31]
    records += [(4095 - 10) << 16 | 2 << 12] * 30 + [(4095 - 20) << 16 | 5 << 12] * 40
    path = tmp_path / "a.spc"
    path.write_bytes(struct.pack(f"<{len(records)}I", *records))
    for key in (None, "channel 0"):
        with pytest.raises(ContractError, match="holds channel 2, channel 5"):
            open_counts(path, Hints(key=key))
    for key, at, photons in (("channel 2", 10, 30), ("channel 5", 20, 40)):
        with open_counts(path, Hints(key=key)) as file:
            found = file.rows(0, 1, np.arange(41) - 0.5)[0, 0]
        assert found[at] == found.sum() == photons


def test_frames_of_ptu_are_asked_about_and_summed_where_that_is_said(tmp_path: Path) -> None:
    frames = RNG.poisson(1, (2, 4, 5, 1, 16)).astype(np.uint16)
    path = tmp_path / "a.ptu"
    ptufile.imwrite(path, frames, 16 * 20e-12, 20e-12)
    with pytest.raises(ContractError, match="holds frame 0, frame 1, all frames; choose one"):
        open_counts(path, Hints())
    np.testing.assert_array_equal(_rows(path, key="frame 1"), frames[1, :, :, 0])
    np.testing.assert_array_equal(_rows(path, key="all frames"), frames.sum(axis=0)[:, :, 0])


@pytest.mark.parametrize("bins", [50, 256, 1000, 1600])
def test_ptu_keeps_its_empty_last_bins(bins: int, tmp_path: Path) -> None:
    """50 ns / 50 is a hair below 50 bins in floats."""
    cube = np.zeros((4, 5, bins), np.uint16)
    cube[..., 7] = 3
    path = tmp_path / "a.ptu"
    ptufile.imwrite(path, cube, 50e-9, 50e-9 / bins)
    np.testing.assert_array_equal(_rows(path), cube)


def test_links_are_refused_by_their_name(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["raw/three"] = CUBE[:, 0]
        file["histogram"] = h5py.SoftLink("/raw/three")
    with pytest.raises(DecodeError, match="histogram is a link to /raw/three"):
        open_counts(path, Hints())
    found = _rows(path, key="raw/three", axes="tyx")
    np.testing.assert_array_equal(found, CUBE[:, 0].transpose(1, 2, 0))


def test_a_filter_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        packed = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        packed.set_chunk((4, 5, 6))
        packed.set_filter(32001, h5py.h5z.FLAG_OPTIONAL)
        space = h5py.h5s.create_simple((12, 5, 6))
        h5py.h5d.create(file.id, b"histogram", h5py.h5t.NATIVE_UINT16, space, packed)
    with pytest.raises(UnsupportedError, match=r"filter 32001 .*not installed"):
        open_counts(path, Hints())
