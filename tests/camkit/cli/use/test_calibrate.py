"""`camkit calibrate psf`: a file that the design side reads, what is said, what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.psf_file import read_psf
from camkit.cli.exit_code import ExitCode
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf, write_plate_psf
from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.effective import effective_psf
from camkit.models_def.optics.dots.match import match_dots
from camkit.models_def.optics.dots.pattern import dot_picture
from camkit.models_def.optics.dots.target import likeness, to_target
from camkit.models_def.optics.dots.unit import DotPlate
from tests.camkit.calibration.haze_factory import Hazy
from tests.camkit.calibration.point_factory import (
    Point,
    exposed,
    write_bracket,
    write_pictures,
    write_planes,
)
from tests.camkit.calibration.point_factory import write_mosaic as write_dark

SMALL = Point(side=96, x=47.7, y=46.2, reach=20, streak=1e-3)
TIMES_S = (1.0, 1 / 8, 1 / 64)


@pytest.fixture
def bracket(tmp_path: Path) -> list[Path]:
    """Three linear pictures, longest first."""
    return write_pictures(tmp_path, SMALL, times_s=TIMES_S)


def test_raw_frames_and_darks_become_a_psf_and_one_object(camkit_command, tmp_path: Path) -> None:
    files = write_bracket(tmp_path, SMALL, times_s=TIMES_S)
    dark = tmp_path / "dark.dng"
    write_dark(dark, exposed(np.zeros((96, 96)), 1.0, 7), 1.0)
    out = tmp_path / "new" / "psf.safetensors"
    asked = ("-o", out, "--dark", dark, "--pixel-pitch-um", 4.2, "--depth-m", 3, "--side-px", 41)
    done = camkit_command("calibrate", "psf", *files, *asked, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["frames"] == ["0.dng", "1.dng", "2.dng"]
    assert told["times_s"] == [1, 0.125, 0.015625]
    assert told["centre_px"] == pytest.approx([47.7, 46.2], abs=0.03)
    assert (told["side_px"], told["filled_samples"]) == (41, 0)
    assert told["notes"] == ["3 frames: no colour matrix is known for this camera"]
    assert [c["colour"] for c in told["colours"]] == ["blue", "green", "red"]
    assert all(0.8 < c["core_share"] < 1 for c in told["colours"])
    psf = read_psf(out)
    assert psf.pixel_pitch_um == 4.2
    assert psf.depths_mm.tolist() == [3000]
    truth = SMALL.kernels(20)
    assert np.abs(psf.kernels[0, 0] - truth).max() < 0.03 * truth.max()


def test_the_same_is_said_for_people(camkit_command, bracket: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "psf.safetensors"
    asked = ("--times", "1,1/8,1/64", "--pixel-pitch-um", 5, "-o", out)
    done = camkit_command("calibrate", "psf", *bracket, *asked)
    assert done.code == 0, done.err
    assert "the light at (47." in done.out
    assert "green" in done.out
    again = camkit_command("calibrate", "psf", *bracket, *asked)
    assert again.code == ExitCode.USAGE
    assert camkit_command("calibrate", "psf", *bracket, *asked, "--overwrite").code == 0


def test_a_list_of_times_may_name_the_darks_too(
    camkit_command, bracket: list[Path], tmp_path: Path
) -> None:
    dark = tmp_path / "dark.png"
    dark.write_bytes(write_pictures(tmp_path, Point(side=96, x=-500), times_s=(1.0,))[0].read_bytes())  # noqa: E501 # fmt: skip
    bracket = write_pictures(tmp_path, SMALL, times_s=TIMES_S)
    out, asked = tmp_path / "psf.safetensors", ("--dark", dark, "--pixel-pitch-um", 5)
    for times in ("1,0.125,0.015625,1", "1,0.125,0.015625"):
        done = camkit_command("calibrate", "psf", *bracket, *asked, "-o", out, "--times", times)
        assert (done.code == 0) == (times.count(",") == 3), done.err
        out.unlink(missing_ok=True)
    assert "dark frame dark.png states no exposure time" in done.err
    done = camkit_command("calibrate", "psf", *bracket, *asked, "-o", out, "--times", "1,2")
    assert "2 times for 3 files and 1 dark frames" in done.err


@pytest.mark.parametrize(
    ("out", "options", "told"),
    [
        ("psf.npz", [], "expected a name in .safetensors"),
        ("psf.safetensors", [], "add --pixel-pitch-um"),
        ("psf.safetensors", ["--side-px", 40], "must be odd"),
        ("psf.safetensors", ["--pixel-pitch-um", 5, "--side-px", 201], "at most"),
    ],
)
def test_wrong_wishes_give_one_line_and_no_file(
    camkit_command, bracket: list[Path], tmp_path: Path, out: str, options: list, told: str
) -> None:
    asked = ("--times", "1,1/8,1/64", *options)
    done = camkit_command("calibrate", "psf", *bracket, "-o", tmp_path / out, *asked)
    assert done.code == ExitCode.USAGE
    assert told in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not list(tmp_path.glob("psf*"))


def test_a_peak_that_clips_fails_the_input(camkit_command, tmp_path: Path) -> None:
    files = write_pictures(tmp_path, SMALL, peak=1.5, times_s=TIMES_S)
    asked = ("--times", "1,1/8,1/64", "--pixel-pitch-um", 5, "-o", tmp_path / "psf.safetensors")
    done = camkit_command("calibrate", "psf", *files, *asked)
    assert done.code == ExitCode.INPUT_FAILED
    assert "add a shorter one" in done.err
    assert not (tmp_path / "psf.safetensors").exists()


def test_notes_are_said_on_stderr(camkit_command, tmp_path: Path) -> None:
    wide = Point(side=96, x=47.7, y=46.2, reach=90, streak=3e-2)
    files = write_pictures(tmp_path, wide, times_s=TIMES_S)
    asked = ("--times", "1,1/8,1/64", "--pixel-pitch-um", 5, "-o", tmp_path / "psf.safetensors")
    done = camkit_command("calibrate", "psf", *files, *asked)
    assert done.code == 0
    assert "note: light is still seen" in done.err


DOTS = DotCamera(cells=32, tiles=16)
DESIGNED = gaussian_psf(1.84)


@pytest.fixture(name="mis_etched", scope="module")
def plate_etched_too_deep() -> np.ndarray:
    """Heights of a plate whose masks etch 8 % too deep."""
    rng = np.random.default_rng(0)
    plate: DotPlate = match_dots(to_target(DESIGNED), DOTS, 8, rng, starts=1).plate
    return plate.etched_um((0.08,) * 3)


def test_a_photographed_plate_becomes_the_psf_that_training_takes(
    camkit_command, mis_etched: np.ndarray, tmp_path: Path
) -> None:
    grid = PixelGrid(side_px=241, pitch_um=3.45, samples=3)
    light = dot_picture(mis_etched, DOTS, grid)
    files = write_planes(tmp_path, np.stack([light] * 3) / light.max(), times_s=TIMES_S)
    designed, out = tmp_path / "designed.safetensors", tmp_path / "seen.safetensors"
    write_plate_psf(designed, DESIGNED)
    asked = ("--times", "1,1/8,1/64", "--pixel-pitch-um", 3.45, "--depth-m", 1.35)
    done = camkit_command("calibrate", "psf", *files, *asked, "--dots", designed, "-o", out, "--json")  # noqa: E501 # fmt: skip
    assert done.code == 0, done.err
    true = effective_psf(mis_etched, DOTS)
    found, missed = (likeness(k, true) for k in (read_plate_psf(out), DESIGNED))
    # white is 10,000 electrons, so the brightest dot is known to about 1 % in the shortest frame
    assert found.rmse < 0.008
    assert found.correlation > 0.9997
    assert missed.rmse > 5 * found.rmse
    told = json.loads(done.out)["dots"]
    assert set(told) == {"place_um", "share", "modulation", "likeness"}
    assert told["likeness"] > 0.95
    again = camkit_command("calibrate", "psf", *files, *asked, "--dots", designed, "-o", out, "--overwrite")  # noqa: E501 # fmt: skip
    assert "dots: " in again.out
    assert "of the light in active areas" in again.out


def test_a_design_that_is_no_psf_is_refused_before_the_frames_are_read(
    camkit_command, tmp_path: Path
) -> None:
    done = camkit_command("calibrate", "psf", "a.png", "b.png", "-o", tmp_path / "psf.safetensors", "--dots", tmp_path / "none.safetensors")  # noqa: E501 # fmt: skip
    assert done.code == ExitCode.BUNDLE_REFUSED
    assert "none.safetensors" in done.err


def test_a_point_without_a_plate_has_no_dots(
    camkit_command, bracket: list[Path], tmp_path: Path
) -> None:
    designed, out = tmp_path / "designed.safetensors", tmp_path / "psf.safetensors"
    write_plate_psf(designed, DESIGNED)
    asked = ("--times", "1,1/8,1/64", "--pixel-pitch-um", 9, "--dots", designed, "-o", out)
    done = camkit_command("calibrate", "psf", *bracket, *asked)
    assert done.code == ExitCode.INPUT_FAILED
    assert "no dots every 37.5 um" in done.err
    assert not out.exists()


def test_a_disc_becomes_a_psf_a_page_and_one_object(camkit_command, tmp_path: Path) -> None:
    hazy = Hazy(side=300, end=110, scale=50, x=151.3, y=147.6)
    files, darks = hazy.write(tmp_path, hazy.planes(4.0)), hazy.write_darks(tmp_path, 2)
    out, page = tmp_path / "psf.safetensors", tmp_path / "psf.html"
    asked = ["-o", out, "--page", page, "--pixel-pitch-um", 4, "--disc-px", 4]
    dark = [part for path in darks for part in ("--dark", path)]
    done = camkit_command("calibrate", "psf", *files, *dark, *asked, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    (field,) = told["fields"]
    assert set(field) == {"height_mm", "peak_share", "peak_share_error"}
    assert field["height_mm"] == pytest.approx(0.004 * np.hypot(1.8, 1.9), abs=2e-4)
    assert field["peak_share"] == pytest.approx(hazy.peak_share, abs=0.01)
    assert told["page"] == str(page)
    assert all(colour["residual"] < 0.01 for colour in told["colours"])
    assert page.read_text().count("<img") == 3
    assert read_psf(out).kernels.shape[2] == 3
    again = camkit_command("calibrate", "psf", *files, *dark, *asked)
    assert again.code == ExitCode.USAGE
    out.unlink()
    assert "psf.html exists" in camkit_command("calibrate", "psf", *files, *dark, *asked).err
    missing = camkit_command("calibrate", "psf", *files, *asked, "--overwrite")
    assert missing.code == ExitCode.INPUT_FAILED
    assert "veiling glare fills the frame" in missing.err
    assert len(missing.err.strip().splitlines()) == 1
    assert not out.exists()


def test_one_frame_of_an_edge_becomes_a_psf(camkit_command, tmp_path: Path) -> None:
    clear = Hazy(core=1.0, side=200, x=101.3, y=97.6)
    (file,) = clear.write(tmp_path, clear.edge_planes(0.1), times_s=(1.0,))
    out = tmp_path / "psf.safetensors"
    done = camkit_command("calibrate", "psf", file, "--edge", "-o", out, "--pixel-pitch-um", 4)
    assert done.code == 0, done.err
    assert "within 10 px" in done.out
    assert "blurred anew" in done.out
    assert read_psf(out).kernels.shape[-1] < 30


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--edge", "--disc-px", 4], "use one of --disc-px and --edge"),
        (["--edge", "--dots", "d.safetensors"], "use one of --edge and --dots"),
        (["--disc-px", 0], "--disc-px must be > 0"),
        (["--page", "psf.txt"], "a page is HTML"),
    ],
)
def test_a_light_is_one_thing(
    camkit_command, bracket: list[Path], tmp_path: Path, options: list, told: str
) -> None:
    asked = ("--times", "1,1/8,1/64", "-o", tmp_path / "psf.safetensors", *options)
    done = camkit_command("calibrate", "psf", *bracket, *asked)
    assert done.code == ExitCode.USAGE
    assert told in done.err
