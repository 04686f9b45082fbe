"""A camera that no file of camkit knows goes through every command of use and judgement.

It is monochrome, without a bank, has two networks in a row and a picture twice the size, behind
one-sided streaks: see `tests/toy_camera`.
"""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from camkit.cli.exit_code import ExitCode
from camkit.report.figure import encode_png
from camkit.report.stress import stress_run
from tests.toy_camera.bundle import HEIGHT_PX, SCALE, WIDTH_PX, write_toy_bundle
from tests.toy_camera.install import toy_installed  # noqa: F401

PNG = encode_png(np.zeros((1, 1, 3), np.uint8))

pytestmark = pytest.mark.usefixtures("toy_installed")


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory, toy_installed: None) -> Path:  # noqa: F811
    return write_toy_bundle(tmp_path_factory.mktemp("toy")).path


@pytest.fixture
def capture(toy: Path, tmp_path: Path, camkit_command) -> Path:
    file = tmp_path / "a.tif"
    outcome = camkit_command("simulate", "procedural:5", "--bundle", toy, "-o", file)
    assert outcome.code == 0, outcome.err
    return file


def test_it_simulates_files_of_its_own_format(capture: Path, toy: Path, camkit_command) -> None:
    samples = tifffile.imread(capture)
    assert (samples.shape, samples.dtype) == ((HEIGHT_PX, WIDTH_PX), np.uint16)
    wrong = camkit_command("simulate", "procedural:5", "--bundle", toy, "-o", "a.dng")
    assert wrong.code == ExitCode.USAGE
    assert "is a file in .tif" in wrong.err


def test_its_light_is_exposed_by_what_saturates_it(
    toy: Path, tmp_path: Path, camkit_command
) -> None:
    call = ("simulate", "night:2", "--bundle", toy, "-o", tmp_path / "n.tif", "--json")
    told = json.loads(camkit_command(*call, "--saturate", 0.05).out)
    assert told["saturated_fraction"] == pytest.approx(0.05, abs=1e-3)
    refused = {("--bits", "10"): "cameras with a mosaic", ("--truth", "t.exr"): "2 times finer"}
    for option, said in refused.items():
        outcome = camkit_command(*call, "--overwrite", *option)
        assert outcome.code == ExitCode.USAGE
        assert said in outcome.err


@pytest.mark.parametrize(("format_", "suffix"), [("exr", "exr"), ("tiff", "tif"), ("png", "png")])
def test_it_makes_pictures_twice_the_size(
    capture: Path, toy: Path, tmp_path: Path, camkit_command, format_: str, suffix: str
) -> None:
    out = tmp_path / "out"
    outcome = camkit_command(
        "process", capture, "--bundle", toy, "--format", format_, "--out-dir", out, "--json"
    )
    assert outcome.code == 0, outcome.err
    facts = json.loads(outcome.out)
    assert {"network denoise", "network upscale"} <= facts["seconds"].keys()
    picture = out / f"a.{suffix}"
    assert picture.is_file()
    if format_ != "exr":
        levels = cv2.imread(str(picture), cv2.IMREAD_UNCHANGED)
        # its one channel is grey, and so is the file
        assert levels.shape == (SCALE * HEIGHT_PX, SCALE * WIDTH_PX)


def test_it_proves_itself_layer_by_layer(toy: Path, camkit_command) -> None:
    outcome = camkit_command("check", toy, "--json")
    assert outcome.code == 0, outcome.out
    layers = json.loads(outcome.out)["layers"]
    *proved, laws = layers
    assert {layer["status"] for layer in proved} == {"pass"}
    assert laws["status"] == "skip", "a toy has no twin that photographs"


def test_it_is_described_and_planned(toy: Path, capture: Path, camkit_command) -> None:
    facts = json.loads(camkit_command("info", toy, "--json").out)
    assert (facts["kind"], facts["sensor"]["channels"]) == ("toy", ["Y"])
    assert list(facts["networks"]) == ["denoise", "upscale"]
    plan = json.loads(camkit_command("plan", capture, "--bundle", toy, "--json").out)
    assert (plan["status"], plan["size"]) == ("planned", "S")
    assert plan["estimate"]["seconds"] > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--method", "wiener"), "method must be one of net"),
        (("--method", "develop"), "method must be one of net"),
        (("--depth-m", "2"), "--depth-m does not apply to bundle toy"),
        (("--demosaic", "fast"), "--demosaic does not apply to bundle toy"),
        (("--size", "M"), "holds size(s) S"),
    ],
)
def test_what_means_nothing_to_it_is_refused_by_name(
    capture: Path, toy: Path, camkit_command, arguments: tuple[str, str], words: str
) -> None:
    outcome = camkit_command("process", capture, "--bundle", toy, *arguments)
    assert outcome.code == ExitCode.USAGE
    assert words in outcome.err


