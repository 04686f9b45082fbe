"""The doors for programs: each does what its command does, and speaks of parameters."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import camkit
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.psf_file import write_psf
from camkit.calibration.record import to_toml
from camkit.cli.app import run
from camkit.export import assemble
from camkit.models_def.optics import freezer, optics_file
from camkit.models_def.training import trainer
from camkit.scenes import named_scene
from tests.bundle_factory import tiny_psf, write_tiny_bundle
from tests.camkit.calibration.lensfun.test_entry import GEOMETRY
from tests.camkit.calibration.point_factory import Point, write_pictures
from tests.camkit.calibration.sensor_factory import Sensor
from tests.decoded_here import decoded_here  # noqa: F401
from tests.lensfun_factory import ZOOM, write_database, write_shot
from tests.spad_bundle import write_spad_bundle

RECIPE = Path(__file__).resolve().parents[2] / "models_def" / "recipes" / "duet.toml"


@pytest.fixture(autouse=True)
def _current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str]) -> Callable[..., dict[str, Any]]:
    """What a command prints with --json."""

    def call(*words: object) -> dict[str, Any]:
        capsys.readouterr()
        code = run([*map(str, words), "--json"])
        out, err = capsys.readouterr()
        assert code == 0, err
        return dict(json.loads(out))

    return call


def test_a_simulated_capture_is_that_of_the_command(tmp_path: Path, printed) -> None:
    write_tiny_bundle(tmp_path)
    facts = printed(
        *("simulate", "night:3", "--bundle", "tiny.camkit", "-o", "c.dng", "--truth", "c.exr"),
        *("--size-px", "60,40", "--origin-px", "4,6", "--iso", 400, "--saturate", 0.03),
    )
    capture = camkit.simulate(
        *("night:3", "tiny.camkit", "p.dng"),
        truth="p.exr",
        size_px=(60, 40),
        origin_px=(4, 6),
        iso=400,
        saturate=0.03,
    )
    assert capture.to_json() == facts | {"path": "p.dng", "truth": "p.exr"}
    for suffix in (".dng", ".exr"):
        assert Path(f"p{suffix}").read_bytes() == Path(f"c{suffix}").read_bytes()
    assert (capture.samples.shape, capture.samples.dtype) == ((40, 60), np.uint16)
    assert capture.truth is not None
    assert capture.truth.shape == (3, 40, 60)


def test_a_scene_in_memory_is_photographed_and_nothing_is_written(tmp_path: Path) -> None:
    bundle = write_tiny_bundle(tmp_path)
    files = sorted(tmp_path.iterdir())
    capture = camkit.simulate(named_scene("procedural:3", 64, 96), bundle, seed=4)
    assert capture.facts["path"] is None
    drawn = camkit.simulate("procedural:3", bundle, seed=4)
    np.testing.assert_array_equal(capture.samples, drawn.samples)
    assert sorted(tmp_path.iterdir()) == files


def test_photons_are_counted_as_the_command_counts_them(tmp_path: Path, printed) -> None:
    bundle = write_spad_bundle(tmp_path).path
    words = ("procedural:3", "--bundle", bundle, "-o", "c.npz", "--photons", 400)
    facts = printed("simulate", *words)
    capture = camkit.simulate("procedural:3", bundle, "p.npz", photons=400)
    assert facts | {"path": "p.npz", "files": ["p.npz"]} == capture.facts | {"files": ["p.npz"]}
    assert capture.samples.sum(dtype="int64") == facts["counts"]
    with pytest.raises(camkit.ContractError, match=r"^iso, plate=False does not apply to bundle"):
        camkit.simulate("procedural:3", bundle, iso=100, plate=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"iso": "100"}, "iso must be a number; got '100'"),
        ({"origin_px": (1.5, 2)}, "origin_px must be"),
        ({"overwrite": 1}, "overwrite must be True or False"),
        ({"out": 3}, "out must be a text or a path"),
        ({"unit": 3}, "unit must be"),
        ({"bits": 7}, "bits takes 8 to 16; got 7"),
        ({"saturate": 0.1, "exposure": 2.0}, "saturate finds the exposure: leave exposure out"),
        ({"photons": 3.0}, "photons does not apply to bundle tiny.*use exposure and iso"),
        ({"size_px": (0, 4)}, "size_px takes two numbers >= 1"),
        ({"out": "tiny.camkit"}, "tiny.camkit exists; add overwrite=True or choose another name"),
    ],
)
def test_a_wrong_option_of_a_simulation_is_named_as_a_parameter(
    tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    write_tiny_bundle(tmp_path)
    with pytest.raises(camkit.ContractError, match=message):
        camkit.simulate("procedural:3", "tiny.camkit", **options)


def test_noise_is_measured_as_by_the_command(tmp_path: Path, printed) -> None:
    darks, flats = Sensor(np.random.default_rng(2), gain_e_per_dn=4.0, side=64).write(
        tmp_path, 100, (0.1, 0.6)
    )
    options = [w for name, files in (("--dark", darks), ("--flat", flats)) for f in files for w in (name, f)]  # noqa: E501 # fmt: skip
    record = printed("calibrate", "noise", *options, "-o", "c.toml", "--page", "c.html")
    facts = camkit.calibrate.noise(darks, flats, "p.toml", page="p.html")
    assert facts.to_record() | {"out": "c.toml", "page": "c.html"} == record
    for suffix in (".toml", ".html"):
        assert Path(f"p{suffix}").read_bytes() == Path(f"c{suffix}").read_bytes()
    with pytest.raises(camkit.ContractError, match=r"^iso must be > 0; got -1"):
        camkit.calibrate.noise(darks, flats, iso=-1)
    with pytest.raises(camkit.ContractError, match=r"darks must be several of: a text or a path"):
        camkit.calibrate.noise("a.dng", flats)


def test_vignetting_and_tone_are_measured_as_by_the_commands(tmp_path: Path, printed) -> None:
    y, x = np.mgrid[-60:60, -90:90] / 90
    fall = 1 - 0.3 * (x**2 + y**2)
    files = [tmp_path / f"{n}.png" for n in range(3)]
    for path, shift in zip(files, (0, 9, -9), strict=True):
        light = fall * (1 + 0.1 * np.sin(3 * (x - shift / 90)))
        cv2.imwrite(str(path), np.repeat(np.uint16(40_000 * light)[..., None], 3, axis=2))
    words = [w for shift in ("0,0", "9,0", "-9,0") for w in ("--shift-px", shift)]
    words += ["--pixel-pitch-um", "5"]
    record = printed("calibrate", "flat", *files, *words, "-o", "c.toml")
    shifts = [(0, 0), (9, 0), (-9, 0)]
    flat = camkit.calibrate.flat(files, "p.toml", shift_px=shifts, pixel_pitch_um=5)
    assert flat.to_record() | {"out": "c.toml"} == record
    assert Path("p.toml").read_bytes() == Path("c.toml").read_bytes()
    with pytest.raises(camkit.ContractError, match=r"^shift_px is given 1 times for 3 pictures"):
        camkit.calibrate.flat(files, shift_px=[(1, 2)])

    levels = (0, 128, 255)
    for path, level in zip(files, levels, strict=True):
        cv2.imwrite(str(path), np.full((60, 90, 3), 90 + 200 * level, np.uint16))
    record = printed("calibrate", "tone", *files, "--levels", "0,128,255", "-o", "ct.toml")
    assert camkit.calibrate.tone(files, levels).to_record() | {"out": "ct.toml"} == record
    with pytest.raises(camkit.ContractError, match=r"^levels states 2 levels for 3 pictures"):
        camkit.calibrate.tone(files, (0, 9))


def test_a_point_is_measured_as_by_the_command(tmp_path: Path, printed) -> None:
    times_s = (1.0, 1 / 8, 1 / 64)
    point = Point(side=96, x=47.7, y=46.2, reach=20, streak=1e-3)
    files = write_pictures(tmp_path, point, times_s=times_s)
    words = ("--times", "1,1/8,1/64", "--pixel-pitch-um", 4.2, "-o", "c.safetensors")
    record = printed("calibrate", "psf", *files, *words)
    facts = camkit.calibrate.psf(files, "p.safetensors", times_s=times_s, pixel_pitch_um=4.2)
    assert facts.to_record() | {"out": "c.safetensors"} == record
    assert Path("p.safetensors").read_bytes() == Path("c.safetensors").read_bytes()
    with pytest.raises(camkit.ContractError, match=r"use one of disc_px and edge"):
        camkit.calibrate.psf(files, disc_px=3.0, edge=True)


def test_targets_are_those_of_the_command(printed) -> None:
    words = ("--screen", "640x400", "--board", "7x5", "--levels", "0,255", "-o", "c")
    record = printed("calibrate", "targets", *words)
    plan = camkit.calibrate.targets((640, 400), "p", board=(7, 5), levels=(0, 255))
    assert plan.to_record() | {"out": "c"} == record
    names = [path.name for path in sorted(Path("c").iterdir())]
    assert names == [path.name for path in sorted(Path("p").iterdir())]
    assert all((Path("c") / n).read_bytes() == (Path("p") / n).read_bytes() for n in names)
    with pytest.raises(camkit.ContractError, match=r"p is not empty; add overwrite=True"):
        camkit.calibrate.targets("640x400", "p")


def test_lensfun_is_read_and_written_as_by_the_commands(tmp_path: Path, printed) -> None:
    shot, database = write_shot(tmp_path / "shot.dng"), write_database(tmp_path)
    (tmp_path / "c").mkdir()
    words = ("--lens", ZOOM, "--focal-mm", 24, "--capture", shot, "-o", "c/zoom.camkit")
    record = printed("calibrate", "lensfun-in", database, *words)
    profile = camkit.calibrate.lensfun_in(database, ZOOM, 24, shot, "zoom.camkit")
    assert profile.to_record() | {"out": "c/zoom.camkit"} == record
    assert Path("zoom.camkit").read_bytes() == Path("c/zoom.camkit").read_bytes()

    Path("g.toml").write_text(to_toml(GEOMETRY))
    words = ("--crop-factor", 1.5, "--focal-mm", 18, "-o", "c.xml")
    record = printed("calibrate", "lensfun-out", "g.toml", *words)
    entry = camkit.calibrate.lensfun_out("g.toml", "p.xml", crop_factor=1.5, focal_mm=18)
    assert entry.to_record() | {"out": "c.xml"} == record
    assert Path("p.xml").read_bytes() == Path("c.xml").read_bytes()


def test_a_bundle_takes_measurements_as_by_the_command(tmp_path: Path, printed) -> None:
    source = write_tiny_bundle(tmp_path)
    flat = {
        "heights_mm": [0.0, 0.2, 0.4],
        "relative_illumination": [1.0, 0.85, 0.7],
        "pixel_pitch_um": 6.0,
        "centre_px": [40.0, 33.0],
        "centre_found": True,
        "separated": True,
    }
    Path("flat.toml").write_text(to_toml(flat))
    (tmp_path / "c").mkdir()
    words = ("--flat", "flat.toml", "-o", "c/own.camkit")
    record = printed("calibrate", "bundle", source, *words)
    result = camkit.calibrate.bundle(source, "own.camkit", flat="flat.toml")
    assert result.to_record() | {"out": "c/own.camkit"} == record
    assert Path("own.camkit").read_bytes() == Path("c/own.camkit").read_bytes()
    with pytest.raises(camkit.ContractError, match=r"measured: geometry, flat, noise, psf$"):
        camkit.calibrate.bundle(source, "other.camkit")


def test_optics_are_frozen_as_by_the_command(printed, monkeypatch: pytest.MonkeyPatch) -> None:
    requests = []

    def fake(optics: object, **options: object) -> tuple[FrozenOptics, dict[str, int]]:
        requests.append((optics, options["grid"], options["limit_db"]))
        return FrozenOptics(psf=tiny_psf()), {"block_px": 512}

    monkeypatch.setattr(freezer, "freeze_samples", fake)
    monkeypatch.setattr(optics_file, "read_optics", lambda path, *_: path)
    words = ("--depths-mm", "500,inf", "--max-side-px", 201, "--report", "c.json")
    facts = printed("freeze", "lens.toml", "-o", "c.safetensors", *words)
    options = {"depths_mm": (500, float("inf")), "max_side_px": 201, "report": "p.json"}
    assert camkit.freeze("lens.toml", "p.safetensors", **options) == facts
    assert requests[0] == requests[1]
    for suffix in (".safetensors", ".json"):
        assert Path(f"p{suffix}").read_bytes() == Path(f"c{suffix}").read_bytes()
    with pytest.raises(camkit.ContractError, match=r"p.safetensors exists; add overwrite=True"):
        camkit.freeze("lens.toml", "p.safetensors")
    with pytest.raises(camkit.ContractError, match=r"^focus_um takes a number > 0 or auto"):
        camkit.freeze("lens.toml", "q.safetensors", focus_um=-3)
    with pytest.raises(camkit.ContractError, match=r"needs captures of a target"):
        camkit.calibrate.camera_body("duet.camkit", [], "u.toml")


def test_a_network_is_trained_as_by_the_command(printed, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def fake(recipe: Path, options: trainer.TrainOptions, **_: object) -> trainer.TrainResult:
        calls.append((recipe, options))
        return trainer.TrainResult(
            checkpoint=options.out_dir / "x.pt",
            log=options.out_dir / "x.jsonl",
            steps=3,
            elapsed_s=1.0,
            cpu_s=1.0,
            baselines={"capture": 20.0},
            valid_db=24.0,
        )

    monkeypatch.setattr(trainer, "train", fake)
    words = ("--size", "S", "--steps", 3, "--pairs", "pairs", "--out-dir", "out")
    facts = printed("train", RECIPE, *words)
    result = camkit.train(RECIPE, "out", size="S", steps=3, pairs="pairs")
    assert result.to_json() == facts
    assert calls[0] == calls[1]
    notes: list[str] = []
    losses = RECIPE.with_name("duet_losses.toml")
    camkit.train(losses, size="perceptual", on_note=notes.append)
    assert notes == ["no vgg FILE: features are those of random weights in place of VGG-19"]
    with pytest.raises(camkit.ContractError, match=r"^sharp is for a critic"):
        camkit.train(RECIPE, fine_tune="x.pt", sharp="many")
    with pytest.raises(camkit.ContractError, match=r"steps must be a whole number"):
        camkit.train(RECIPE, steps="3")  # type: ignore[arg-type]


def test_a_bundle_is_packed_as_by_the_command(
    tmp_path: Path, printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def fake(parts: object, out: Path) -> dict[str, str]:
        calls.append(parts)
        return {"bundle": str(out)}

    monkeypatch.setattr(assemble, "export_bundle", fake)
    write_psf(tmp_path / "psf.safetensors", tiny_psf())
    Path("plan.json").write_text("{}")
    facts = printed("export", "one.pt", "-o", "b.camkit", "--plate", "none")
    assert camkit.export.bundle("one.pt", "b.camkit", plate="none") == facts
    assert calls[0] == calls[1]
    assert calls[0].plan == Path("plan.json")


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("freeze", lambda: camkit.freeze("lens.toml", "psf.safetensors")),
        ("train", lambda: camkit.train("recipe.toml")),
        ("export", lambda: camkit.export.bundle("one.pt", "one.camkit")),
    ],
)
def test_without_torch_a_door_of_design_time_says_how_to_get_it(
    name: str, call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(camkit.UnsupportedError, match=rf"camkit\.{name} needs torch; install with"):
        call()


def test_every_measurement_has_a_door() -> None:
    assert all(callable(getattr(camkit.calibrate, name)) for name in dir(camkit.calibrate))
    with pytest.raises(AttributeError, match=r"has no attribute 'sharpness'"):
        _ = camkit.calibrate.sharpness  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match=r"has no attribute 'pack'"):
        _ = camkit.export.pack  # type: ignore[attr-defined]
