"""A package of somebody else brings a network, a sensor and a PSF reader, and they work."""

from pathlib import Path

import numpy as np
import pytest

from camkit import calibrate
from camkit.calibration.psf_import.kernel_stack import ImportOptions
from camkit.calibration.psf_import.psf_source import read_source
from camkit.errors import ContractError
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.sensors.sensor_choice import choose_sensor
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.trainer import TrainOptions, train
from tests.bayer_recipe import RECIPE

pytestmark = pytest.mark.usefixtures("lab_installed")


def test_its_network_is_trained_like_any_other(tmp_path: Path, material: object) -> None:
    path = tmp_path / "lab.toml"
    network = 'network = "lab_plain"\nconfig = { width = 4 }\nschedule = { steps = 3 }\n'
    head, _, _ = RECIPE.partition("[networks.S]")
    path.write_text(f"{head}[networks.S]\n{network}", encoding="utf-8")
    options = TrainOptions(out_dir=tmp_path, size="S", workers=0)
    result = train(path, options, material=material)  # type: ignore[arg-type]
    trained = load_network(read_checkpoint(result.checkpoint))
    assert type(trained).__name__ == "PlainNetwork"
    assert trained.body[0].out_channels == 4  # type: ignore[index, union-attr]


def test_what_a_network_does_not_take_is_refused_and_all_names_are_told() -> None:
    with pytest.raises(ContractError, match="lab_plain does not take this configuration"):
        build_network("lab_plain", colour="red")
    with pytest.raises(ContractError, match=r"one of lean_s, .*lab_plain.*; got 'lab_other'"):
        build_network("lab_other")
    with pytest.raises(ContractError, match=r"'lab_bad' of math:pi builds nothing"):
        build_network("lab_bad")


def test_its_sensor_is_chosen_by_name() -> None:
    choice = choose_sensor("lab-1")
    assert (choice.table["width_px"], choice.table["cfa"]) == (96, "GBRG")
    assert choice.sources["full_well_e"] == "LAB-1: measured in the laboratory"
    assert choose_sensor("LAB-1:RGGB").table["cfa"] == "RGGB"
    with pytest.raises(ContractError, match="PYTHON1300, LAB-1, LAB-2; got 'LAB-3'"):
        choose_sensor("LAB-3")
    with pytest.raises(ContractError, match=r"'LAB-2' of math:pi must state height_px"):
        choose_sensor("LAB-2")


def test_its_reader_reads_kernels_like_those_of_an_array(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    kernels = rng.random((2, 3, 3, 5, 5))
    np.save(tmp_path / "a.npy", kernels)
    header = " ".join(map(str, kernels.shape))
    rows = "\n".join(" ".join(repr(float(v)) for v in row) for row in kernels.reshape(-1, 5))
    (tmp_path / "a.lab").write_text(f"{header}\n{rows}\n", encoding="utf-8")
    one, two = (read_source(tmp_path / name, ImportOptions()) for name in ("a.npy", "a.lab"))
    assert np.array_equal(one.values, two.values)
    for name in ("a.npy", "a.lab"):
        calibrate.import_psf(
            tmp_path / name,
            tmp_path / f"{name}.safetensors",
            colours="RGB",
            pitch_um=2.0,
            span_mm=(2.0, 1.0),
        )
    first, second = ((tmp_path / f"{n}.safetensors").read_bytes() for n in ("a.npy", "a.lab"))
    assert first == second


def test_a_reader_that_reads_nothing_is_refused(tmp_path: Path) -> None:
    for suffix, message in (("bad", "'bad' of math:pi reads nothing"), ("xyz", r"\.lab, \.bad")):
        path = tmp_path / f"a.{suffix}"
        path.write_text("x", encoding="utf-8")
        with pytest.raises(ContractError, match=message):
            read_source(path, ImportOptions())
