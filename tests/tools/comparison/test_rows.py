import dataclasses
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Wiener
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError
from camkit.report.quality import Shot
from tests.bundle_factory import write_tiny_bundle
from tests.deep_bundle import write_deep_bundle
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle
from tools.comparison.photograph import photograph
from tools.comparison.rows import Rival, make_rows, protocol_text
from tools.comparison.tuning import Tuned

TUNED: Tuned = {
    "skimage_wiener": {100.0: (0.01,)},
    "skimage_rl": {100.0: (4.0,)},
    "admm_tv": {100.0: (1.0, 4.0)},
    "cross_channel": {100.0: (1.0, 2.0)},
}
METHODS = (
    *("input", "skimage_wiener", "skimage_rl", "admm_tv", "cross_channel"),
    *("bank", "bank_rl", "M"),
)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


def test_every_row_restores_a_capture_and_no_two_alike(bundle: Bundle) -> None:
    shot = Shot(set_name="s", picture=Path("a"), number=0, position=1, iso=100.0, psf="bundle")
    taken = photograph(shot, decode_srgb(texture(90, 96)), bundle, bundle.frozen_optics)
    rows = make_rows(bundle, METHODS, [], TUNED, [100.0], "lens")
    pictures = [row.restore(taken) for row in rows]
    assert {p.shape for p in pictures} == {(3, 90, 96)}
    assert all(np.isfinite(p).all() for p in pictures)
    assert len({p.tobytes() for p in pictures}) == len(rows)


def test_identities_follow_lens_and_parameters(bundle: Bundle) -> None:
    def identities(tuned: Tuned, lens: str) -> list[str]:
        return [r.identity for r in make_rows(bundle, METHODS, [], tuned, [100.0], lens)]

    first = identities(TUNED, "lens")
    assert len(set(first)) == len(METHODS)
    second = identities(TUNED | {"admm_tv": {100.0: (2.0, 4.0)}}, "lens")
    assert [a == b for a, b in zip(first, second, strict=True)] == [
        name != "admm_tv" for name in METHODS
    ]
    assert not set(first) & set(identities(TUNED, "another lens"))


def with_other_network(bundle: Bundle) -> Bundle:
    """The same camera, PSF and stages, with the network M trained anew."""
    manifest = bundle.manifest
    name = bundle.network_facts(DEFAULT_ROLE, "M").member
    member = manifest.members[name].model_copy(update={"sha256": "0" * 64})
    members = manifest.members | {name: member}
    return dataclasses.replace(bundle, manifest=manifest.model_copy(update={"members": members}))


def with_other_wiener(bundle: Bundle) -> Bundle:
    stages = [
        stage.model_copy(update={"prior_scale": 2 * stage.prior_scale})
        if isinstance(stage, Wiener)
        else stage
        for stage in bundle.manifest.stages
    ]
    manifest = bundle.manifest.model_copy(update={"stages": stages})
    return dataclasses.replace(bundle, manifest=manifest)


def test_a_new_network_changes_the_identity_of_its_own_row_only(bundle: Bundle) -> None:
    def changed(other: Bundle) -> list[str]:
        old, new = (make_rows(b, METHODS, [], TUNED, [100.0], "lens") for b in (bundle, other))
        return [a.name for a, b in zip(old, new, strict=True) if a.identity != b.identity]

    assert changed(with_other_network(bundle)) == ["M"]
    assert changed(with_other_wiener(bundle)) == ["bank", "bank_rl", "M"]


def test_a_rival_with_the_same_members_has_the_identity_of_its_size(bundle: Bundle) -> None:
    rows = make_rows(bundle, ["M"], [Rival(bundle=bundle, label="twin")], {}, [100.0], "lens")
    assert [row.name for row in rows] == ["M", "twin"]
    assert rows[0].identity == rows[1].identity


def test_a_rival_of_another_camera_is_refused(bundle: Bundle, tmp_path: Path) -> None:
    rival = Rival(bundle=open_bundle(write_tiny_bundle(tmp_path)), label="other")
    with pytest.raises(ContractError, match="another camera"):
        make_rows(bundle, ["M"], [rival], {}, [100.0], "lens")


def test_a_rival_without_a_clear_size_is_refused(bundle: Bundle) -> None:
    facts = bundle.network_facts(DEFAULT_ROLE, "M")
    networks = {DEFAULT_ROLE: {"S": facts, "L": facts}}
    manifest = bundle.manifest.model_copy(update={"networks": networks})
    two = dataclasses.replace(bundle, manifest=manifest)
    with pytest.raises(ContractError, match="one size only"):
        _ = Rival(bundle=two, label="two").size
    only = bundle.manifest.model_copy(update={"networks": {DEFAULT_ROLE: {"S": facts}}})
    assert Rival(bundle=dataclasses.replace(bundle, manifest=only), label="one").size == "S"


@pytest.mark.parametrize(
    ("methods", "message"), [(["skimage_rl"], "not tuned"), (["magic"], "methods are")]
)
def test_rows_that_cannot_be_made_say_what_to_do(
    bundle: Bundle, methods: list[str], message: str
) -> None:
    with pytest.raises(ContractError, match=message):
        make_rows(bundle, methods, [], {}, [100.0], "lens")


def test_the_protocol_names_grids_and_seeds(bundle: Bundle, tmp_path: Path) -> None:
    text = "\n".join(protocol_text(bundle, [100.0, 1600.0]))
    assert "Pictures lie at" not in text
    deep = write_deep_bundle(tmp_path)
    assert protocol_text(deep, [100.0])[0].startswith("Pictures lie at 1 m;")
    assert "3 field heights and 7 wavelengths" in text
    assert "2001, 2002, 2003" in text


def test_the_bundle_as_it_was_has_rows_of_its_own(bundle: Bundle) -> None:
    rows = make_rows(bundle, METHODS, [], TUNED, [100.0], "lens", with_other_wiener(bundle))
    names = [row.name for row in rows]
    assert names == [*METHODS, "bank before", "bank_rl before", "M before"]
    assert len({row.identity for row in rows}) == len(rows)
