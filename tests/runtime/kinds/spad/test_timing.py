"""A timing file says what it means, or is refused by the name of what is wrong in it."""

from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse, SampledPulse
from camkit.runtime.kinds.spad.timing import Timing, read_timing

WHOLE = """
[timing]
orientation = "gate"
time_bin_ps = 20
first_ps = -40.5
bins = 125
cycles = 78000000
[gate]
width_ps = 200
rc_ps = 60
jitter_ps = 30
[laser]
fwhm_ps = 70.644
wavelength_nm = 655
[array]
axes = "yxt"
key = "cube"
pitch_um = 150
focal_length_mm = 50
stamp_ps = 8
[correction]
offset_ps = 120
dark = 0.25
"""


def _read(folder: Path, text: str) -> Timing:
    path = folder / "t.toml"
    path.write_text(text, encoding="utf-8")
    return read_timing(path)


def test_a_whole_file_says_what_it_means(tmp_path: Path) -> None:
    timing = _read(tmp_path, WHOLE)
    axis = timing.axis(bins=125)
    assert axis.orientation == "gate"
    assert axis.centres_ps[[0, 1, -1]].tolist() == [-40.5, -20.5, -40.5 + 124 * 20]
    pulse = timing.pulse()
    assert isinstance(pulse, GatedPulse)
    assert (pulse.width_ps, pulse.rc_ps) == (200, 60)
    # jitter is a standard deviation, the laser's width a full one at half maximum
    assert pulse.sigma_ps == pytest.approx(np.hypot(30, 70.644 / 2.3548))
    assert timing.dark((2, 3)).tolist() == [[0.25] * 3] * 2
    assert not timing.hot((2, 3)).any()
    assert timing.files == []


def test_a_full_width_is_twice_where_a_gaussian_is_half() -> None:
    pulse = Timing().with_stated({"fwhm_ps": 100.0}).pulse()
    assert isinstance(pulse, GaussianPulse)
    at = pulse.density(np.array([0.0, 50.0]))
    assert at[1] / at[0] == pytest.approx(0.5, abs=1e-4)


def test_without_a_pulse_none_is_made_up() -> None:
    assert Timing().pulse() is None
    with pytest.raises(ContractError, match="state its width_ps too"):
        Timing().with_stated({"rc_ps": 60.0}).pulse()


def test_a_measured_pulse_is_read(tmp_path: Path) -> None:
    (tmp_path / "irf.csv").write_text("# ps, counts\n-10, 0\n0, 4\n\n30,0\n", encoding="utf-8")
    timing = _read(tmp_path, '[irf]\nfile = "irf.csv"\n')
    pulse = timing.pulse()
    assert isinstance(pulse, SampledPulse)
    assert pulse.times_ps.tolist() == [-10, 0, 30]
    assert timing.files == [tmp_path / "irf.csv"]
    both = _read(tmp_path, '[irf]\nfile = "irf.csv"\n[laser]\nfwhm_ps = 50\n')
    with pytest.raises(ContractError, match="stands for gate and laser together"):
        both.pulse()


