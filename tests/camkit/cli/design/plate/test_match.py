"""`camkit plate match`: a PSF in, one unit of a plate and its masks out, and what is refused."""

import json
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.cli.exit_code import ExitCode
from camkit.models_def.kinds.spad.plate_psf import write_plate_psf
from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.optics.dots.orders import intensity, order_matrix, orders_of

SMALL = ("--cells", 22)
PSF = gaussian_psf(1.84)


@pytest.fixture(name="psf")
def psf_file(tmp_path: Path) -> Path:
    path = tmp_path / "psf.npz"
    np.savez(path, psf=PSF)
    return path


def _held(folder: Path) -> dict[str, np.ndarray]:
    with np.load(folder / "plate.npz", allow_pickle=False) as arrays:
        return dict(arrays)


def test_masks_and_heights_are_those_of_the_light_that_is_told(camkit_command, psf: Path) -> None:
    folder = psf.parent / "new" / "plate"
    done = camkit_command("plate", "match", psf, "-o", folder, *SMALL, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    held = _held(folder)
    assert sorted(p.name for p in folder.iterdir()) == [
        *(f"mask_{n}.png" for n in (1, 2, 3)),
        "plate.npz",
    ]
    assert held["height_um"].shape == held["level"].shape == (22, 22)
    assert float(held["cell_um"]) == pytest.approx(873.3333 / 22, rel=1e-6)
    assert (told["cell_um"], told["step_um"]) == (held["cell_um"], held["step_um"])
    assert told["step_um"] == pytest.approx(0.1794, abs=5e-5)
    np.testing.assert_allclose(held["height_um"], held["level"] * told["step_um"])
    masks = [cv2.imread(str(folder / m["file"]), cv2.IMREAD_UNCHANGED) for m in told["masks"]]
    assert [m["depth_um"] / told["step_um"] for m in told["masks"]] == [1, 2, 4]
    level = sum((mask == 255).astype(int) << n for n, mask in enumerate(masks))
    np.testing.assert_array_equal(level, held["level"])
    # the light follows from the heights by the index of silica
    phase = 2 * np.pi / 0.655 * (told["index"] - 1) * held["height_um"]
    light = intensity(orders_of(np.exp(1j * phase), order_matrix(22)))
    assert light.sum() == pytest.approx(told["efficiency"], abs=1e-4)
    np.testing.assert_allclose(held["dots"], light / light.sum(), atol=1e-4 * light.max())
    assert np.corrcoef(light.ravel(), PSF.ravel())[0, 1] == pytest.approx(told["correlation"], abs=1e-5)  # noqa: E501 # fmt: skip
    apart = light / light.max() - PSF / PSF.max()
    assert np.sqrt((apart**2).mean()) == pytest.approx(told["rmse"], abs=1e-4)
    assert held["psf"].sum() == pytest.approx(1, abs=1e-6)
    assert told["levels"] == 8
    assert told["notes"] == []
    assert told["cpu_seconds"] > 0


def test_a_frozen_psf_serves_as_well(camkit_command, psf: Path) -> None:
    frozen = psf.with_suffix(".safetensors")
    write_plate_psf(frozen, PSF)
    for path in (psf, frozen):
        done = camkit_command("plate", "match", path, "-o", psf.parent / path.suffix[1:], *SMALL)
        assert done.code == 0, done.err
    one, two = (_held(psf.parent / name)["level"] for name in ("npz", "safetensors"))
    np.testing.assert_array_equal(one, two)


def test_the_same_is_said_for_people_with_notes(camkit_command, psf: Path) -> None:
    # light on one side alone, which two levels cannot make
    lopsided = np.zeros((11, 11))
    lopsided[7:9, 7:9] = 20
    np.savez(psf, psf=lopsided)
    folder = psf.parent / "plate"
    done = camkit_command("plate", "match", psf, "-o", folder, *SMALL, "--levels", 2)
    assert done.code == 0, done.err
    assert "mask_1.png: etch 0.7176 um" in done.out
    assert "seen by the array: correlation" in done.out
    assert "note: the PSF had a sum of 80; it was divided by it" in done.err
    assert "a plate of two levels is as bright on one side as on the other" in done.err


def test_what_is_there_stays_unless_it_may_be_replaced(camkit_command, psf: Path) -> None:
    folder = psf.parent / "plate"
    folder.mkdir()
    for name in ("mask_4.png", "mask_by_hand.png"):
        (folder / name).write_bytes(b"mine")
    asked = ("plate", "match", psf, "-o", folder, *SMALL)
    done = camkit_command(*asked)
    assert done.code == ExitCode.USAGE
    assert "mask_4.png exists; add --overwrite or choose another name" in done.err
    assert camkit_command(*asked, "--overwrite").code == 0
    # a mask of more levels would spoil this plate
    assert sorted(p.name for p in folder.glob("mask*")) == [
        *(f"mask_{n}.png" for n in (1, 2, 3)),
        "mask_by_hand.png",
    ]
    assert camkit_command(*asked).code == ExitCode.USAGE


def _objects(path: Path) -> None:
    np.savez(path, psf=np.full((11, 11), None))


def _bomb(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("psf.npy", bytes(10**7))


def _boast(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }"
        header = header.ljust(117) + b"\n"
        archive.writestr("psf.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)  # noqa: E501 # fmt: skip


def _cut(path: Path) -> None:
    np.savez(path, psf=PSF)
    path.write_bytes(path.read_bytes()[:200])


@pytest.mark.parametrize(
    ("write", "told"),
    [
        (
            lambda p: np.savez(p, kernel=PSF),
            "must have the key psf, the 11x11 PSF; it holds kernel",
        ),
        (np.savez, "it holds nothing"),
        (lambda p: np.savez(p, psf=PSF[:9, :9]), "must be 11x11 real numbers; got float32 (9, 9)"),
        (lambda p: np.savez(p, psf=PSF[None]), "got float32 (1, 11, 11)"),
        (lambda p: np.savez(p, psf=PSF - 0.01), "must be >= 0, as light is"),
        (lambda p: np.savez(p, psf=PSF * np.nan), "must be finite"),
        (lambda p: np.savez(p, psf=PSF * 0), "needs light"),
        (_objects, "holds pickled objects, which are never read"),
        (_bomb, "unpacks to 10000000 bytes"),
        (_boast, "must be 11x11; it states (1000000, 1000000)"),
        (_cut, "is damaged, or no NPZ"),
        (lambda p: p.write_text("text"), "is damaged, or no NPZ"),
        (Path.exists, "cannot read"),
    ],
)
def test_what_is_no_psf_is_one_line_and_no_file(
    camkit_command, tmp_path: Path, write, told: str
) -> None:
    path, folder = tmp_path / "wrong.npz", tmp_path / "plate"
    write(path)
    done = camkit_command("plate", "match", path, "-o", folder)
    assert done.code == ExitCode.USAGE
    assert told in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not folder.exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--levels", 6), "levels are 2, 4, 8, ... 64; got 6"),
        (("--levels", 0), "levels are 2, 4, 8, ... 64; got 0"),
        (("--cells", 5), "a unit has 22 to 352 cells along a side; got 5"),
    ],
)
def test_wrong_wishes_are_refused_before_work(
    camkit_command, psf: Path, words: tuple, told: str
) -> None:
    done = camkit_command("plate", "match", psf, "-o", psf.parent / "plate", *words)
    assert done.code == ExitCode.USAGE
    assert told in done.err
    assert not (psf.parent / "plate").exists()


def test_other_files_are_refused_by_their_names(camkit_command, tmp_path: Path) -> None:
    done = camkit_command("plate", "match", tmp_path / "psf.csv", "-o", tmp_path / "plate")
    assert done.code == ExitCode.USAGE
    assert "a PSF is an .npz with the key psf, or a frozen one (.safetensors)" in done.err
    broken = tmp_path / "psf.safetensors"
    broken.write_bytes(b"no")
    done = camkit_command("plate", "match", broken, "-o", tmp_path / "plate")
    assert done.code == ExitCode.BUNDLE_REFUSED
    assert "no safetensors file" in done.err
