"""What a bundle of photons lists is what runs: leave a stage out, or swap two, and the bits change.

The bundle is the built-in one, repacked.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.stages import JoinError, Parts, Sharpen, StageEntry, SuperResolve
from camkit.bundle.writer import write_bundle
from camkit.errors import BundleError, ContractError
from camkit.runtime.capture_result import Result
from camkit.runtime.kinds.spad.golden_captures import GOLDEN
from camkit.runtime.kinds.spad.twin.photon_twin import record
from camkit.runtime.kinds.spad.twin.recording import PhotonOptions
from camkit.runtime.kinds.spad.twin.write import write_recorded
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.scenes import procedural_scene

TIMING = """
[timing]
cycles = {cycles}
[correction]
dark = {dark}
hot = "hot.npy"
"""


@pytest.fixture(scope="module")
def real() -> Bundle:
    return open_bundle(find_bundle("spad-sr"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, real: Bundle) -> Path:
    """Give a folder with a picture, a scan, and what is known of their dark counts and cycles."""
    folder = tmp_path_factory.mktemp("law")
    picture = record(procedural_scene(5, 128, 256), real, PhotonOptions(photons=400, seed=1))
    write_recorded(folder / "picture.npz", picture)
    scan = GOLDEN.cases(real)["scan"][1].capture
    np.savez(folder / "scan.npz", histogram=scan)
    hot = np.zeros((32, 64), bool)
    hot[7, 9] = True
    np.save(folder / "hot.npy", hot)
    for name, counts in (("picture", picture.values), ("scan", scan.sum(axis=0))):
        text = TIMING.format(cycles=int(counts.max()) + 40, dark=0.2)
        (folder / f"{name}.npz.toml").write_text(text, encoding="utf-8")
    return folder


def _without_networks(stages: tuple[StageEntry, ...]) -> bool:
    return not any(isinstance(stage, SuperResolve) for stage in stages)


def _repacked(real: Bundle, folder: Path, stages: tuple[StageEntry, ...]) -> Bundle:
    """Give the bundle with other stages; products are what comes last of each domain."""
    manifest = real.manifest
    networks = {} if _without_networks(stages) else manifest.networks
    parts = Parts(sensor=manifest.sensor, optics=manifest.optics, networks=networks)
    planes = planes_of(stages, parts)
    products = {
        "depth_m" if plane.domain == "depth" else "image": name for name, plane in planes.items()
    }
    members = {name: real.member(name) for name in real.names}
    if not networks:
        members = {n: data for n, data in members.items() if not n.endswith(".onnx")}
    del members["golden.safetensors"]
    changed = {
        "stages": stages,
        "planes": planes,
        "products": products,
        "networks": networks,
        "golden": (),
        "laws": None,
    }
    path = folder / f"{len(list(folder.glob('*.camkit')))}.camkit"
    write_bundle(path, Manifest.model_validate({**dict(manifest), **changed}), members)
    return open_bundle(path)


def _wired(stages: tuple[StageEntry, ...]) -> tuple[StageEntry, ...]:
    """Give stages that each take what the one before gives."""
    taken, wired = "capture", []
    for stage in stages:
        wired.append(stage.model_copy(update={"takes": (taken,)}))
        taken = stage.gives[0]
    return tuple(wired)


def _made(bundle: Bundle, capture: Path, **choices: Any) -> Result:
    return Pipeline(bundle, Options(**choices)).run(capture)


@pytest.fixture(scope="module")
def made_usually(real: Bundle, folder: Path) -> Callable[..., Result]:
    """Return what makes the bundle's own picture of a capture, once for all tests."""

    @cache
    def made(name: str, **choices: Any) -> Result:
        return _made(real, folder / name, **choices)

    return made


def _main(result: Result) -> np.ndarray:
    name = "time_of_flight_ps" if "depth_m" in result.arrays else "intensity"
    return np.asarray(result.arrays[name])


CAPTURES = ("picture.npz", "scan.npz")


@pytest.mark.parametrize("name", CAPTURES)
def test_the_same_stages_packed_anew_give_the_same_bits(
    real: Bundle, folder: Path, made_usually: Callable[..., Result], tmp_path: Path, name: str
) -> None:
    again = _repacked(real, tmp_path, _wired(real.manifest.stages))
    found = _main(_made(again, folder / name))
    np.testing.assert_array_equal(found, _main(made_usually(name)))


@pytest.mark.parametrize("name", CAPTURES)
def test_without_correct_nothing_is_undone(
    real: Bundle, folder: Path, made_usually: Callable[..., Result], tmp_path: Path, name: str
) -> None:
    bare = _repacked(real, tmp_path, _wired(real.manifest.stages[1:]))
    usual, found = made_usually(name), _made(bare, folder / name)
    assert (_main(usual) != _main(found)).mean() > 0.5
    background = "background" if name == "scan.npz" else "intensity"
    # dark counts stay in, the hot pixel is not painted over, no pile-up is found
    assert found.arrays[background].mean() > usual.arrays[background].mean() or (
        name == "picture.npz"
    )
    assert found.sections["spad"].get("pile_up", 0.0) == 0.0


