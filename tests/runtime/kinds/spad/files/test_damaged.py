"""Damaged and hostile files are refused in one line, whatever is broken and wherever."""

import io
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import ptufile
import pytest
import scipy.io
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camkit.errors import CamkitError, ContractError, DecodeError
from camkit.runtime.kinds.spad.containers.stored_array import read_columns
from camkit.runtime.kinds.spad.files.bundle_name import named_bundle
from camkit.runtime.kinds.spad.files.counts_file import Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts
from camkit.runtime.kinds.spad.pulse import SampledPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.runtime.kinds.spad.timing import Timing
from tests.spad_files import AXES, STAMPS, WRITERS, small_cube

EVERY = {**WRITERS, **STAMPS}
EDGES = np.arange(41) - 0.5


def _read(path: Path) -> np.ndarray:
    hints = Hints(axes=AXES.get(path.suffix) if path.name not in STAMPS else None)
    with open_counts(path, hints) as file:
        return np.asarray(file.rows(0, file.height, EDGES))


class Files(dict[str, bytes]):
    """Content by name; it is not shown where a test fails."""

    def __repr__(self) -> str:
        return f"{len(self)} files"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Files:
    folder = tmp_path_factory.mktemp("whole")
    for name, write in EVERY.items():
        write(folder / name, small_cube())
    return Files({name: (folder / name).read_bytes() for name in EVERY})


@pytest.mark.parametrize("name", EVERY)
def test_files_that_are_cut_off_are_refused(name: str, whole: Files, tmp_path: Path) -> None:
    data, path = whole[name], tmp_path / name
    path.write_bytes(data)
    truth = _read(path)
    refused = 0
    lengths = sorted({0, 1, 7, 100, len(data) - 1, *np.linspace(8, len(data) - 2, 25).astype(int)})
    for length in lengths:
        path.write_bytes(data[:length])
        try:
            np.testing.assert_array_equal(_read(path), truth)  # what is cut off was padding
        except CamkitError as error:
            refused += 1
            assert "\n" not in str(error)  # noqa: PT017 - either it is whole or it is refused
    assert refused > len(lengths) / 2


@pytest.mark.parametrize("name", EVERY)
@settings(
    max_examples=30,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(changes=st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 255)), max_size=6))
def test_files_with_other_bytes_are_read_or_refused(
    name: str,
    changes: list[tuple[int, int]],
    whole: Files,
    tmp_path: Path,
) -> None:
    data = bytearray(whole[name])
    for place, value in changes:
        # most that matters stands at the beginning and at the end
        data[place % min(len(data), 3000) * (-1 if place % 2 else 1)] = value
    path = tmp_path / name
    path.write_bytes(data)
    try:
        found = _read(path)
    except CamkitError as error:
        assert "\n" not in str(error)  # noqa: PT017 - either it is read or it is refused
    else:
        assert np.isfinite(found).all()
        assert (found >= 0).all()


MUTANTS = """
import sys
from pathlib import Path
import numpy as np
from camkit.errors import CamkitError
from camkit.runtime.kinds.spad.files.counts_file import Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts

path, draw, read = Path(sys.argv[1]), np.random.default_rng(51), 0
whole = path.read_bytes()
for _ in range(int(sys.argv[2])):
    data = bytearray(whole)
    for place in draw.integers(128, len(data), draw.integers(1, 4)):
        data[place] = draw.choice([0, 255, draw.integers(256)])
    path.write_bytes(data)
    try:
        with open_counts(path, Hints()) as file:
            file.rows(0, file.height, np.arange(41) - 0.5)
        read += 1
    except CamkitError as error:
        assert "\\n" not in str(error)
print(read)
"""