def test_it_benches_with_the_rows_that_mean_something_to_it(
    toy: Path, tmp_path: Path, camkit_command
) -> None:
    outcome = camkit_command(
        *("bench", toy, "--quick", "--repeat", "1", "--methods", "net,brighter,develop"),
        *("--out-dir", tmp_path / "out", "--work-dir", tmp_path / "work", "--json"),
    )
    assert outcome.code == 0, outcome.err
    report = json.loads(outcome.out)
    rows = {row["label"]: row for row in report["rows"]}
    assert {row["kind"] for row in rows.values()} == {"network", "brighter"}
    network = rows["S"]
    assert network["error"] is None
    assert network["mac_per_px"] == pytest.approx(144 + 360)
    assert 0 < network["share_of_gemm_peak"] < 1
    assert (network["images"], network["psf"]) == (1, "bundle")
    assert network["psnr_db"] > 10
    assert network["input_psnr_db"] is None  # nothing of the right size stands for its picture
    assert rows["S exposure_ev 1.0"]["psnr_db"] != network["psnr_db"]
    assert [skip["what"] for skip in report["skipped"]] == ["toy develop"]


def test_pictures_of_a_folder_are_photographed_as_fine_as_its_picture(
    toy: Path, tmp_path: Path, camkit_command
) -> None:
    sharp = tmp_path / "sharp"
    sharp.mkdir()
    values = np.random.default_rng(0).integers(0, 256, (201, 151, 3), dtype=np.uint8)
    cv2.imwrite(str(sharp / "a.png"), cv2.GaussianBlur(values, (0, 0), 2))
    outcome = camkit_command(
        *("bench", toy, "--quick", "--repeat", "1", "--methods", "net", "--data", sharp),
        *("--out-dir", tmp_path / "out", "--work-dir", tmp_path / "work", "--json"),
    )
    assert outcome.code == 0, outcome.err
    (row,) = json.loads(outcome.out)["rows"]
    assert (row["images"], row["captures"]) == (1, 10)
    assert row["psnr_db"] > 10


def test_every_scenario_that_is_for_it_runs_and_its_own_among_them(
    toy: Path, tmp_path: Path, camkit_command, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = []
    # 27 charts take two thirds of the time to become PNGs; tests of `stress` make those
    monkeypatch.setattr(stress_run, "to_png", lambda figure: drawn.append(figure) or PNG)
    outcome = camkit_command(
        "stress", toy, "--quick", "--scenes", "1", "--out-dir", tmp_path, "--json"
    )
    assert outcome.code == 0, outcome.err
    rows = {row["scenario"]: row for row in json.loads(outcome.out)}
    left_out = {name: row["skipped"] for name, row in rows.items() if row["skipped"]}
    hazy = {"energy_split", "lost_dark_frame"}
    assert left_out.keys() == {"defocus", "depth", "known_depth", *hazy}
    assert rows["noise"]["psnr_db"].keys() == {"S"}
    assert rows["noise"]["psnr_db"]["S"][0] > rows["noise"]["psnr_db"]["S"][1] > 5
    assert rows["haze"]["chi2"]["S"][0] == pytest.approx(1, abs=0.01)
    assert rows["tile_seams"]["extra"]["seam_max_abs"]["S"][0] == 0
    assert rows["stuck_rows"]["break_point"] < 8
    assert len(drawn) == len(rows) - len(left_out)
    assert (tmp_path / "stress.html").is_file()
    assert not rows["noise"]["faults"]


def test_with_nothing_simpler_to_beat_no_range_is_stored(
    toy: Path, tmp_path: Path, camkit_command
) -> None:
    copy = tmp_path / "toy.camkit"
    copy.write_bytes(toy.read_bytes())
    outcome = camkit_command(
        "stress", copy, "--scenarios", "stuck_rows", "--scenes", "1", "--write"
    )
    assert outcome.code == ExitCode.USAGE
    assert "no range was measured" in outcome.err


def test_no_file_of_camkit_knows_it() -> None:
    import camkit

    root = Path(camkit.__file__).resolve().parents[1]
    folders = ("camkit", "runtime", "models_def", "export")
    for file in (path for folder in folders for path in (root / folder).rglob("*.py")):
        assert "toy_camera" not in file.read_text(encoding="utf-8"), file
