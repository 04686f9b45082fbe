"""Every type of file gives the counts that were written, by strips as whole."""

import builtins
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
import tifffile

from camkit.errors import ContractError, DecodeError, UnsupportedError
from camkit.runtime.kinds.spad.files import stamps
from camkit.runtime.kinds.spad.files.counts_file import CountsFile, Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts
from camkit.runtime.kinds.spad.files.spc import checked_records, micro_times, photons_of_routing
from tests.data_folder import data_path
from tests.spad_files import (
    AXES,
    BINS,
    HEIGHT,
    STAMPS,
    WIDTH,
    WRITERS,
    small_cube,
    write_h5,
    write_mat73,
    write_npz,
    write_packed_npz,
)


def _hints(name: str, **more: Any) -> Hints:
    return Hints(axes=AXES.get(Path(name).suffix), **more)


def _whole(file: CountsFile, edges: np.ndarray | None = None) -> np.ndarray:
    with file:
        return file.rows(0, file.height, edges)


@pytest.mark.parametrize("name", WRITERS)
def test_what_was_written_is_read_by_strips_as_whole(name: str, tmp_path: Path) -> None:
    cube = small_cube()
    WRITERS[name](tmp_path / name, cube)
    with open_counts(tmp_path / name, _hints(name)) as file:
        assert (file.kind, file.height, file.width, file.bins) == ("histogram", HEIGHT, WIDTH, BINS)
        whole = file.rows(0, HEIGHT)
        strips = [file.rows(top, min(top + 4, HEIGHT)) for top in range(0, HEIGHT, 4)]
    assert whole.dtype == np.float32
    assert whole.flags.c_contiguous
    assert whole.flags.writeable
    np.testing.assert_array_equal(whole, cube.transpose(1, 2, 0))
    np.testing.assert_array_equal(np.concatenate(strips), whole)


@pytest.mark.parametrize("name", STAMPS)
def test_time_stamps_are_sorted_into_bins(name: str, tmp_path: Path) -> None:
    cube = small_cube()
    cube[:, 2, 3] = 0  # an empty cell
    cube[:, 4, 5] = 0
    cube[7, 4, 5] = 1  # one photon alone
    STAMPS[name](tmp_path / name, cube)
    edges = np.arange(31) + 4.5
    with open_counts(tmp_path / name, Hints()) as file:
        assert (file.kind, file.height, file.width) == ("stamps", HEIGHT, WIDTH)
        found = file.rows(0, HEIGHT, edges)
        assert file.outside == cube.sum() - cube[5:35].sum()
        np.testing.assert_array_equal(file.rows(3, 5, edges), found[3:5])
    np.testing.assert_array_equal(found, cube[5:35].transpose(1, 2, 0))


