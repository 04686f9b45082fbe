"""A type checker refuses of a foreign program what run time refuses, and the reverse."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import OpenEXR
import pytest

import camkit
from camkit.bundle.stages import Color, Linearise
from camkit.cli.app import run
from camkit.field_types import check_value
from camkit.kinds import KINDS
from camkit.runtime.face.keywords import KindKeywords, LoadKeywords, ProcessKeywords
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.options import Options
from camkit.runtime.signal.tone_curve import Tone
from camkit.runtime.unit import Unit
from camkit.runtime.write_options import WriteOptions
from tests.bundle_factory import write_tiny_bundle
from tests.capture_factory import write_tiny_captures
from tests.glare_bundle import write_glare_bundle
from tests.hdr_bundle import write_hdr_bundle
from tests.planes_bundle import planes_sensor, write_planes_bundle
from tests.spad_bundle import write_spad_bundle

ROOT = Path(__file__).resolve().parents[2]

FOREIGN = """\
from pathlib import Path

import camkit


def develop(files: list[Path], out_dir: Path) -> list[str]:
    pipeline: camkit.Pipeline = camkit.load("duet", size="M", on_unsafe="warn", strength=0.5)
    plan = pipeline.plan(files[0], mosaic=camkit.MosaicOptions(white_level=4095.0))
    lines = [f"{len(plan['decisions'])} decisions"]
    try:
        for result in camkit.process(files, bundle="duet", out_dir=out_dir, jobs=2, preview=True):
            lines.append(f"{result.input}: {result.status} {sum(result.seconds.values()):.1f} s")
    except camkit.ContractError as error:
        lines.append(str(error))
    with camkit.WorkerPool("duet", size="S") as pool:
        job = pool.submit(files[0], out_dir / "a.jpg", cancel=lambda: False, overwrite=True)
        lines += job.result().warnings
    picture = pipeline.process(files[0])
    return [*lines, *picture.warnings, f"{picture.image.dtype} {picture.image.shape}"]


if __name__ == "__main__":
    print("\\\\n".join(develop([Path("a.dng")], Path("out"))))