@pytest.mark.parametrize("text", ["1 2\n3\n", "1 2 3\n4 5 6\n", "a b\n", "", "\xff\xfe"])
def test_a_pulse_that_is_not_two_columns_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "irf.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(ContractError, match=r"irf.csv must be lines of two numbers"):
        _read(tmp_path, '[irf]\nfile = "irf.csv"\n').pulse()


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match=r"cannot read timing .*no.toml: No such file"):
        read_timing(tmp_path / "no.toml")
    with pytest.raises(ContractError, match=r"cannot read the measured pulse .*no.csv: No such"):
        _read(tmp_path, '[irf]\nfile = "no.csv"\n').pulse()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[timing", "is not valid TOML"),
        ("[tim]\na = 1", r"\[tim\]: is unknown; known are timing, gate, laser, irf"),
        ("folder = 'x'", r"\[folder\]: is unknown"),
        ("timing = 3", r"\[timing\]: input should be a valid dictionary"),
        ("[timing]\nbin_ps = 3", r"\[timing\] bin_ps: is unknown; known are orientation, time_bin"),
        ("[timing]\ntime_bin_ps = 0", r"\[timing\] time_bin_ps: input should be greater than 0"),
        ("[timing]\ntime_bin_ps = nan", "finite number"),
        ("[timing]\ntime_bin_ps = '20'", "valid number; got '20'"),
        ("[timing]\nbins = 9.5", "valid integer"),
        ("[timing]\ncycles = -1", "greater than or equal to 0"),
        ("[timing]\norientation = 'both'", "'gate' or 'histogram'; got 'both'"),
        ("[gate]\nwidth_ps = -200", r"\[gate\] width_ps: input should be greater than 0"),
        ("[correction]\ndark = -1", r"\[correction\] dark"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ContractError, match=message) as raised:
        _read(tmp_path, text)
    assert "\n" not in str(raised.value)


def test_what_an_axis_lacks_is_asked_for() -> None:
    bare = Timing()
    with pytest.raises(
        ContractError, match=r'state \[timing\] orientation = "gate" or "histogram"'
    ):
        bare.axis(bins=100)
    with pytest.raises(
        ContractError, match=r"how wide a time bin is; state \[timing\] time_bin_ps"
    ):
        bare.axis(bins=100, orientation="histogram")
    wide = bare.with_stated({"time_bin_ps": 8.0})
    with pytest.raises(ContractError, match=r"time stamps need \[timing\] bins"):
        wide.axis(orientation="histogram")
    with pytest.raises(ContractError, match=r"has 100 time bins, \[timing\] states 99"):
        wide.with_stated({"bins": 99}).axis(bins=100, orientation="histogram")
    with pytest.raises(ContractError, match="at least 8 bins; got 7"):
        wide.axis(bins=7, orientation="histogram")


def test_edges_stand_for_width_and_first(tmp_path: Path) -> None:
    edges = [0, 1, 2, 4, 8, 16, 32, 64, 100]
    text = f"[timing]\norientation = 'histogram'\nbin_edges_ps = {edges}\n"
    axis = _read(tmp_path, text).axis(bins=8)
    assert axis.edges_ps.tolist() == edges
    with pytest.raises(ContractError, match="leave time_bin_ps out"):
        _read(tmp_path, text + "time_bin_ps = 3\n").axis(bins=8)
    with pytest.raises(ContractError, match=r"has 9 time bins, \[timing\] states 8"):
        _read(tmp_path, text).axis(bins=9)


def test_the_caller_goes_before_the_capture(tmp_path: Path) -> None:
    stated = {
        "time_bin_ps": np.float32(4),
        "orientation": "histogram",
        "cycles": np.int64(5),
        "bin_edges_ps": np.arange(9.0),
        "remark": "nothing to do with time",
    }
    timing = _read(tmp_path, "[timing]\ntime_bin_ps = 16\n").with_stated(stated)
    axis = timing.axis(bins=10)
    assert axis.step_ps == 16  # and the edges that the capture states do not come into it
    assert timing.timing.cycles == 5
    edges = [0.0, 1, 2, 3, 4, 5, 6, 7, 8]
    told = _read(tmp_path, f"[timing]\nbin_edges_ps = {edges}\n")
    told = told.with_stated({"first_ps": 3.0, "time_bin_ps": 4.0, "orientation": "gate"})
    assert told.axis(bins=8).edges_ps.tolist() == edges
    with pytest.raises(
        ContractError, match=r"what the capture states of itself: \[timing\] time_bin"
    ):
        Timing().with_stated({"time_bin_ps": -3.0})


def test_whole_floats_of_a_capture_are_whole_numbers(tmp_path: Path) -> None:
    """MATLAB knows hardly any others; a timing file does."""
    for value in (78_000.0, np.float64(78_000), np.array(78_000.0), np.array(78_000)):
        timing = Timing().with_stated({"cycles": value, "bins": np.array(40.0), "first_ps": 8.0})
        assert (timing.timing.cycles, timing.timing.bins) == (78_000, 40)
    for wrong in (0.5, np.nan, np.inf, -1.0):
        with pytest.raises(ContractError, match=r"states of itself: \[timing\] cycles"):
            Timing().with_stated({"cycles": wrong})
    with pytest.raises(ContractError, match="valid integer"):
        _read(tmp_path, "[timing]\ncycles = 78000.0\n")


def test_maps_are_of_the_size_of_the_capture(tmp_path: Path) -> None:
    dark = np.arange(6, dtype=np.float32).reshape(2, 3)
    np.save(tmp_path / "dark.npy", dark)
    np.save(tmp_path / "hot.npy", dark > 4)
    timing = _read(tmp_path, "[correction]\ndark = 'dark.npy'\nhot = 'hot.npy'\n")
    np.testing.assert_array_equal(timing.dark((2, 3)), dark)
    assert np.argwhere(timing.hot((2, 3))).tolist() == [[1, 2]]
    assert timing.files == [tmp_path / "dark.npy", tmp_path / "hot.npy"]
    with pytest.raises(ContractError, match="map of dark counts is 3x2, the capture 2x3"):
        timing.dark((3, 2))
    np.save(tmp_path / "dark.npy", -dark)
    with pytest.raises(ContractError, match="dark counts holds negative numbers"):
        timing.dark((2, 3))


def test_a_map_that_is_none_is_refused(tmp_path: Path) -> None:
    timing = _read(tmp_path, "[correction]\nhot = 'hot.npy'\n")
    path = tmp_path / "hot.npy"
    for bad in (b"", b"\x93NUMPY", b"PK\x03\x04"):
        path.write_bytes(bad)
        with pytest.raises(ContractError, match=r"hot.npy must be an .npy file of numbers"):
            timing.hot((2, 3))
    np.save(path, np.array([[object()]]), allow_pickle=True)
    with pytest.raises(ContractError, match="Object arrays cannot be loaded"):
        timing.hot((1, 1))
    for wrong in (np.zeros(3), np.full((2, 3), np.nan)):
        np.save(path, wrong)
        with pytest.raises(ContractError, match="must hold finite numbers"):
            timing.hot((2, 3))
    with path.open("wb") as file:
        file.truncate(70_000_000)
    with pytest.raises(ContractError, match="more than 64 MB"):
        timing.hot((2, 3))
