"""Origin, defocus and curve of two pictures: against simulated truth, and a real lens."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import camkit
from camkit.calibrate import PairWords
from camkit.calibration.blur_pair.distance_facts import DistanceFacts
from camkit.cli.app import run
from camkit.errors import ContractError, DecodeError
from camkit.models_def.optics.render import pair_transfer
from camkit.runtime.signal.tone_curve import read_tone
from tests.capture_factory import write_tiny_captures
from tests.data_folder import ROOT, data_path
from tests.pair_factory import LENS, WORDS, Truth, write_pair

CURVE = ROOT / "tools" / "comparison" / "real-lens-tone.toml"


@pytest.fixture
def _few_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trace few rays: these blurs are of four pixels."""
    monkeypatch.setattr(pair_transfer, "RAYS", 300)


@pytest.fixture(scope="module")
def in_focus(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return pictures of a lens in focus, distances from the first vertex, sRGB."""
    return write_pair(tmp_path_factory.mktemp("pair"), Truth())


def _psnr_db(facts: DistanceFacts, name: str, setting: str = "") -> float:
    return next(
        row.errors.psnr_db() for row in facts.rows if row.name == name and setting in row.setting
    )


@pytest.mark.usefixtures("_few_rays")
def test_curve_and_blur_of_a_lens_in_focus_are_found_and_the_doubt_is_said(
    in_focus: list[Path],
) -> None:
    facts = camkit.calibrate.distance(in_focus, LENS, words=WORDS, tones=("srgb", CURVE))
    assert (facts.origin, facts.tone) == ("vertex", "srgb")
    assert abs(facts.fit.best) < 0.02
    lens_db = _psnr_db(facts, "lens, from vertex", "best focus")
    assert lens_db > 45
    assert lens_db > _psnr_db(facts, "disc") + 0.5
    assert _psnr_db(facts, "disc") > _psnr_db(facts, "Gaussian") + 1
    assert _psnr_db(facts, "lens, from sensor", "best focus") < lens_db - 3
    # one plane looks alike from everywhere once the sensor may move by a tenth of a mm
    assert set(facts.alike) == {"vertex", "sensor", "pupil"}
    assert not facts.is_sure
    assert facts.sentence.startswith("distances may count from the first vertex (")
    assert facts.sentence.endswith("curve srgb")
    assert any("add a pair of another plane" in note for note in facts.doubts)
    assert any(note.startswith("by tone curve, dB: srgb ") for note in facts.doubts)


@pytest.mark.usefixtures("_few_rays")
@pytest.mark.slow
def test_two_planes_separate_the_origin_from_the_defocus(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = Truth(origin="sensor", defocus_mm=0.06)
    files = []
    for object_m in (0.8, 1.35):
        folder = tmp_path / f"{object_m:g}"
        folder.mkdir()
        files += write_pair(folder, truth, object_m=object_m)
    words = [
        *("--lens", LENS, "--focus-m", "1", "--object-m", "0.8,1.35", "--pitch-um", "30"),
        *("--f-number", "4", "--sharp-f-number", "20", "--tone", "srgb", "--json"),
    ]
    assert run(["calibrate", "distance", *map(str, files), *words]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["distance_from"], record["is_sure"]) == ("sensor", True)
    assert record["sentence"].startswith("distances count from the sensor (")
    assert record["defocus_mm"] == pytest.approx(0.06, abs=0.012)
    assert [plane["object_m"] for plane in record["planes"]] == [0.8, 1.35]


@pytest.mark.usefixtures("_few_rays")
@pytest.mark.parametrize("defocus_mm", [-0.08, 0.12])
def test_a_defocus_is_found_where_the_origin_is_known(defocus_mm: float, tmp_path: Path) -> None:
    tone = read_tone(CURVE)
    truth = Truth(origin="sensor", defocus_mm=defocus_mm, tone=tone)
    words = replace(WORDS, distance_from="sensor")
    out = tmp_path / "distance.toml"
    facts = camkit.calibrate.distance(
        write_pair(tmp_path, truth, seed=3), LENS, out, words=words, tones=(CURVE,)
    )
    assert facts.fit.best == pytest.approx(defocus_mm, abs=0.012)
    assert facts.fit.error < 0.02
    assert facts.options["distance_from"] == "sensor"
    assert facts.options["defocus_mm"] == pytest.approx(facts.fit.best, abs=0.005)
    assert facts.is_sure
    assert 'distance_from = "sensor"' in out.read_text(encoding="utf-8")
    # what was found places the lens as it was
    camera = camkit.CameraWords(
        sensor="256x192@30um:planes",
        f_number=4.0,
        focus_m=1.0,
        object_m=(1.35,),
        **facts.options,  # type: ignore[arg-type]
    )
    camkit.recipe(LENS, tmp_path / "mine.toml", camera=camera)


@pytest.mark.usefixtures("_few_rays")
def test_halves_are_averaged_and_the_command_prints_the_table(
    in_focus: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = []
    for path in in_focus:
        codes = cv2.imread(str(path))
        for half in ("_l", "_r"):
            files.append(tmp_path / f"{path.stem}{half}.png")
            cv2.imwrite(str(files[-1]), codes)
    words = [
        *("--lens", LENS, "--focus-m", "1", "--object-m", "1.35", "--halves", "_l,_r"),
        *("--f-number", "4", "--sharp-f-number", "20", "--sensor", "256x192@30um:planes"),
        *("--distance-from", "vertex"),
    ]
    assert run(["calibrate", "distance", *map(str, files), *words]) == 0
    text = capsys.readouterr().out
    assert text.startswith("distances count from the first vertex")
    assert "for camkit make: --distance-from vertex" in text
    assert [line.split()[0] for line in text.splitlines()[2:5]] == ["none", "Gaussian", "disc"]
    assert run(["calibrate", "distance", *map(str, files), *words, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["distance_from"] == "vertex"
    assert record["tone"] == "as the file states"
    assert record["planes"][0]["most_px"] < 0.1
    assert {row["blur"] for row in record["blurs"]} >= {"none", "Gaussian", "disc"}


def _halved(files: list[Path]) -> list[Path]:
    cv2.imwrite(str(files[1]), cv2.imread(str(files[1]))[:96])
    return files


def _other_scene(files: list[Path]) -> list[Path]:
    cv2.imwrite(str(files[1]), cv2.imread(str(files[1]))[::-1])
    return files


def _moved(files: list[Path]) -> list[Path]:
    cv2.imwrite(str(files[1]), np.roll(cv2.imread(str(files[1])), 2, axis=1))
    return files


def _white(files: list[Path]) -> list[Path]:
    codes = cv2.imread(str(files[0]))
    codes[::4, ::4] = 255
    cv2.imwrite(str(files[0]), codes)
    return files


def _single(files: list[Path]) -> list[Path]:
    return files[:1]


@pytest.mark.parametrize(
    ("write", "error", "message"),
    [
        (_halved, DecodeError, "256x192 px and sharp.png 256x96; give two pictures of one size"),
        (_other_scene, DecodeError, "wide.png and sharp.png do not show one scene"),
        (_moved, DecodeError, r"sharp.png lies up to (1\.[89]|2\.)\d* px off wide.png"),
        (_white, DecodeError, "away from clipped samples"),
        (_single, ContractError, "expected 2 pictures, a wide one and a sharp one .*; got 1: wide"),
    ],
)
def test_pictures_that_do_not_belong_together_are_refused(
    write, error: type[Exception], message: str, tmp_path: Path, in_focus: list[Path]
) -> None:
    files = [Path(shutil.copy(path, tmp_path)) for path in in_focus]
    with pytest.raises(error, match=message):
        camkit.calibrate.distance(write(files), LENS, tmp_path / "out.toml", words=WORDS)
    assert not list(tmp_path.glob("*.toml"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"focus_m": 0.02, "distance_from": "sensor"}, "lies within the lens"),
        ({"sharp_f_number": 3.0}, "is not smaller than that of the wide one"),
        ({"sensor": "300x200@5um:planes"}, "sensor is of 300x200 px, and the pictures have 256"),
        ({"pitch_um": None}, "state no pixel pitch; state it by pitch_um"),
        ({"distance_from": "mount"}, "takes one of vertex, sensor, pupil"),
        ({"f_number": 4.0, "stop_radius_mm": 3.0}, "not both"),
    ],
)
def test_a_lens_that_cannot_be_so_is_refused(
    words: dict[str, object], message: str, in_focus: list[Path]
) -> None:
    with pytest.raises(ContractError, match=message):
        camkit.calibrate.distance(in_focus, LENS, words=replace(WORDS, **words))


def test_the_sharp_stop_must_be_stated() -> None:
    with pytest.raises(ContractError, match="give sharp_f_number or sharp_stop_radius_mm"):
        PairWords(focus_m=1.0, object_m=2.0)


def test_a_raw_file_is_sent_to_be_developed(tmp_path: Path, in_focus: list[Path]) -> None:
    write_tiny_captures(tmp_path, ["a"])
    raw = tmp_path / "a.dng"
    with pytest.raises(DecodeError, match=r'is a mosaic; give developed .* bundle="none"'):
        camkit.calibrate.distance([in_focus[0], raw], LENS, words=WORDS)


@pytest.mark.slow
def test_a_real_lens_is_predicted_better_than_by_a_disc() -> None:
    folder = data_path("real_lens")
    words = PairWords(
        focus_m=1.0,
        object_m=1.5,
        stop_radius_mm=3.65,
        sharp_stop_radius_mm=0.73,
        sensor="768x512@46.875um:planes",
        distance_from="vertex",
    )
    facts = camkit.calibrate.distance(
        [folder / "1500_f4_l.png", folder / "1500_f20_l.png"],
        folder / "rf50mm.zmx",
        words=words,
        tones=("srgb", CURVE),
        halves=("_l", "_r"),
    )
    assert facts.tone == CURVE.name
    assert facts.tones_db[CURVE.name] > facts.tones_db["srgb"] + 1
    assert 0.03 < facts.fit.best < 0.12
    assert _psnr_db(facts, "lens, from vertex", "moved") > _psnr_db(facts, "disc") + 0.2
    assert _psnr_db(facts, "disc") > _psnr_db(facts, "Gaussian") + 0.5