"""
WRONG: dict[str, dict[str, Any]] = {
    "a name that is none": {"sizes": "M"},
    "a number for a text": {"size": 3},
    "a text for a number": {"threads": "4"},
    "a word that is none": {"on_unsafe": "ignore"},
    "a text for a truth value": {"vignetting": "no"},
    "a fraction for a whole number": {"max_mem_bytes": 9e8},
    "two gains": {"white_balance": (2.0, 1.0)},
    "texts for gains": {"white_balance": ("2", "1", "2")},
    "a fraction of a pixel": {"origin_px": (1.5, 2)},
    "a number for a body": {"unit": 3},
    "None where nothing is no choice": {"strength": None},
    "what only the inside sets": {"of_kind": ()},
    "a number for a file": {"timing": 3},
    "a pool that is none": {"pool": 4},
}
"""Choices that no program may make, of `load` and `process` alike."""
WRONG_TO_WRITE: dict[str, dict[str, Any]] = {
    "a format that is none": {"format": "bmp"},
    "a number for a folder": {"out_dir": 3},
    "a text for a number": {"jobs": "2"},
    "a number for a truth value": {"overwrite": 1},
    "a fraction for a quality": {"jpeg_quality": 92.5},
}


# the face names types of camkit, numpy and the standard library alone: torch stays unread
SETTINGS = """\
[mypy]
strict = true
follow_imports = skip
[mypy-camkit,camkit.*,numpy.*]
follow_imports = silent
[mypy-scipy.*,cv2.*,h5py.*,onnx.*]
follow_imports_for_stubs = true
"""


def _check(folder: Path, program: str) -> tuple[int, str]:
    """Return exit code and output of a strict type checker that sees camkit as a library."""
    (folder / "program.py").write_text(program)
    (folder / "settings.ini").write_text(SETTINGS)
    done = subprocess.run(
        [
            *(sys.executable, "-m", "mypy", "--config-file", "settings.ini"),
            *("--cache-dir", str(ROOT / ".mypy_cache" / "foreign"), "program.py"),
        ],
        cwd=folder,
        env={"MYPYPATH": str(ROOT), "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def test_a_foreign_program_passes_a_strict_type_checker_and_wrong_ones_do_not(
    tmp_path: Path,
) -> None:
    code, told = _check(tmp_path, FOREIGN)
    assert code == 0, told
    lines = [f"camkit.load(None, **{{}}, {_call(choices)})" for choices in WRONG.values()]
    writes = WRONG | WRONG_TO_WRITE
    lines += [f"camkit.process([], {_call(choices)})" for choices in writes.values()]
    lines += ["camkit.load(3)", "camkit.process(3)", "camkit.load(None).plan(3)"]
    lines += [
        "camkit.WorkerPool(None, sizes=1)",
        "camkit.WorkerPool(None).submit('a', 'b', jobs=2)",
    ]
    _, told = _check(tmp_path, "import camkit\n" + "\n".join(lines).replace("**{}, ", "") + "\n")
    for number, line in enumerate(lines, 2):
        assert f"program.py:{number}: error" in told, f"{line}\n{told}"


def _call(choices: dict[str, Any]) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in choices.items())


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_choice_is_a_contract_error(case: str, tmp_path: Path) -> None:
    bundle = write_tiny_bundle(tmp_path)
    with pytest.raises(camkit.ContractError, match=next(iter(WRONG[case]))):
        camkit.load(bundle, **WRONG[case])
    with pytest.raises(camkit.ContractError):
        camkit.process(tmp_path, bundle=bundle, **WRONG[case])


@pytest.mark.parametrize("case", WRONG_TO_WRITE)
def test_a_wrong_choice_of_writing_is_a_contract_error(case: str, tmp_path: Path) -> None:
    with pytest.raises(camkit.ContractError, match=next(iter(WRONG_TO_WRITE[case]))):
        camkit.process(tmp_path, bundle="none", **WRONG_TO_WRITE[case])


@pytest.mark.parametrize(
    "call",
    [
        lambda: camkit.load(3),  # type: ignore[arg-type]
        lambda: camkit.load(None, kind=3),  # type: ignore[arg-type]
        lambda: camkit.load(None, options={"size": "M"}),  # type: ignore[arg-type]
        lambda: camkit.process(3),  # type: ignore[arg-type]
        lambda: camkit.process([3]),  # type: ignore[list-item]
        lambda: camkit.process([], bundle=3),  # type: ignore[arg-type]
        lambda: camkit.process([], write={"jobs": 2}),  # type: ignore[arg-type]
        lambda: camkit.process([], options="fast"),  # type: ignore[arg-type]
        lambda: camkit.process([], mosaic="RGGB"),  # type: ignore[arg-type]
        lambda: camkit.MosaicOptions(white_level="4095"),  # type: ignore[arg-type]
        lambda: camkit.load(None).plan(3),  # type: ignore[arg-type]
        lambda: camkit.load(None).plan("a.dng", mosaic="RGGB"),  # type: ignore[arg-type]
        lambda: camkit.load(None).plan("a.dng", mosaic={"cfa": "RGGB"}),  # type: ignore[arg-type]
        lambda: camkit.load(None).process("a.dng", mosaic="RGGB"),  # type: ignore[arg-type]
        lambda: camkit.load(None, tile_px=0),
        lambda: camkit.load(None, tile_px=-64),
    ],
)
def test_a_wrong_argument_is_a_contract_error(call: Any) -> None:
    with pytest.raises(camkit.ContractError):
        call()


def test_the_keywords_are_the_fields_of_the_options_and_of_the_kinds() -> None:
    options, write = get_type_hints(Options), get_type_hints(WriteOptions)
    of_kinds = {option.name: option for kind in KINDS.values() for option in kind.options}
    kinds, load, process = map(get_type_hints, (KindKeywords, LoadKeywords, ProcessKeywords))
    assert set(kinds) == set(of_kinds)
    del options["of_kind"]
    assert load == options | kinds | {
        "unit": Unit | FilePath | None,
        "tone": Tone | FilePath | None,
    }
    out_dir = process.pop("out_dir")
    assert process == load | {name: kind for name, kind in write.items() if name != "out_dir"}
    check_value("out_dir", "pictures", out_dir)
    check_value("out_dir", write["out_dir"](), out_dir)
    for name, option in of_kinds.items():
        words = {str(word) for part in get_args(kinds[name]) for word in get_args(part)}
        assert words == set(option.choices) or option.is_file


@pytest.mark.parametrize(
    "choices",
    [
        {"threads": np.int64(1), "strength": np.float32(0.5), "exposure_ev": 1},
        {"white_balance": [2, 1.0, np.float64(2)], "origin_px": [np.int32(2), 4]},
        {"vignetting": np.bool_(0), "depth_m": float("inf")},
    ],
)
def test_numbers_of_any_library_are_numbers(choices: dict[str, Any], tmp_path: Path) -> None:
    camkit.load(write_tiny_bundle(tmp_path), **choices)


def _captures(folder: Path) -> dict[str, tuple[Path | None, Path]]:
    """Return a bundle and a capture of each kind of camera and of each way to make its picture."""
    tiny = write_tiny_captures(folder, ["a"])
    found: dict[str, tuple[Path | None, Path]] = {
        "bayer": (tiny, folder / "a.dng"),
        "none": (None, folder / "a.dng"),
    }
    hdr = write_hdr_bundle(folder)
    hdr_path = hdr if isinstance(hdr, Path) else hdr.path
    found["hdr"] = hdr_path, _simulated(hdr_path, folder / "hdr.dng")
    spad = write_spad_bundle(folder)
    found["spad"] = spad.path, _simulated(spad.path, folder / "spad.npz", "--photons", "400")
    stages = (Linearise(gives=("light",)), Color(takes=("light",)))
    planes = write_planes_bundle(folder, stages, sensor=planes_sensor(("R", "G", "B")))
    light = np.full((64, 96, 3), 0.25, dtype=np.float32)
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": light}) as file:
        file.write(str(folder / "planes.exr"))
    found["planes"] = planes.path, folder / "planes.exr"
    found["deglare"] = write_glare_bundle(folder), folder / "planes.exr"
    return found


def _simulated(bundle: Path, out: Path, *options: str) -> Path:
    command = ["simulate", "procedural:3", "--bundle", str(bundle), "-o", str(out), *options]
    assert run(command) == 0
    return out


def test_every_kind_of_camera_plans_what_it_would_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, (bundle, capture) in _captures(tmp_path).items():
        plan = camkit.load(bundle).plan(capture)
        assert set(plan) == {"size", "decisions", "estimate", "plan", "warnings"}, name
        json.dumps(plan)
        capsys.readouterr()
        named = "none" if bundle is None else str(bundle)
        assert run(["plan", str(capture), "--bundle", named, "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert set(plan) < set(told), name
        assert (told["size"], told["warnings"]) == (plan["size"], plan["warnings"]), name
        assert [d["what"] for d in told["decisions"]] == [d["what"] for d in plan["decisions"]]


def test_a_plan_takes_captures_in_memory_and_what_is_said_of_them(tmp_path: Path) -> None:
    bundle = write_tiny_captures(tmp_path, ["a"])
    pipeline = camkit.load(bundle)
    data = (tmp_path / "a.dng").read_bytes()
    assert pipeline.plan(data)["size"] == pipeline.plan(tmp_path / "a.dng")["size"]
    mosaic = np.full((64, 96), 300, np.uint16)
    assert pipeline.plan(mosaic)["size"] == "M"
    with pytest.raises(camkit.ContractError, match="mosaic must be None"):
        pipeline.plan(mosaic, mosaic=camkit.MosaicOptions(white_level=520.0))
    with pytest.raises(camkit.DecodeError, match="white_level"):
        pipeline.plan(data, mosaic=camkit.MosaicOptions(white_level=520.0))
    with pytest.raises(camkit.Cancelled):
        pipeline.plan(data, cancel=lambda: True)


def test_what_means_nothing_to_captures_that_are_no_mosaics_is_refused(tmp_path: Path) -> None:
    pipeline = camkit.load(write_spad_bundle(tmp_path).path)
    with pytest.raises(
        camkit.ContractError, match="origin_px does not apply to captures of the ki"
    ):
        pipeline.plan(b"", origin_px=(1, 2))
