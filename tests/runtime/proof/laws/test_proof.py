"""Laws as a bundle states them, compared with what is measured."""

from typing import Any

import pytest

from camkit.bundle.facts import StatedLaw
from camkit.bundle.manifest import LIGHT_VERSION
from camkit.bundle.reader import open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import BundleError
from camkit.runtime.plan.bounded_networks import broken_laws
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.laws import proof
from camkit.runtime.proof.laws.law import Law
from tests.bundle_factory import tiny_manifest, tiny_members, write_tiny_bundle

GOOD = Law(name="double", worst=0.004, limit=0.01, unit="share")
BAD = Law(name="flat", worst=0.05, limit=0.01, unit="share", front=0.002, where="corner")


@pytest.fixture
def stated(tmp_path, monkeypatch):  # type: ignore[no-untyped-def]
    """Return a function that checks a bundle of stated laws; `GOOD` and `BAD` are measured."""

    def check(laws: dict[str, dict[str, StatedLaw]] | None, *found: Law) -> Any:
        monkeypatch.setattr(proof, "measure_laws", lambda *_, **__: {"M": found or (GOOD, BAD)})
        version = "2.4" if laws is None else ".".join(map(str, LIGHT_VERSION))
        path = tmp_path / "tiny.camkit"
        write_bundle(path, tiny_manifest(laws=laws, format_version=version), tiny_members())
        return check_bundle(path, "laws").layers[-1]

    return check


def test_a_law_that_is_broken_and_not_stated_fails(stated) -> None:  # type: ignore[no-untyped-def]
    layer = stated(None)
    assert layer.status == "fail"
    assert "M: flat 5.00 % (front end 0.20 %): BROKEN (at most 1.00 %, corner)" in layer.message
    assert [fact["kept"] for fact in layer.facts] == [True, False]


def test_a_law_that_is_broken_as_stated_passes_and_says_so(stated) -> None:  # type: ignore[no-untyped-def]
    layer = stated({"M": {"flat": BAD.to_stated()}})
    assert layer.status == "pass"
    assert "flat 5.00 % (front end 0.20 %): broken as stated" in layer.message


def test_a_law_that_is_broken_further_than_stated_fails(stated) -> None:  # type: ignore[no-untyped-def]
    milder = StatedLaw(worst=0.02, limit=0.01, unit="share", kept=False)
    assert stated({"M": {"flat": milder}}).status == "fail"
    kept = StatedLaw(worst=0.005, limit=0.01, unit="share", kept=True)
    assert stated({"M": {"flat": kept}}).status == "fail"


def test_laws_that_are_kept_pass_whatever_is_stated(stated) -> None:  # type: ignore[no-untyped-def]
    assert stated(None, GOOD).status == "pass"


def test_export_states_laws_and_raises_the_format() -> None:
    manifest = proof.with_laws(tiny_manifest(), {"M": (GOOD, BAD)})
    assert manifest.version_pair == LIGHT_VERSION
    assert broken_laws(manifest, ("M",)) == ("flat",)
    assert broken_laws(manifest, ("S",)) == ()
    same = tiny_manifest()
    assert proof.with_laws(same, "no network") is same


def test_laws_in_an_older_format_are_refused(tmp_path) -> None:  # type: ignore[no-untyped-def]
    manifest = tiny_manifest(laws={"M": {"double": GOOD.to_stated()}}, format_version="2.7")
    path = tmp_path / "old.camkit"
    with pytest.raises(BundleError, match=r"laws of a picture are stated, which format 2.8"):
        write_bundle(path, manifest, tiny_members())


def test_a_sensor_smaller_than_the_charts_is_not_judged(tmp_path) -> None:  # type: ignore[no-untyped-def]
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    assert proof.measure_laws(bundle) == "the sensor is smaller than the charts (640 px)"
