"""A camera body is read from TOML, holds for its own bundle only, and says what is wrong."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle, open_bundle
from camkit.errors import ContractError
from camkit.runtime.options import Options, with_choices
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.unit import Unit, format_unit, lens_hash, read_unit
from camkit.scenes.squares import squares_scene
from tests.bundle_factory import write_tiny_bundle
from tests.focus_bundle import LENS, write_focus_bundle
from tests.job_factory import made_mosaic

HASH = "0123456789abcdef" * 4


def _written(folder: Path, text: str) -> Path:
    path = folder / "body 17.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_unit_is_what_its_file_says(tmp_path: Path) -> None:
    text = f'bundle_sha256 = "{HASH}"\nname = "my body"\n[facts]\nfocus_um = 12.5\nturns = 3\n'
    unit = read_unit(_written(tmp_path, text))
    assert unit == Unit(name="my body", bundle_sha256=HASH, facts={"focus_um": 12.5, "turns": 3.0})


def test_a_unit_without_a_name_has_that_of_its_file(tmp_path: Path) -> None:
    unit = read_unit(_written(tmp_path, f'bundle_sha256 = "{HASH}"\n'))
    assert (unit.name, dict(unit.facts)) == ("body 17", {})


def test_a_pipeline_takes_a_unit_or_its_file(tmp_path: Path) -> None:
    path = _written(tmp_path, 'name = "mine"\nbundle_sha256 = "' + HASH + '"\n')
    assert with_choices(Options(), {"unit": path}) == Options(unit=read_unit(path))
    assert with_choices(Options(), {"unit": str(path)}) == Options(unit=read_unit(path))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "one of bundle_sha256 and lens_sha256 must state where the body belongs; got none"),
        (f'bundle_sha256 = "{HASH}"\nlens_sha256 = "{HASH}"', "got bundle_sha256 and lens_sha256"),
        ("lens_sha256 = 3", "lens_sha256 must be the hash of a lens; got 3"),
        (f'lens_sha256 = "{HASH}"\nmeasured = 1', "measured must be a table"),
        (f'lens_sha256 = "{HASH}"\n[facts]\na = nan', r"facts\.a must be a number; got nan"),
        ('bundle_sha256 = "abc"', "must be the hash of a bundle"),
        (f'bundle_sha256 = "{HASH.upper()}"', "must be the hash of a bundle"),
        (f'bundle_sha256 = "{HASH}"\nlens = 1', r"unknown key\(s\) lens"),
        (f'bundle_sha256 = "{HASH}"\nname = 3', "name must be text"),
        (f'bundle_sha256 = "{HASH}"\nfacts = 3', "facts a table"),
        (f'bundle_sha256 = "{HASH}"\n[facts]\na = "b"', r"facts\.a must be a number; got 'b'"),
        (f'bundle_sha256 = "{HASH}"\n[facts]\na = true', r"facts\.a must be a number; got True"),
        (f'lens_sha256 = "{HASH}"\n[facts]\na = 1{"0" * 400}', r"facts\.a must be a number"),
        ("no toml at all", "is not valid TOML"),
    ],
)
def test_what_is_no_unit_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        read_unit(_written(tmp_path, text))


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="cannot read the camera body"):
        read_unit(tmp_path / "absent.toml")


def test_a_unit_of_another_bundle_is_refused_before_any_work(tmp_path: Path) -> None:
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    other = Unit(name="body", bundle_sha256=HASH)
    with pytest.raises(ContractError, match=rf"sha256 {HASH[:16]}, this is {bundle.sha256[:16]}"):
        Pipeline(bundle, Options(unit=other))
    own = Unit(name="body", bundle_sha256=bundle.sha256)
    work = Pipeline(bundle, Options(unit=own)).start(made_mosaic())
    assert work.origin.unit is own
    assert (work.origin.bundle, work.origin.bundle_sha256) == ("tiny", bundle.sha256)
    assert (work.origin.metadata.iso, work.origin.white_balance) == (100.0, work.white_balance)


def test_facts_that_no_stage_knows_are_refused_by_name(tmp_path: Path) -> None:
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    unit = Unit(name="body", bundle_sha256=bundle.sha256, facts={"focus_um": 2.0, "turns": 1.0})
    with pytest.raises(
        ContractError,
        match=r"states turns, which no stage of bundle tiny knows; .*known are: focus_um",
    ):
        Pipeline(bundle, Options(unit=unit))


def test_facts_that_a_stage_knows_are_taken_and_near_misses_suggested(tmp_path: Path) -> None:
    bundle = write_focus_bundle(tmp_path)
    own = Unit(name="body", bundle_sha256=bundle.sha256, facts={"focus_um": 2.0})
    assert Pipeline(bundle, Options(unit=own)).options.unit is own
    near = Unit(name="body", bundle_sha256=bundle.sha256, facts={"focus_mm": 2.0})
    with pytest.raises(ContractError, match=r"did you mean focus_um\? known are: focus_um"):
        Pipeline(bundle, Options(unit=near))


def test_a_unit_of_a_lens_holds_for_every_bundle_with_that_lens(tmp_path: Path) -> None:
    own = Unit(name="body", lens_sha256=lens_hash(LENS), facts={"focus_um": 2.0})
    own.check(write_focus_bundle(tmp_path))
    other = write_focus_bundle(tmp_path, "other", lens=b"another lens")
    with pytest.raises(ContractError, match=r"bundle other that of .*another camera's"):
        own.check(other)
    with pytest.raises(ContractError, match="does not state which lens it has"):
        own.check(write_focus_bundle(tmp_path, "unknown", lens=None))


def test_a_focus_needs_kernels_that_reach_it(tmp_path: Path) -> None:
    plain = write_focus_bundle(tmp_path, "plain", moved=False)
    for bundle, focus_um, message in (
        (plain, 2.0, "has the nominal focus alone, not that of the camera body"),
        (write_focus_bundle(tmp_path), 41.0, "reaches from a focus of -40 to 40 um; got 41 um"),
    ):
        unit = Unit(name="b", bundle_sha256=bundle.sha256, facts={"focus_um": focus_um})
        with pytest.raises(ContractError, match=message):
            Pipeline(bundle, Options(unit=unit))
    at_nominal = Unit(name="b", bundle_sha256=plain.sha256, facts={"focus_um": 0.0})
    Pipeline(plain, Options(unit=at_nominal))


def test_a_unit_says_one_hash() -> None:
    for hashes in ({}, {"bundle_sha256": HASH, "lens_sha256": HASH}):
        with pytest.raises(ContractError, match="of its bundle or that of its lens"):
            Unit(name="body", **hashes)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    measured = {"focus_um": -3.25, "standard_error_um": 0.5, "edges": 12}
    text = format_unit('body "1"', {"lens_sha256": HASH}, measured)
    unit = read_unit(_written(tmp_path, text))
    assert unit == Unit(name='body "1"', lens_sha256=HASH, facts={"focus_um": -3.25})
    assert tomllib.loads(text)["measured"] == {"standard_error_um": 0.5, "edges": 12}


def test_the_bank_takes_the_kernels_of_the_unit_and_says_so(tmp_path: Path) -> None:
    """Without a unit, or at the nominal focus, a bundle with more kernels gives the same bits."""
    moved = write_focus_bundle(tmp_path, "moved")
    plain = write_focus_bundle(tmp_path, "plain", moved=False)
    mosaic = squares_scene(1, 704, 704)[1, 300:460, 300:500]
    samples = np.round(64 + 900 * mosaic).astype(np.uint16)

    def restored(bundle: Bundle, focus_um: float | None) -> tuple[np.ndarray, dict[str, object]]:
        facts = {} if focus_um is None else {"focus_um": focus_um}
        unit = Unit(name="b", bundle_sha256=bundle.sha256, facts=facts)
        pipeline = Pipeline(bundle, Options(unit=unit, threads=1))
        capture = pipeline.capture_of(
            samples, iso=100, white_balance=(1.0, 1.0, 1.0), origin_px=(300, 300)
        )
        work = pipeline.start(capture)
        return work.fill(), work.job.log.record

    nominal, said = restored(plain, None)
    assert "focus_um" not in said
    for focus_um in (None, 0.0):
        np.testing.assert_array_equal(restored(moved, focus_um)[0], nominal)
    other, said = restored(moved, 25.0)
    assert said["focus_um"] == 25.0
    assert np.abs(other - nominal).max() > 0.01


def test_a_name_may_have_any_letters(tmp_path: Path) -> None:
    path = tmp_path / "unit.toml"
    path.write_text(
        format_unit('é \U0001f4f7 "x"', {"lens_sha256": HASH}, {"focus_um": 3.0}), encoding="utf-8"
    )
    assert read_unit(path).name == 'é \U0001f4f7 "x"'