def test_without_correct_dark_counts_are_photons(
    real: Bundle, folder: Path, tmp_path: Path
) -> None:
    """Counts alone, without cycles: what is left is what was counted."""
    bare = _repacked(real, tmp_path, _wired(real.manifest.stages[1:]))
    counts = np.load(folder / "picture.npz")["counts"]
    np.savez(tmp_path / "one.npz", counts=counts)
    (tmp_path / "t.toml").write_text("[correction]\ndark = 40\n", encoding="utf-8")
    of_kind = (("timing", str(tmp_path / "t.toml")),)
    usual, found = (
        _main(_made(bundle, tmp_path / "one.npz", method="linear", of_kind=of_kind))
        for bundle in (real, bare)
    )
    assert found.mean() == pytest.approx(counts.mean(), rel=0.02)
    assert usual.mean() < found.mean() - 20


def test_without_sharpen_there_is_no_depth(real: Bundle, folder: Path, tmp_path: Path) -> None:
    flat = _repacked(real, tmp_path, real.manifest.stages[:2])
    with pytest.raises(ContractError, match=r"spad-sr gives no depth: its products are image"):
        _made(flat, folder / "scan.npz")
    usual, found = (_main(_made(bundle, folder / "picture.npz")) for bundle in (real, flat))
    np.testing.assert_array_equal(usual, found)


@pytest.mark.parametrize("name", CAPTURES)
def test_without_super_resolve_pixels_are_those_of_the_array(
    real: Bundle, folder: Path, made_usually: Callable[..., Result], tmp_path: Path, name: str
) -> None:
    correct, _, sharpen = real.manifest.stages
    coarse = _repacked(real, tmp_path, _wired((correct, sharpen)))
    assert _main(made_usually(name)).shape == (128, 256)
    assert _main(_made(coarse, folder / name)).shape == (32, 64)
    with pytest.raises(ContractError, match="method must be one of log, lsq to bundle"):
        _made(coarse, folder / name, method="net")


@pytest.mark.parametrize("order", [(1, 0, 2), (0, 2, 1), (2, 1, 0)])
def test_swapped_stages_are_refused_naming_both_ends(
    real: Bundle, tmp_path: Path, order: tuple[int, ...]
) -> None:
    stages = tuple(real.manifest.stages[number] for number in order)
    for listed in (stages, _wired(stages)):
        with pytest.raises((BundleError, JoinError, ValueError), match=r"stage \d"):
            _repacked(real, tmp_path, listed)


NUMBERS: dict[str, tuple[type[StageEntry], dict[str, Any], str, dict[str, Any]]] = {
    "contrast": (SuperResolve, {"contrast": 0.1}, "picture.npz", {"method": "linear"}),
    "reach": (SuperResolve, {"reach": 12.0}, "picture.npz", {"method": "linear"}),
    "exponent": (SuperResolve, {"exponent": 1.5}, "picture.npz", {"method": "linear"}),
    "floor": (SuperResolve, {"floor": 1.0}, "picture.npz", {"method": "linear"}),
    "sampling": (SuperResolve, {"sampling": "low_fill"}, "picture.npz", {"method": "linear"}),
    "network_from_photons": (SuperResolve, {"network_from_photons": 1e6}, "scan.npz", {}),
    "first_ps": (Sharpen, {"first_ps": 100.0}, "scan.npz", {}),
    "gate_width_ps": (Sharpen, {"gate_width_ps": 300.0}, "scan.npz", {}),
    "laser_fwhm_ps": (Sharpen, {"laser_fwhm_ps": 150.0}, "scan.npz", {}),
    "orientation": (Sharpen, {"orientation": "histogram"}, "scan.npz", {}),
}


@pytest.mark.parametrize("number", NUMBERS)
def test_another_number_in_an_entry_changes_bits(
    real: Bundle, folder: Path, made_usually: Callable[..., Result], tmp_path: Path, number: str
) -> None:
    kind, changed, name, choices = NUMBERS[number]
    stages = tuple(
        stage.model_copy(update=changed) if isinstance(stage, kind) else stage
        for stage in real.manifest.stages
    )
    other = _repacked(real, tmp_path, stages)
    usual = _main(made_usually(name, **choices))
    found = _main(_made(other, folder / name, **choices))
    assert usual.shape == found.shape
    assert (usual != found).any()


def test_the_listed_stages_run_in_their_order_and_no_others(
    real: Bundle, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from camkit.runtime.stage_finder import module_of

    ran: list[str] = []
    for stage in real.manifest.stages:
        module = module_of(stage)
        monkeypatch.setattr(module, "prepare", _watched(module.prepare, ran))
    _made(real, folder / "scan.npz")
    assert ran == ["correct", "super_resolve", "sharpen"]


def _watched(prepare: Callable[..., Any], ran: list[str]) -> Callable[..., Any]:
    def watched(entry: StageEntry, job: Any) -> Any:
        ran.append(entry.type)
        return prepare(entry, job)

    return watched
