"""Cards of bundles that were measured anew."""

from camkit.export.card import laws_text, with_laws_text
from camkit.runtime.proof.laws.law import SHARE, Law
from tests.bundle_factory import tiny_manifest

KEPT = Law(name="flat", worst=0.004, limit=0.01, unit=SHARE, front=0.02)
BROKEN = Law(name="white_below_half", worst=0.05, limit=0.02, unit=SHARE, where="lamps, corner")


def test_shares_are_per_cent_on_a_card() -> None:
    text = laws_text({"M": (KEPT, BROKEN)})
    assert "| M | flat | 0.40 % | 1.00 % | 2.00 % | kept |" in text
    assert "| M | white below half | 5.00 % | 2.00 % |  | BROKEN: lamps, corner |" in text


def test_new_laws_take_the_place_of_the_old_ones_and_the_version_is_named() -> None:
    before = "# tiny 0.1.0\n\nSensor.\n\n## Where it fails\n\nDepths.\n"
    manifest = tiny_manifest(version="0.2.0")
    once = with_laws_text(before + laws_text({"M": (BROKEN,)}), manifest, {"M": (KEPT,)})
    assert once == before.replace("0.1.0", "0.2.0") + laws_text({"M": (KEPT,)})
    assert with_laws_text(once, manifest, {"M": (KEPT,)}) == once
