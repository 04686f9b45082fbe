from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError
from camkit.report.quality import Shot
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle
from tools.comparison.measurement import (
    Measurement,
    Row,
    append_measurements,
    by_capture,
    finished_rows,
    identity_of,
    latest,
    measure_all,
    open_rows,
    read_measurements,
)
from tools.comparison.photograph import Photograph, finish_planes, photograph


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


def make_measurement(**changes: object) -> Measurement:
    fields: dict[str, object] = {
        "psf": "fresh",
        "set_name": "set",
        "picture": "a.png",
        "position": 0,
        "height_mm": 0.1,
        "iso": 100.0,
        "seed": 2001,
        "method": "M",
        "psnr_db": 25.0,
        "ssim": 0.8,
        "seconds": 0.5,
        "megapixels": 0.25,
        "identity": "abc",
    }
    return Measurement(**(fields | changes))  # type: ignore[arg-type]


def make_shots(count: int) -> list[Shot]:
    return [
        Shot(
            set_name="set",
            picture=Path(f"{number}.png"),
            number=number,
            position=1,
            iso=100.0,
            psf="bundle",
        )
        for number in range(count)
    ]


def photographer(bundle: Bundle) -> Callable[[Shot], Photograph]:
    scene = decode_srgb(texture(96, 100))
    return lambda shot: photograph(shot, scene, bundle, bundle.frozen_optics)


def developer(bundle: Bundle) -> Callable[[Photograph], FloatArray]:
    return lambda taken: finish_planes(taken.local.planes, taken, bundle)


def test_a_journal_reads_back_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "new" / "run.jsonl"
    written = [make_measurement(), make_measurement(method="S", seed=None, psf="bundle")]
    append_measurements(path, written[:1])
    append_measurements(path, written[1:])
    assert read_measurements(path) == written


def test_a_journal_that_was_cut_off_loses_its_last_line_only(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    append_measurements(path, [make_measurement(), make_measurement(method="S")])
    path.write_text(path.read_text()[:-30])
    assert read_measurements(path) == [make_measurement()]


def test_a_journal_damaged_in_the_middle_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    append_measurements(path, [make_measurement()] * 2)
    path.write_text("{" + path.read_text())
    with pytest.raises(ContractError, match="line 1"):
        read_measurements(path)


def test_of_two_measurements_of_the_same_the_last_counts() -> None:
    first, again = make_measurement(psnr_db=20.0), make_measurement(psnr_db=21.0)
    others = [make_measurement(method="S"), make_measurement(psf="bundle")]
    assert latest([first, *others, again]) == [again, *others]


def test_a_capture_is_one_row_with_the_values_of_every_method() -> None:
    found = [make_measurement(), make_measurement(method="S", psnr_db=24.0)]
    other = make_measurement(picture="b.png", seed=None, method="S")
    assert by_capture([*found, other], ("S", "M")) == [
        ["fresh", "set", "a.png", 0, 0.1, 100.0, 2001, 0.25, [24.0, 0.8, 0.5], [25.0, 0.8, 0.5]],
        ["fresh", "set", "b.png", 0, 0.1, 100.0, None, 0.25, [25.0, 0.8, 0.5], None],
    ]


def test_only_rows_not_yet_measured_are_open() -> None:
    (shot,) = make_shots(1)
    rows = [Row(name=n, restore=lambda _: np.zeros(0), identity="x") for n in ("input", "M")]
    done = make_measurement(psf="bundle", picture="0.png", position=1, method="M", identity="x")
    assert [r.name for r in open_rows(shot, rows, finished_rows([done]))] == ["input"]
    other = finished_rows([replace(done, identity="older bundle")])
    assert [r.name for r in open_rows(shot, rows, other)] == ["input", "M"]
    assert open_rows(shot, rows, {}) == tuple(rows)


def test_measurements_do_not_depend_on_the_number_of_jobs(bundle: Bundle) -> None:
    row = Row(name="input", restore=developer(bundle), identity="x")
    work = [(shot, [row]) for shot in make_shots(3)]
    runs = [
        [
            replace(m, seconds=0.0)
            for found in measure_all(work, photographer(bundle), jobs=jobs)
            for m in found
        ]
        for jobs in (1, 2)
    ]
    assert runs[0] == runs[1]
    assert [m.picture for m in runs[0]] == ["0.png", "1.png", "2.png"]
    assert all(m.seed is None and 10 < m.psnr_db < 60 for m in runs[0])


def test_nothing_is_begun_after_the_time_limit(bundle: Bundle) -> None:
    row = Row(name="input", restore=developer(bundle), identity="x")
    work = [(shot, [row]) for shot in make_shots(3)]
    assert list(measure_all(work, photographer(bundle), limit_s=0.0)) == []


def test_an_identity_changes_with_every_part() -> None:
    assert identity_of("a", 1) == identity_of("a", 1)
    assert len({identity_of("a", 1), identity_of("a", 2), identity_of("b", 1)}) == 3
