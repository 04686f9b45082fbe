"""A mis-etched plate in small: what is measured wins back, and every method is told of."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf, write_plate_psf
from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.kinds.spad.training import SpadMaterial
from camkit.models_def.training.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from camkit.models_def.training.trainer import TrainOptions
from tests.one_thread import one_thread  # noqa: F401
from tests.spad_bundle import leaning_kernel
from tests.spad_checkpoint import tiny_recipe, write_untrained
from tools.spad import misetched
from tools.spad.misetch import tuning
from tools.spad.misetch.tuning import recipe_text
from tools.spad.misetched import main

SMALL = ["--cells", "33", "--tiles", "8"]
RECIPE = tiny_recipe('mode = "learned"\npsf = "design.safetensors"')


@pytest.fixture
def design(tmp_path: Path) -> Path:
    """Give a PSF that leans."""
    path = tmp_path / "design.safetensors"
    write_plate_psf(path, leaning_kernel())
    return path


@pytest.fixture
def checkpoint(tmp_path: Path, design: Path) -> Path:
    """Give an untrained network behind that PSF."""
    digest = SpadMaterial(kernel=read_plate_psf(design)).digest()
    return write_untrained(tmp_path / "start.pt", RECIPE, bank_digest=digest)


@pytest.fixture
def tests_folder(tmp_path: Path) -> Path:
    """Give one test set of one picture with edges of all kinds."""
    folder = tmp_path / "tests" / "set5"
    folder.mkdir(parents=True)
    picture = np.zeros((96, 96, 3), np.uint8)
    cv2.circle(picture, (50, 45), 30, (200, 180, 220), -1)
    cv2.line(picture, (5, 90), (90, 60), (90, 120, 60), 5)
    assert cv2.imwrite(str(folder / "one.png"), picture)
    return folder.parent


@pytest.fixture
def trainings(monkeypatch: pytest.MonkeyPatch) -> list[tuple[TrainOptions, SpadMaterial]]:
    """Give what trainings were asked for; each leaves the weights it began with."""
    asked: list[tuple[TrainOptions, SpadMaterial]] = []

    def train(recipe: Path, options: TrainOptions, *, material: SpadMaterial) -> None:
        asked.append((options, material))
        if options.start is not None:
            done = replace(
                read_checkpoint(options.start),
                recipe_toml=recipe.read_text(encoding="utf-8"),
                bank_digest=material.digest(),
                cpu_s=6.0,
                step=2,
                valid_db=20.0,
            )
            write_checkpoint(options.out_dir / "tiny_upscale_S.pt", done)
        (options.out_dir / "samples_upscale_S").mkdir()

    monkeypatch.setattr(tuning, "train", train)
    return asked


def test_every_method_is_judged_behind_the_plate_that_is(
    tmp_path: Path,
    design: Path,
    checkpoint: Path,
    tests_folder: Path,
    trainings: list[tuple[TrainOptions, SpadMaterial]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(misetched, "SCAN", (0.0, 0.3))
    out = tmp_path / "out"
    asked = ["--checkpoint", checkpoint, "--psf", design, "--test", tests_folder]
    asked += ["--out-dir", out, "--cpu-minutes", "0.1", "--depth-error", "0.3", "--control"]
    assert main([*map(str, asked), *SMALL]) == 0
    record = json.loads((out / "misetched.json").read_text(encoding="utf-8"))
    right, (wrong,) = record["designed"], record["etched"]
    # the measured PSF is far nearer to the plate than the plate to its design
    assert wrong["like_design"]["rmse"] > 5 * right["like_design"]["rmse"]
    assert wrong["like_design"]["rmse"] > 10 * wrong["measured"]["rmse"]
    assert wrong["training"] == {"cpu_s": 6.0, "steps": 2, "valid_db": 20.0}
    db = {name: scores["no noise"]["set5"]["psnr_db"] for name, scores in wrong["methods"].items()}
    assert set(db) == {
        "network",
        "network trained on, measured PSF",
        "network trained on, design PSF",
        "linear, design PSF",
        "linear, measured PSF",
        "linear, true PSF",
    }
    assert db["linear, design PSF"] < db["linear, measured PSF"] - 0.02
    assert db["linear, measured PSF"] == pytest.approx(db["linear, true PSF"], abs=0.02)
    # weights that are not changed are judged behind the plate as etched, whatever they were told
    assert db["network trained on, measured PSF"] == db["network trained on, design PSF"]
    assert db["network"] == db["network trained on, measured PSF"]
    assert wrong["methods"]["network"] != right["methods"]["network"]
    scanned = [row["methods"] for row in record["scan"]]
    for found, plate in zip(scanned, (right, wrong), strict=True):
        for name in ("network", "linear, design PSF"):
            assert found[name] == plate["methods"][name]["no noise"]
    told = capsys.readouterr().out
    assert "| +30% | network trained on, measured PSF |" in told
    assert "| as designed | network |" in told


def test_a_network_is_trained_on_with_what_was_measured(
    tmp_path: Path,
    checkpoint: Path,
    design: Path,
    trainings: list[tuple[TrainOptions, SpadMaterial]],
) -> None:
    psf = tmp_path / "other" / "measured.safetensors"
    psf.parent.mkdir()
    write_plate_psf(psf, gaussian_psf(1.5))
    start = read_checkpoint(checkpoint)

    def tuned(cpu_minutes: float) -> Checkpoint:
        settings = tuning.Tuning(cpu_minutes=cpu_minutes)
        return tuning.tuned(checkpoint, start, psf, gaussian_psf(1.5), settings)

    found = tuned(0.1)
    assert 'psf = "measured.safetensors"' in found.recipe_toml
    assert [path.name for path in psf.parent.glob("samples_*")] == []
    # what is done is not done again, but longer it goes on where it was
    tuned(0.1)
    tuned(0.2)
    (first, material), (second, _) = trainings
    assert (first.start, first.resume) == (checkpoint, False)
    assert (second.start, second.resume) == (None, True)
    assert first.max_cpu_minutes == pytest.approx(0.1)
    np.testing.assert_allclose(material.kernel, gaussian_psf(1.5))


def test_the_recipe_changes_by_its_psf_and_its_rate() -> None:
    text = recipe_text(RECIPE, "measured.safetensors")
    changed = set(text.splitlines()) - set(RECIPE.splitlines())
    assert changed == {'psf = "measured.safetensors"', "learning_rate = 0.0005"}
    with pytest.raises(ContractError, match="must have one line"):
        recipe_text(RECIPE.replace("psf =", "# psf ="), "measured.safetensors")


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"--psf": None}, "was not trained behind the PSF"),
        ({"--test": "none"}, "holds none of the folders set5"),
        ({"--depth-error": "1.5"}, "is a share of a depth; got 1.5"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(
    changed: dict[str, str | None],
    told: str,
    tmp_path: Path,
    checkpoint: Path,
    design: Path,
    tests_folder: Path,
) -> None:
    asked: dict[str, Path | str | None]
    asked = {"--checkpoint": checkpoint, "--psf": design, "--test": tests_folder}
    asked = {**asked, "--out-dir": tmp_path / "out", **changed}
    words = [str(part) for pair in asked.items() if pair[1] is not None for part in pair]
    with pytest.raises(SystemExit, match=told):
        main([*words, *SMALL])
