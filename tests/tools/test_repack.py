"""A bundle of format 1.0 is written anew in 2.0: the same members, the same pictures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.golden import golden_from_bytes
from camkit.bundle.light_bound import LightBound
from camkit.bundle.manifest import planes_of
from camkit.bundle.optics import PSF
from camkit.bundle.psf_file import write_psf
from camkit.bundle.reader import GOLDEN, MANIFEST, open_bundle
from camkit.bundle.stages import Demosaic, Highlights, Network, SuperResolve, Undistort, Wiener
from camkit.errors import ContractError, ParityError
from camkit.export import proving
from camkit.runtime.proof.check import CheckReport, Layer
from tests.hdr_bundle import write_hdr_bundle
from tests.plain_bundle import write_networkless_bundle
from tools import repack

EXAMPLE = Path(__file__).resolve().parents[1] / "data" / "example-1.0.camkit"


def test_the_newest_format_is_written_and_nothing_is_lost(tmp_path: Path) -> None:
    new = tmp_path / "new.camkit"
    assert repack.repack(EXAMPLE, new) == new.stat().st_size
    before, after = open_bundle(EXAMPLE), open_bundle(new)
    assert after.manifest.format_version == "2.8"
    new_format = {"members": {}, "format_version": "2.8"}
    assert after.manifest.model_copy(update={"members": {}}) == before.manifest.model_copy(
        update=new_format
    )
    for name in set(before.names) - {GOLDEN, MANIFEST}:
        assert after.member(name) == before.member(name)
    old, found = (golden_from_bytes(bundle.member(GOLDEN)) for bundle in (before, after))
    assert old.keys() == found.keys()
    for name, case in old.items():
        np.testing.assert_array_equal(found[name].capture, case.capture)
        np.testing.assert_allclose(found[name].reference, case.reference, rtol=5e-4, atol=1e-6)
    again = tmp_path / "again.camkit"
    repack.repack(new, again)
    assert again.read_bytes() == new.read_bytes()


def test_what_fails_its_check_gets_no_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layer = Layer(name="golden", status="fail", message="another picture")
    failed = CheckReport(path=EXAMPLE, layers=(layer,))
    monkeypatch.setattr(proving, "check_bundle", lambda *_, **__: failed)
    with pytest.raises(ParityError, match=r"fails its own check: fail +golden +another picture"):
        repack.repack(EXAMPLE, tmp_path / "new.camkit")
    assert not list(tmp_path.iterdir())


def test_a_bound_on_light_brings_its_mask_and_new_golden_pictures(tmp_path: Path) -> None:
    new = tmp_path / "new.camkit"
    repack.repack(EXAMPLE, new, light_spread=1.0)
    before, after = open_bundle(EXAMPLE), open_bundle(new)
    (network,) = after.manifest.stages_of(Network)
    assert network.light == LightBound(spread=1.0, keeps_bright=True)
    bank = after.manifest.stage(Wiener)
    assert bank is not None
    assert network.takes[-1] == bank.takes[-1], "the mask of what clipped"
    assert after.manifest.version != before.manifest.version
    old, found = (golden_from_bytes(bundle.member(GOLDEN)) for bundle in (before, after))
    assert any(not np.array_equal(old[name].reference, found[name].reference) for name in old)


def test_undistortion_without_rings_is_stated_and_proved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new = tmp_path / "new.camkit"
    arguments = ["repack", str(EXAMPLE), "--limited", "-o", str(new)]
    monkeypatch.setattr("sys.argv", arguments)
    repack.main()
    before, after = (open_bundle(path).manifest for path in (EXAMPLE, new))
    stages = [m.stage(Undistort) for m in (before, after)]
    assert [stage.overshoot for stage in stages if stage is not None] == ["kept", "limited"]
    assert after.version != before.version


def test_the_same_lens_gets_a_psf_of_more_depths_and_keeps_its_networks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = open_bundle(EXAMPLE)
    old = before.psf
    deeper = replace(
        old,
        kernels=np.concatenate([np.roll(old.kernels, 1, axis=-1), old.kernels], axis=1),
        depths_mm=np.array([1000.0, *old.depths_mm]),
    )
    frozen, new = tmp_path / "psf.safetensors", tmp_path / "new.camkit"
    write_psf(frozen, deeper)
    arguments = ["repack", str(EXAMPLE), "--psf", str(frozen), "-o", str(new)]
    monkeypatch.setattr("sys.argv", arguments)
    repack.main()
    after = open_bundle(new)
    np.testing.assert_array_equal(after.psf.depths_mm, deeper.depths_mm)
    np.testing.assert_array_equal(after.psf.kernels, deeper.kernels)
    assert after.manifest.version != before.manifest.version
    for name in set(before.names) - {GOLDEN, MANIFEST, PSF}:
        assert after.member(name) == before.member(name)
    cases = [golden_from_bytes(bundle.member(GOLDEN)) for bundle in (before, after)]
    assert any(not np.array_equal(cases[0][n].reference, cases[1][n].reference) for n in cases[0])


def test_a_psf_of_another_lens_is_refused(tmp_path: Path) -> None:
    old = open_bundle(EXAMPLE).psf
    bent = replace(old.distortion, coefficients=old.distortion.coefficients * 1.01)
    frozen = tmp_path / "psf.safetensors"
    write_psf(frozen, replace(old, distortion=bent))
    with pytest.raises(ContractError, match="was frozen from another lens"):
        repack.repack(EXAMPLE, tmp_path / "new.camkit", psf=frozen)


def test_streaks_are_taken_from_the_mosaic_where_lights_are_sought(tmp_path: Path) -> None:
    """Colours that lights are put into are made as those that they are held against."""
    manifest = write_hdr_bundle(tmp_path).manifest
    made = repack._changed(manifest, repack._lights_from_samples(manifest))
    lights, colours = made.stage(Highlights), made.stage(Demosaic)
    assert lights is not None
    assert colours is not None
    assert lights.takes == ("rgb", "balanced")
    assert colours.method == lights.method == "quality"
    assert planes_of(made.stages, made.parts) == manifest.planes
    with pytest.raises(ContractError, match="seeks no lights in the colours of a mosaic"):
        repack._lights_from_samples(open_bundle(EXAMPLE).manifest)


def test_a_change_without_its_stage_or_its_proof_is_refused(tmp_path: Path) -> None:
    new = tmp_path / "new.camkit"
    with pytest.raises(ContractError, match="has no stage to change: superresolve"):
        repack.repack(EXAMPLE, new, changes=[(SuperResolve, {"floor": 0.1})])
    bare = write_networkless_bundle(tmp_path).path
    with pytest.raises(ContractError, match="has no golden cases"):
        repack.repack(bare, new, changes=repack.PORTABLE)
    assert not new.exists()
