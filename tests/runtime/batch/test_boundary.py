"""One file never ends a batch: whatever its task raises is that task's failure, in one line."""

from pathlib import Path

import numpy as np
import pytest

import camkit
from camkit.cli.app import run
from camkit.errors import ContractError
from camkit.runtime.batch import making
from tests.data_folder import data_path
from tests.dng_factory import write_scene

TIMING = '[timing]\norientation = "gate"\ntime_bin_ps = 20\n[gate]\nwidth_ps = 200\n'


def _captures(folder: Path) -> list[Path]:
    (folder / "t.toml").write_text(TIMING, encoding="utf-8")
    paths = [folder / name for name in ("a.npz", "b.npz")]
    for path in paths:
        np.savez(path, histogram=np.random.default_rng(0).poisson(1, (40, 4, 5)).astype(np.uint8))
    return paths


@pytest.mark.parametrize(
    "error", [RuntimeError, RecursionError, AssertionError, SyntaxError, KeyError]
)
def test_an_error_that_nobody_foresaw_fails_its_file_alone(
    error: type[Exception], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = _captures(tmp_path)
    sound = making.make_file

    def broken(source: Path, *given: object, **named: object) -> object:
        if source == first:
            raise error("bad\x1b[31m\nlines")
        return sound(source, *given, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(making, "make_file", broken)
    found = camkit.process(
        [first, second], bundle="none", out_dir=tmp_path / "out", timing=tmp_path / "t.toml"
    )
    assert [one.status for one in found] == ["failed", "ok"]
    assert f"unexpected {error.__name__}" in str(found[0].error)
    assert "\n" not in str(found[0].error)
    assert "\x1b" not in str(found[0].error)


def test_tracebacks_of_debug_steer_no_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    first, _ = _captures(tmp_path)

    def broken(*_: object, **__: object) -> object:
        raise RuntimeError("bad\x1b[31m")

    monkeypatch.setattr(making, "make_file", broken)
    words = ["process", first, "--bundle", "none", "--timing", tmp_path / "t.toml"]
    assert run([*map(str, words), "--out-dir", str(tmp_path / "out"), "--debug"]) == 1
    told = capsys.readouterr().err
    assert "Traceback" in told
    assert "\x1b" not in told


def test_a_damaged_header_fails_its_file_alone(tmp_path: Path) -> None:
    (_, sound), out = _captures(tmp_path), tmp_path / "out"
    broken = data_path("reports/broken_header.npz")
    found = camkit.process([broken, sound], bundle="none", out_dir=out, timing=tmp_path / "t.toml")
    assert [one.status for one in found] == ["failed", "ok"]
    assert "its header is damaged" in str(found[0].error)


@pytest.mark.parametrize("choice", [{"format": "png"}, {"preview": True}])
def test_what_cannot_be_written_as_asked_fails_alone(
    tmp_path: Path, choice: dict[str, object]
) -> None:
    counted, *_ = _captures(tmp_path)
    photograph = tmp_path / "photograph.dng"
    write_scene(photograph)
    out = tmp_path / "out"
    counted.with_name("a.npz.toml").write_text(TIMING, encoding="utf-8")
    found = camkit.process([counted, photograph], bundle="none", out_dir=out, **choice)  # type: ignore[arg-type]
    assert [one.status for one in found] == ["failed", "ok"]
    assert next(iter(choice)) in str(found[0].error)
    with pytest.raises(ContractError, match=next(iter(choice))):
        camkit.process(counted, bundle="none", out_dir=out, **choice)  # type: ignore[arg-type]