def test_many_stamps_are_sorted_piece_by_piece(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    STAMPS["cells5.mat"](tmp_path / "a.mat", small_cube())
    edges = np.arange(31) + 4.5
    with open_counts(tmp_path / "a.mat", Hints()) as file:
        whole, outside = file.rows(0, HEIGHT, edges), file.outside
    monkeypatch.setattr(stamps, "AT_ONCE", 37)
    with open_counts(tmp_path / "a.mat", Hints()) as file:
        np.testing.assert_array_equal(file.rows(0, HEIGHT, edges), whole)
        assert file.outside == outside


def test_a_long_stream_takes_little_more_memory_than_its_file(tmp_path: Path) -> None:
    import tracemalloc

    path = tmp_path / "long.spc"
    records = np.random.default_rng(0).integers(0, 2**28, 4_000_000) & ~0xF000  # of one detector
    path.write_bytes(_spc(*records))
    tracemalloc.start()
    with open_counts(path, Hints()) as file:
        assert file.rows(0, 1, np.arange(4097) - 0.5).sum() == 4_000_000
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * path.stat().st_size


@pytest.mark.parametrize("axes", ["tyx", "txy", "ytx", "yxt", "xty", "xyt"])
def test_axes_are_in_the_order_that_is_stated(axes: str, tmp_path: Path) -> None:
    cube = small_cube()
    turned = cube.transpose(["tyx".index(axis) for axis in axes])
    np.savez(tmp_path / "a.npz", histogram=turned)
    with h5py.File(tmp_path / "a.h5", "w") as made:
        made["anything"] = turned
    scipy.io.savemat(tmp_path / "a.mat", {"anything": turned})
    for suffix in ("npz", "h5", "mat"):
        with open_counts(tmp_path / f"a.{suffix}", Hints(axes=axes)) as file:
            assert (file.height, file.width, file.bins) == (HEIGHT, WIDTH, BINS)
            np.testing.assert_array_equal(file.rows(2, 6), cube.transpose(1, 2, 0)[2:6])


def test_axes_that_are_unknown_are_asked_for(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as made:
        made["anything"] = small_cube()
    scipy.io.savemat(tmp_path / "a.mat", {"anything": small_cube()})
    for name in ("a.h5", "a.mat"):
        with pytest.raises(ContractError, match=r"which axis is time; state \[array\] axes"):
            open_counts(tmp_path / name, Hints())
        for axes in ("yx", "tyz", "ttyx", "txyt", ""):
            with pytest.raises(ContractError, match=r"does not fit a\.\w+, an array of"):
                open_counts(tmp_path / name, Hints(axes=axes))


def test_counts_are_one_picture_or_frames(tmp_path: Path) -> None:
    frames = small_cube()[:5]
    np.savez(tmp_path / "one.npz", counts=frames[0])
    np.savez(tmp_path / "many.npz", counts=frames)
    np.savez(tmp_path / "flat.npz", anything=frames[0])
    tifffile.imwrite(tmp_path / "one.tif", frames[0])
    for name, bins in (("one.npz", 1), ("many.npz", 5), ("flat.npz", 1), ("one.tif", 1)):
        with open_counts(tmp_path / name, Hints()) as file:
            assert (file.kind, file.bins) == ("counts", bins)
            expected = frames[:bins].transpose(1, 2, 0)
            np.testing.assert_array_equal(file.rows(0, HEIGHT), expected)


def test_what_a_file_states_of_its_times_is_taken(tmp_path: Path) -> None:
    np.savez(
        tmp_path / "a.npz",
        histogram=small_cube(),
        time_bin_ps=20.0,
        orientation="gate",
        cycles=np.int64(78000),
        bin_edges_ps=np.arange(41.0),
        remark="nothing",
    )
    with open_counts(tmp_path / "a.npz", Hints()) as file:
        edges = file.stated_times["bin_edges_ps"]
        rest = {name: value for name, value in file.stated_times.items() if name != "bin_edges_ps"}
    assert rest == {"time_bin_ps": 20.0, "orientation": "gate", "cycles": 78000}
    np.testing.assert_array_equal(edges, np.arange(41.0))
    write_h5(tmp_path / "a.h5", small_cube())
    with h5py.File(tmp_path / "a.h5", "r+") as made:
        made.attrs["orientation"] = "histogram"
        made["first_ps"] = 12.5
    with open_counts(tmp_path / "a.h5", Hints()) as file:
        assert file.stated_times == {
            "time_bin_ps": 20.0,
            "orientation": "histogram",
            "first_ps": 12.5,
        }
    scipy.io.savemat(tmp_path / "a.mat", {"histogram": small_cube(), "time_bin_ps": 4.0})
    with open_counts(tmp_path / "a.mat", Hints()) as file:
        assert file.stated_times == {"time_bin_ps": 4.0}
    for name in ("scan.ptu", "scan.sdt"):
        WRITERS[name](tmp_path / name, small_cube())
        with open_counts(tmp_path / name, Hints()) as file:
            assert file.stated_times["time_bin_ps"] == pytest.approx(20.0, rel=1e-6)
            assert "orientation" not in file.stated_times
            assert file.assumed == {"orientation": "histogram"}


def test_null_data_sets_beside_a_cube_are_left_out(tmp_path: Path) -> None:
    write_h5(tmp_path / "a.h5", small_cube())
    with h5py.File(tmp_path / "a.h5", "r+") as made:
        made["remark"] = h5py.Empty("S1")
        made["first_ps"] = h5py.Empty("f8")
        made.attrs["cycles"] = h5py.Empty("f8")
    with open_counts(tmp_path / "a.h5", Hints()) as file:
        assert file.stated_times == {"time_bin_ps": 20.0}
        np.testing.assert_array_equal(file.rows(0, HEIGHT), small_cube().transpose(1, 2, 0))


def test_among_several_variables_one_is_chosen(tmp_path: Path) -> None:
    cubes = {"first": small_cube(1), "second": small_cube(2)}
    np.savez(tmp_path / "a.npz", **cubes)
    scipy.io.savemat(tmp_path / "a.mat", cubes)
    with h5py.File(tmp_path / "a.h5", "w") as made:
        for name, cube in cubes.items():
            made[name] = cube
    for name in ("a.npz", "a.mat", "a.h5"):
        with pytest.raises(ContractError, match=r"first, second; choose one by \[array\] key"):
            open_counts(tmp_path / name, Hints(axes="tyx"))
        with pytest.raises(ContractError, match=r"no 'third'.*it holds first, second"):
            open_counts(tmp_path / name, Hints(axes="tyx", key="third"))
        found = _whole(open_counts(tmp_path / name, Hints(axes="tyx", key="second")))
        np.testing.assert_array_equal(found, cubes["second"].transpose(1, 2, 0))
    np.savez(tmp_path / "b.npz", histogram=cubes["first"], other=cubes["second"])
    np.testing.assert_array_equal(
        _whole(open_counts(tmp_path / "b.npz", Hints())), cubes["first"].transpose(1, 2, 0)
    )
    np.savez(tmp_path / "c.npz", histogram=cubes["first"], counts=cubes["second"][0])
    with pytest.raises(ContractError, match="counts, histogram; choose one"):
        open_counts(tmp_path / "c.npz", Hints())


@pytest.mark.parametrize(
    ("value", "told"), [(-1.0, "-1.0"), (0.5, "0.5"), (np.nan, "nan"), (np.inf, "inf"), (2e9, "2")]
)
def test_what_is_no_count_is_refused_by_its_place(value: float, told: str, tmp_path: Path) -> None:
    cube = small_cube().astype(np.float64)
    cube[17, 6, 3] = value
    np.savez(tmp_path / "a.npz", histogram=cube)
    with open_counts(tmp_path / "a.npz", Hints()) as file:
        file.rows(0, 6)
        with pytest.raises(
            DecodeError, match=rf"no counts: {told}.* at pixel \(3, 6\), bin 17; expected whole"
        ):
            file.rows(4, HEIGHT)


def test_negative_whole_numbers_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", histogram=np.full((9, 2, 2), -3, np.int16))
    with open_counts(tmp_path / "a.npz", Hints()) as file, pytest.raises(DecodeError, match="-3"):
        file.rows(0, 2)


def test_a_cube_beyond_memory_is_not_held(tmp_path: Path) -> None:
    import tracemalloc

    cube = np.zeros((1000, 100, 100), np.uint16)
    cube[20, 50, 50] = 7
    for write in (write_npz, write_packed_npz):
        write(tmp_path / "a.npz", cube)
        tracemalloc.start()
        with open_counts(tmp_path / "a.npz", Hints(max_bytes=100_000)) as file:
            assert file.rows(48, 52)[2, 50, 20] == 7
            assert file.rows(0, 4).sum() == 0
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < cube.nbytes / 3
    scipy.io.savemat(tmp_path / "a.mat", {"cube": cube}, do_compression=True)
    with pytest.raises(ContractError, match=r"can only be read whole; save it with -v7.3"):
        open_counts(tmp_path / "a.mat", Hints(axes="tyx", max_bytes=100_000))


def test_more_photons_than_fit_into_memory_are_refused(tmp_path: Path) -> None:
    WRITERS["scan.ptu"](tmp_path / "a.ptu", 30 * small_cube())
    with pytest.raises(ContractError, match=r"a.ptu, \d{5} photons and markers.*\.h5 or \.npz"):
        open_counts(tmp_path / "a.ptu", Hints(max_bytes=100_000))
    with open_counts(tmp_path / "a.ptu", Hints(max_bytes=400_000)) as file:
        assert file.rows(0, HEIGHT).sum() == 30 * small_cube().sum()


def test_fortran_order_and_big_endian_are_read(tmp_path: Path) -> None:
    cube = np.asfortranarray(small_cube().astype(">i4"))
    write_npz(tmp_path / "a.npz", cube)
    found = _whole(open_counts(tmp_path / "a.npz", Hints()))
    np.testing.assert_array_equal(found, cube.transpose(1, 2, 0))


@pytest.mark.parametrize(
    ("name", "library"),
    [("a.h5", "h5py"), ("a.ptu", "ptufile"), ("a.sdt", "sdtfile"), ("v73.mat", "h5py")],
)
def test_a_library_that_is_missing_is_named(
    name: str, library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_mat73(tmp_path / name, small_cube())
    real = builtins.__import__

    def without(wanted: str, *rest: Any, **more: Any) -> Any:
        if wanted == library:
            raise ImportError(wanted)
        return real(wanted, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(UnsupportedError, match=rf"needs {library}: pip install \"camkit\[spad\]\""):
        open_counts(tmp_path / name, Hints(axes="yxt"))


def test_other_types_are_named(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedError, match=r"type \.wav are not read; read are \.npz"):
        open_counts(tmp_path / "a.wav", Hints())


def _spc(*records: int) -> bytes:
    return np.array([0x8000005F, *records], dtype="<u4").tobytes()


def test_a_stream_is_decoded_record_by_record() -> None:
    photon = 0x04D70C16  # ADC 0x4d7, routing 0, macro 0xc16
    stream = _spc(
        photon,
        0xC000000A,  # ten overflows, no photon
        photon | 2 << 12,
        photon | 1 << 30,  # a photon with one overflow
        photon | 1 << 28,  # a marker
        photon | 1 << 31,  # no photon
        photon | 1 << 29,  # a photon after a gap
    )
    records = checked_records(np.frombuffer(stream, np.uint8))
    assert photons_of_routing(records)[:3].tolist() == [3, 0, 1]
    for routing, photons in ((0, 3), (2, 1)):
        assert np.concatenate([*micro_times(records, routing)]).tolist() == [4095 - 0x4D7] * photons


def test_a_stream_that_is_none_is_refused(tmp_path: Path) -> None:
    for data in (b"abc", _spc(1)[:-1], np.zeros(4, "<u4").tobytes()):
        (tmp_path / "a.spc").write_bytes(data)
        with pytest.raises(DecodeError, match=r"a\.spc is damaged, or no SPC"):
            open_counts(tmp_path / "a.spc", Hints())


def test_the_step_of_a_stream_stands_beside_it(tmp_path: Path) -> None:
    (tmp_path / "a.spc").write_bytes(_spc(0x04D70C16))
    for text, stated in (
        (b"#SP [SP_TAC_TC,F,2.443e-12]\r\n\xff", 2.443),
        (b"#SP [SP_TAC_TC,F,.e-]", None),
        (b"", None),
    ):
        (tmp_path / "a.set").write_bytes(text)
        with open_counts(tmp_path / "a.spc", Hints()) as file:
            assert file.stated_times.get("stamp_ps") == (stated and pytest.approx(stated))
            assert file.rows(0, 1, np.array([2855.5, 2856.5])).tolist() == [[[1.0]]]


def test_real_files_hold_what_is_known_of_them() -> None:
    folder = data_path("spad")
    edges = {"tower_9.8km.mat": np.array([0, 1e9]), "two_layer.mat": np.array([3000.0, 7001])}
    known = {
        "lct_s_u.mat": (64, 64, 53_190_216),
        "tower_9.8km.mat": (160, 160, 94_534),
        "two_layer.mat": (100, 100, 507_713),
        "bh_flim_128x128x256.sdt.zip": (128, 128, 224_606_420),
    }
    for name, (height, width, photons) in known.items():
        axes = "yxt" if name.startswith("lct") else None
        with open_counts(folder / name, Hints(axes=axes)) as file:
            found = file.rows(0, file.height, edges.get(name))
        assert found.shape[:2] == (height, width)
        assert found.sum(dtype=np.float64) == photons
    listed = np.loadtxt(folder / "bh_test_noise.asc", dtype=np.int64)
    records = checked_records(np.fromfile(folder / "bh_test_noise.spc", np.uint8))
    (routing,) = np.flatnonzero(photons_of_routing(records)).tolist()
    micro = np.concatenate([*micro_times(records, routing)])
    np.testing.assert_array_equal(micro, listed[:, 1])
