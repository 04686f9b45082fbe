"""A camera in one command: the order of its steps, what ships, and a filter for real."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit import recipe
from camkit.bundle.reader import open_bundle
from camkit.calibrate import import_psf
from camkit.cli.app import run
from camkit.errors import ContractError
from camkit.models_def.face.recipe_writing import CameraWords
from camkit.models_def.training.kind import read_recipe
from camkit.progress import Board, listening
from camkit.report.making import camera_judging, camera_making, making_run, page_parts
from camkit.report.making.camera_judging import FILTER, Judgement
from camkit.report.making.camera_steps import CameraSteps
from camkit.runtime.plan.decision import DEVELOP
from tests.psf_files import counts
from tests.wide_bundle import write_wide_bundle

SENSOR = "128x96@5um"


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge little."""
    values = {"SCENES": 2, "SIDE_PX": 96, "POSITIONS": (0,), "ISOS": (100.0,), "COPIES": 1}
    for name, value in values.items():
        monkeypatch.setattr(camera_judging, name, value)
    monkeypatch.setattr(page_parts, "TIMED_PX", 96)


def test_a_lens_becomes_a_proved_filter_and_a_page(
    small: None,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "mine.camkit"
    words = [
        "make",
        "double-gauss-f2",
        "--sensor",
        SENSOR,
        "--focus-m",
        "inf",
        "-o",
        str(out),
        "--json",
    ]
    assert run([*words, "--minutes", "0"]) == 0
    told = capsys.readouterr()
    facts = json.loads(told.out)
    assert facts["sizes"] == []
    assert facts["psnr_db"].keys() == {DEVELOP, FILTER}
    assert list(facts["cpu_s"]) == ["described", "frozen", "filtered", "judged"]
    assert "its filter restores, usable now" in told.err
    bundle = open_bundle(out)
    assert bundle.manifest.name == "mine"
    assert bundle.manifest.sensor.width_px == 128
    page = Path(facts["page"]).read_text(encoding="utf-8")
    for heading in ("The camera mine", "Decibels", "The lens", "Blur over the field", "Seconds"):
        assert heading in page
    # the same words say that it is finished, and do nothing twice
    monkeypatch.setattr(making_run, "judge_camera", None)
    stamps = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    assert run([*words, "--minutes", "0"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out) == facts
    assert f"{out} is finished, and its page {facts['page']}: nothing is done anew" in told.err
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == stamps
    # a file that is gone is made again, without judging
    for path in (out, Path(facts["page"])):
        kept = path.read_bytes()
        path.unlink()
        assert run([*words, "--minutes", "0"]) == 0
        assert json.loads(capsys.readouterr().out)["psnr_db"] == facts["psnr_db"]
        assert path.is_file()
        assert path != out or path.read_bytes() == kept
    assert run([*words, "--minutes", "1"]) == 2
    assert "begun with another minutes" in capsys.readouterr().err


def test_a_filter_without_judging_has_no_page_and_is_judged_later(
    small: None,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out, page = tmp_path / "mine.camkit", tmp_path / "mine.html"
    words = ["make", "any.zmx", "--sensor", SENSOR, "-o", str(out), "--minutes", "0"]
    Steps(monkeypatch, tmp_path, 30.0)
    page.write_text("of another camera")
    assert run([*words, "--no-judge", "--overwrite"]) == 0
    assert "its filter is not judged, and no page is written" in capsys.readouterr().out
    assert open_bundle(out).manifest.sensor.width_px
    assert not page.exists()
    assert run([*words, "--no-judge", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["page"], facts["psnr_db"], facts["over_filter_db"]) == (None, {}, {})
    # the same words without it go on where they were
    assert run(words) == 0
    assert page.exists()
    assert run(["make", "duet", "--sensor", SENSOR, "-o", str(out), "--no-judge"]) == 2
    assert "without judging give --minutes 0; got 15" in capsys.readouterr().err


def measured_grid(path: Path) -> Path:
    """Write the PSF of a laboratory: kernels of three colours on a grid."""
    np.save(path.with_suffix(".npy"), counts())
    import_psf(path.with_suffix(".npy"), path, pitch_um=5.0, span_mm="0.6x0.4")
    return path


class Steps:
    """Steps that do nothing but write a bundle."""

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        folder: Path,
        network_db: float,
        channels: int = 3,
    ) -> None:
        self.done: list[str] = []
        self.minutes = 0.0
        bundle = write_wide_bundle(folder, "any.camkit").path.read_bytes()

        def of(name: str, facts: dict[str, Any], writes: str = "") -> Callable[..., dict[str, Any]]:
            def step(steps: CameraSteps, *arguments: float) -> dict[str, Any]:
                self.done.append(name)
                self.minutes = arguments[0] if arguments else self.minutes
                if writes:
                    steps.work.path(writes).write_bytes(bundle)
                return facts

            return step

        sensor = {"width_px": 320, "height_px": 240, "pixel_pitch_um": 6.0}
        described = {"notes": ["a note"], "sensor": sensor, "defaults": [], "channels": channels}
        described["is_grid"] = False
        for name, facts, writes in (
            ("describe", described, ""),
            ("freeze", {"side_px": 9, "energy_kept": 0.99}, ""),
            ("export_filter", {}, "filter.camkit"),
            ("fit_bank", {"gain_db": 0.5}, ""),
            ("train", {"steps": 7}, ""),
            ("export_network", {}, "network.camkit"),
        ):
            monkeypatch.setattr(CameraSteps, name, of(name, facts, writes))
        judged = {
            DEVELOP: Judgement(psnr_db=(19.0, 19.0), scenes=("a", "b")),
            FILTER: Judgement(psnr_db=(20.0, 20.0), scenes=("a", "b")),
            "S": Judgement(psnr_db=(network_db, network_db), scenes=("a", "b")),
        }
        monkeypatch.setattr(making_run, "judge_camera", lambda *_: judged)
        for name in ("pictures_of", "seconds_of", "camera_html", "layout_of"):
            monkeypatch.setattr(making_run, name, lambda *_: "")


@pytest.mark.parametrize("network_db", [19.9, 20.4])
def test_a_network_ships_if_it_beats_its_filter(
    network_db: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, told = Steps(monkeypatch, tmp_path, network_db), []
    camera_making.make(
        "any.zmx",
        tmp_path / "out.camkit",
        camera=CameraWords(sensor=SENSOR),
        minutes=10.0,
        on_note=told.append,
    )
    assert steps.done == [
        *("describe", "freeze", "export_filter", "fit_bank", "train", "export_network"),
    ]
    # what is left of the minutes, less what comes after
    assert steps.minutes == pytest.approx(10 - making_run.LAST_S / 60, abs=1)
    assert told[0] == "a note"
    if network_db > 20:
        assert "network S: +0.40 +- 0.00 dB over the filter" in told[-1]
    else:
        assert "-0.10 +- 0.00 dB over the filter: it stays out of the bundle" in told[-1]


def test_judging_shows_its_share(
    small: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(camera_judging, "ISOS", (100.0, 200.0))
    bundle, board = write_wide_bundle(tmp_path, "any.camkit"), Board(note=lambda _: None)
    done = []

    def restored(pipeline: Any, exposed: Any) -> Any:
        (task,) = (task for task in board.tasks if task.what == "judging the camera")
        done.append((task.done, task.total, task.unit))
        return exposed.sharp

    monkeypatch.setattr(camera_judging, "restored_by", restored)
    monkeypatch.setattr(camera_judging, "pipelines_of", lambda _: {DEVELOP: None})
    with listening(board):
        camera_judging.judge_camera(bundle, None, tmp_path)
    assert done == [(number, 4, "captures") for number in range(4)]


def test_few_minutes_leave_the_filter_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, told = Steps(monkeypatch, tmp_path, 30.0), []
    camera_making.make(
        "psf.safetensors",
        tmp_path / "out.camkit",
        camera=CameraWords(sensor=SENSOR),
        minutes=1.0,
        on_note=told.append,
    )
    # a measured PSF needs no freezing
    assert steps.done == ["describe", "export_filter"]
    assert told[-1] == "no minutes are left to train a network"


def test_a_grey_camera_has_its_filter_and_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, told = Steps(monkeypatch, tmp_path, 30.0, channels=1), []
    camera_making.make(
        "any.zmx",
        tmp_path / "out.camkit",
        camera=CameraWords(sensor=f"{SENSOR}:grey"),
        on_note=told.append,
    )
    assert steps.done == ["describe", "freeze", "export_filter"]
    assert "networks are trained on three colours" in told[-1]


@pytest.mark.parametrize(
    ("kind", "lens"), [("planes", "double-gauss-f2"), ("grey", "al2550-a")], ids=["planes", "grey"]
)
def test_a_camera_without_a_mosaic_is_made(
    kind: str, lens: str, small: None, tmp_path: Path
) -> None:
    out = tmp_path / "mine.camkit"
    words = CameraWords(sensor=f"{SENSOR}:{kind}", focus_m=float("inf"))
    facts = camera_making.make(lens, out, camera=words, minutes=0.0)
    assert facts["psnr_db"][FILTER] > facts["psnr_db"][DEVELOP]
    manifest = open_bundle(out).manifest
    assert manifest.sensor.type == "planes"
    assert manifest.sensor.channels == (("Y",) if kind == "grey" else ("R", "G", "B"))
    assert "demosaic" not in [stage.type for stage in manifest.stages]


def test_files_of_others_are_not_replaced(tmp_path: Path) -> None:
    out = tmp_path / "out.camkit"
    out.write_bytes(b"mine")
    with pytest.raises(ContractError, match="exists"):
        camera_making.make("duet", out, camera=CameraWords(sensor=SENSOR))
    with pytest.raises(ContractError, match="minutes must be >= 0; got -1"):
        camera_making.make("duet", out, camera=CameraWords(sensor=SENSOR), minutes=-1.0)
    assert out.read_bytes() == b"mine"


def test_a_measured_psf_becomes_a_camera_and_words_of_a_lens_are_refused(
    small: None, tmp_path: Path
) -> None:
    psf = measured_grid(tmp_path / "lab.safetensors")
    camera = CameraWords(sensor=SENSOR)
    facts = camera_making.make(psf, tmp_path / "mine.camkit", camera=camera, minutes=0.0)
    assert facts["psnr_db"].keys() == {DEVELOP, FILTER}
    bundle = open_bundle(tmp_path / "mine.camkit")
    assert bundle.psf.symmetry == "grid"
    assert bundle.psf.pixel_pitch_um == 5.0
    recipe = (tmp_path / "mine.work" / "recipe.toml").read_text(encoding="utf-8")
    assert 'psf = "measured.safetensors"' in recipe
    assert "channel_response" not in recipe
    assert "A measured point spread function" in Path(facts["page"]).read_text(encoding="utf-8")
    wrong = replace(camera, f_number=4.0, focus_m=1.0)
    with pytest.raises(ContractError, match=r"measured PSF, .* leave f_number, focus_m out"):
        camera_making.make(psf, tmp_path / "other.camkit", camera=wrong, minutes=0.0)


def test_the_recipe_of_a_measured_psf_is_read_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    psf = measured_grid(tmp_path / "lab.safetensors")
    facts = recipe(psf, tmp_path / "new" / "mine.toml", camera=CameraWords(sensor=SENSOR))
    assert Path(facts["lens"]).name == "mine-psf.safetensors"
    assert Path(facts["lens"]).read_bytes() == psf.read_bytes()
    assert read_recipe(Path(facts["recipe"])).lens.psf == "mine-psf.safetensors"
    again = ["recipe", str(psf), "--sensor", SENSOR, "-o", str(tmp_path / "cli.toml")]
    assert run(again) == 0
    assert "a measured PSF on 128x96 of 5 um" in capsys.readouterr().out
    assert run([*again, "--overwrite", "--defocus-mm", "0.1"]) == 2
    assert "leave --defocus-mm out" in capsys.readouterr().err


def test_a_filter_that_gains_nothing_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Steps(monkeypatch, tmp_path, 30.0)
    even = Judgement(psnr_db=(20.0, 20.0), scenes=("a", "b"))
    monkeypatch.setattr(making_run, "judge_camera", lambda *_: {DEVELOP: even, FILTER: even})
    told: list[str] = []
    camera = CameraWords(sensor=SENSOR)
    camera_making.make(
        "any.zmx", tmp_path / "out.camkit", camera=camera, minutes=0.0, on_note=told.append
    )
    assert "the filter does not surely beat developing alone (+0.00 +- 0.00 dB)" in told[-1]