def test_a_library_that_trusts_sizes_is_not_given_damaged_ones(tmp_path: Path) -> None:
    """The reader of MATLAB files believes types and sizes: its crash would end a whole batch."""
    path, mutants = tmp_path / "cells.mat", 1500
    stamps = np.empty((3, 4), object)
    for place in np.ndindex(stamps.shape):
        stamps[place] = np.arange(1.0, 2.0 + sum(place)).reshape(1, -1)
    scipy.io.savemat(path, {"photons": stamps})
    done = subprocess.run(
        [sys.executable, "-c", MUTANTS, str(path), str(mutants)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert mutants / 20 < int(done.stdout) < mutants


@pytest.mark.parametrize("tag", [b"ImgHdr_LineStart", b"ImgHdr_LineStop", b"ImgHdr_Frame"])
def test_a_marker_that_no_device_has_is_refused(tag: bytes, whole: Files, tmp_path: Path) -> None:
    data, path = bytearray(whole["scan.ptu"]), tmp_path / "scan.ptu"
    value = data.index(tag + b"\0") + 40
    data[value : value + 8] = (99).to_bytes(8, "little")
    path.write_bytes(data)
    with pytest.raises(DecodeError, match=rf"{tag.decode()} is the marker 99; there are 0 to 32"):
        _read(path)


@pytest.mark.parametrize("name", EVERY)
def test_another_kind_of_file_under_the_name_is_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    for data in (b"", b"\0" * 5000, b"P" * 5000, np.random.default_rng(0).bytes(5000)):
        path.write_bytes(data)
        with pytest.raises(DecodeError, match=name.replace(".", r"\.")):
            _read(path)
    path.unlink()
    with pytest.raises(DecodeError):
        _read(path)
    path.mkdir()
    with pytest.raises(DecodeError):
        _read(path)


class Trap:
    """An object that would write a file if it were unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return (Path.write_text, (self.path, "caught"))


def test_pickled_arrays_are_never_opened(tmp_path: Path) -> None:
    trap = tmp_path / "trap"
    array = np.array([[Trap(trap)]], dtype=object)
    np.savez(tmp_path / "a.npz", histogram=array)
    with pytest.raises(DecodeError, match="pickled objects, which are never read"):
        _read(tmp_path / "a.npz")
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as archive:
        archive.writestr("histogram.npy", pickle.dumps(Trap(trap)))
    with pytest.raises(DecodeError, match=r"histogram\.npy is no array"):
        _read(tmp_path / "b.npz")
    assert not trap.exists()


def _npy(shape: tuple[int, ...], dtype: str = "<u2") -> bytes:
    """Give the header of an array without its numbers."""
    file = io.BytesIO()
    facts = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, facts)
    return file.getvalue()


def test_archives_that_announce_more_than_they_hold_are_refused(tmp_path: Path) -> None:
    for number, shape in enumerate([(10**6, 10**6, 10**6), (9, 1000, 1000), (-1, 3, 3)]):
        path = tmp_path / f"{number}.npz"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("histogram.npy", _npy(shape) + bytes(1000))
        with pytest.raises(DecodeError):
            _read(path)


def test_bombs_are_refused_before_they_go_off(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    data = _npy((100_000, 100, 250))
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("histogram.npy", "w", force_zip64=True) as member,
    ):
        member.write(data)
        member.write(bytes(1000))
    raw = bytearray(path.read_bytes())
    # the directory announces 5 GB where 1 kB is packed
    at = raw.rindex(b"PK\x01\x02")
    raw[at + 24 : at + 28] = (4_100_000_000).to_bytes(4, "little")
    path.write_bytes(raw)
    with pytest.raises(DecodeError):
        _read(path)
    tifffile.imwrite(tmp_path / "bomb.tif", np.zeros((4, 4), np.uint16), photometric="minisblack")
    with tifffile.TiffFile(tmp_path / "bomb.tif") as file:
        places = [file.pages[0].tags[tag].valueoffset for tag in (256, 257)]
    tiff = bytearray((tmp_path / "bomb.tif").read_bytes())
    for place in places:  # 60,000 pixels a side
        tiff[place : place + 2] = (60_000).to_bytes(2, "little")
    (tmp_path / "bomb.tif").write_bytes(tiff)
    with pytest.raises(DecodeError):
        _read(tmp_path / "bomb.tif")


def test_a_zip_must_hold_one_sdt(tmp_path: Path) -> None:
    for names, told in (([], "none"), (["a.sdt", "b.sdt"], r"a\.sdt, b\.sdt")):
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.writestr("readme.txt", "no histogram")
            for name in names:
                archive.writestr(name, "x")
        with pytest.raises(DecodeError, match=rf"must hold one \.sdt file; it holds {told}"):
            open_counts(tmp_path / "a.zip", Hints())


@pytest.mark.parametrize(
    ("name", "shape", "told"),
    [
        ("histogram", (2**42, 4, 4), "has 4398046511104 time bins; expected at most 100000"),
        ("histogram", (100_000, 400, 400), "expected at most 10000000000 counts in all"),
        ("counts", (2**42, 4, 4), "holds 4398046511104 frames of 16 pixels; expected at most"),
    ],
)
def test_arrays_beyond_any_capture_are_refused(
    tmp_path: Path, name: str, shape: tuple[int, ...], told: str
) -> None:
    """A sparse data set announces in a few bytes what no memory holds."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset(name, shape, "u1", chunks=(64, 4, 4))
    with pytest.raises(DecodeError, match=told):
        open_counts(tmp_path / "a.h5", Hints())


def test_a_name_that_announces_more_than_it_holds_is_none(tmp_path: Path) -> None:
    """A batch asks every file for its bundle before any work, so none may stop it there."""
    sound, lying, torn = (tmp_path / f"{name}.npz" for name in ("sound", "lying", "torn"))
    np.savez(sound, counts=np.ones((9, 9)), bundle="spad-sr")
    assert named_bundle(sound) == "spad-sr"
    with zipfile.ZipFile(lying, "w") as archive:
        archive.writestr("bundle.npy", _npy((10**13,), "<U7"))
    np.savez_compressed(torn, bundle=np.array(["spad-sr"] * 1000))
    data = bytearray(torn.read_bytes())
    data[80:120] = b"\xff" * 40
    torn.write_bytes(data)
    with h5py.File(tmp_path / "none.h5", "w") as file:
        file.attrs["bundle"] = h5py.Empty("S1")
        file.create_dataset("counts", data=np.ones((9, 9))).attrs["bundle"] = np.bytes_("spad-sr")
    for name in (lying, torn):
        assert named_bundle(name) is None
    assert named_bundle(tmp_path / "none.h5") == "spad-sr"


def test_data_that_lie_in_other_files_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["cube"] = small_cube()
    layout = h5py.VirtualLayout(shape=small_cube().shape, dtype="u2")
    layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "cube", shape=small_cube().shape)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_virtual_dataset("histogram", layout)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("histogram", (2, 3, 4), "u1", external=[(str(tmp_path / "raw"), 0, 24)])
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file["histogram"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "cube")
    for name in ("a.h5", "b.h5"):
        with pytest.raises(DecodeError, match="histogram lies in other files"):
            open_counts(tmp_path / name, Hints())
    with pytest.raises(DecodeError, match="holds no data sets"):
        open_counts(tmp_path / "c.h5", Hints())


def test_refusals_state_what_came(tmp_path: Path) -> None:
    """Shapes, bins, widths and bytes stand in the line, not only what was expected."""
    np.savez(tmp_path / "line.npz", a=np.ones(9))
    np.savez(tmp_path / "two.npz", a=np.ones((4, 5)), b=np.ones((3, 4, 5)))
    np.savez(tmp_path / "no_time.npz", histogram=np.ones((0, 2, 3)))
    cells = np.empty((1, 2), object)
    cells[0, 0], cells[0, 1] = np.ones(3), np.array([1.0, np.nan])
    scipy.io.savemat(tmp_path / "cells.mat", {"timestamps": cells})
    with tifffile.TiffWriter(tmp_path / "sizes.tif") as file:
        for side in (4, 5):
            file.write(np.zeros((side, side), np.uint8), photometric="minisblack")
    stack = np.zeros((9, 40, 40), np.uint8)
    tifffile.imwrite(tmp_path / "cut.tif", stack, photometric="minisblack")
    whole = (tmp_path / "cut.tif").read_bytes()
    (tmp_path / "cut.tif").write_bytes(whole[: len(whole) // 2])
    for name, came in (
        ("line.npz", r"it holds a \(9,\)"),
        ("two.npz", r"shapes are \(4, 5\), \(3, 4, 5\)"),
        ("no_time.npz", "no time bins: 0 for 6 pixels"),
        ("cells.mat", "1 of the 2 of a pixel"),
        ("sizes.tif", r"\(4, 4\) and \(5, 5\)"),
        ("cut.tif", r"\d+ .* are announced, \d+ .*are there"),
    ):
        with pytest.raises((DecodeError, ContractError), match=came):
            open_counts(tmp_path / name, Hints()).rows(0, 1, np.arange(9.0))
    with pytest.raises(ContractError, match="got 3 ps after 7 ps"):
        TimeAxis(orientation="gate", edges_ps=np.array([*range(8), 3.0]))
    with pytest.raises(ContractError, match=r"times of shape \(2,\) and values of \(3,\)"):
        SampledPulse(times_ps=np.zeros(2), values=np.ones(3))
    with pytest.raises(ContractError, match=r"steps of -1 ps .* values of 1 to 2"):
        SampledPulse(times_ps=np.array([0.0, 2.0, 1.0]), values=np.array([1.0, 2.0, 1.0]))
    with pytest.raises(ContractError, match="has 70 time bins, and nothing says how"):
        Timing(folder=tmp_path).axis(orientation="gate", bins=70)
    (tmp_path / "irf.csv").write_text("1 2\n3\n", encoding="utf-8")
    with pytest.raises(ContractError, match="two numbers; got 1 in '3'"):
        read_columns(tmp_path / "irf.csv", "the pulse")


def test_arrays_that_are_no_cubes_are_refused(tmp_path: Path) -> None:
    for name, array, told in (
        ("text", np.array([["a", "b"]]), "expected numbers"),
        ("complex", np.ones((9, 2, 2), complex), "expected numbers"),
        ("none", np.ones((9, 0, 3)), "holds 3x0 pixels"),
        ("no_time", np.ones((0, 2, 3)), "has no time bins"),
        ("line", np.ones(9), "holds no arrays"),
    ):
        np.savez(tmp_path / f"{name}.npz", histogram=array)
        with pytest.raises(DecodeError, match=told):
            open_counts(tmp_path / f"{name}.npz", Hints())
    tifffile.imwrite(tmp_path / "rgb.tif", np.zeros((8, 8, 3), np.uint8), photometric="rgb")
    with pytest.raises(DecodeError, match="expected rows and columns of counts"):
        open_counts(tmp_path / "rgb.tif", Hints())
    with tifffile.TiffWriter(tmp_path / "sizes.tif") as file:
        for side in (4, 5):
            file.write(np.zeros((side, side), np.uint8), photometric="minisblack")
    with pytest.raises(DecodeError, match="pages of several sizes"):
        open_counts(tmp_path / "sizes.tif", Hints())
    scipy.io.savemat(tmp_path / "a.mat", {"words": "text", "one": 3.0, "facts": {"a": 1}})
    with pytest.raises(DecodeError):
        open_counts(tmp_path / "a.mat", Hints())


def test_cells_that_hold_no_stamps_are_refused(tmp_path: Path) -> None:
    for wrong in (np.array(["a"]), np.array([np.nan]), np.array([[np.array([1])]], dtype=object)):
        cells = np.empty((2, 2), dtype=object)
        for y, x in np.ndindex(2, 2):
            cells[y, x] = np.arange(3)
        cells[1, 1] = wrong
        scipy.io.savemat(tmp_path / "a.mat", {"photons": cells})
        with open_counts(tmp_path / "a.mat", Hints()) as file, pytest.raises(DecodeError):
            file.rows(0, 2, EDGES)


def test_channels_are_chosen(tmp_path: Path) -> None:
    cube = np.random.default_rng(0).poisson(1, (6, 5, 2, 16)).astype(np.uint16)
    ptufile.imwrite(tmp_path / "a.ptu", cube, 25e-9, 20e-12)
    with pytest.raises(ContractError, match=r"holds channel 0, channel 1; choose one"):
        open_counts(tmp_path / "a.ptu", Hints())
    with open_counts(tmp_path / "a.ptu", Hints(key="channel 1")) as file:
        np.testing.assert_array_equal(file.rows(0, 6)[..., :16], cube[:, :, 1])
