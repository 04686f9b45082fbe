"""The whole bench on a tiny camera, and what it refuses before any work."""

from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest

from camkit.errors import BundleError, ContractError, DecodeError
from camkit.report.bench.output import write_bench
from camkit.report.bench.run import open_entrants, run_bench
from camkit.report.bench.settings import Settings
from camkit.report.bench.timed.capture import timed_capture
from camkit.report.bench.trial import Axes
from tests.bundle_factory import write_tiny_bundle
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle


def test_a_bench_measures_seconds_and_accuracy_of_every_row(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    sharp = tmp_path / "sharp"
    sharp.mkdir()
    values = np.rint(texture(100, 120) * 255).astype(np.uint8)
    cv2.imwrite(str(sharp / "a.png"), values[::-1].transpose(1, 2, 0))
    told: list[str] = []
    result = run_bench(
        Settings(
            bundles=(str(bundle.path),),
            references=(str(_copy(bundle.path, tmp_path / "rival.camkit")),),
            axes=Axes(methods=("net",), modes=("exact",), threads=(1,)),
            repeat=1,
            data=sharp,
            work_dir=tmp_path / "work",
            gemm_s=0.01,
        ),
        told.append,
    )
    own, rival = result.report["rows"]
    assert (own["label"], rival["label"]) == ("M", "rival M")
    for row in (own, rival):
        assert row["error"] is None
        assert row["n"] == row["steady_n"] == 1
        assert (row["width"], row["height"]) == (320, 240)
        assert 0 < row["share_of_gemm_peak"] < 1
        assert (row["psf"], row["images"], row["captures"]) == ("bundle", 1, 10)
        assert row["psnr_db"] != row["input_psnr_db"]
    assert own["psnr_db"] == rival["psnr_db"]  # the same network
    assert len(result.patches["tiny"]) == 4
    assert result.report["machine"]["gemm_gmac_per_s"]["1"] > 0
    assert "tiny: timing M (1/2)" in told


def test_seconds_stand_where_the_accuracy_cannot_be_measured(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    sharp = tmp_path / "sharp"
    sharp.mkdir()
    cv2.imwrite(str(sharp / "a.png"), np.zeros((20, 20, 3), np.uint8))
    result = run_bench(
        Settings(
            bundles=(str(bundle.path),),
            axes=Axes(methods=("net",), modes=("exact",), threads=(1,)),
            repeat=1,
            data=sharp,
            work_dir=tmp_path / "work",
            gemm_s=0.01,
        )
    )
    (row,) = result.report["rows"]
    assert row["n"] == 1
    assert row["seconds_median"] > 0
    assert row["psnr_db"] is None
    assert row["images"] == 0
    (camera,) = result.report["cameras"].values()
    assert camera["accuracy"].startswith("not measured: ")
    assert "20x20" in camera["accuracy"]
    (skip,) = (s for s in result.report["skipped"] if s["what"].startswith("accuracy of "))
    assert "20x20" in skip["reason"]
    write_bench(result, tmp_path / "out")
    assert "not measured" in (tmp_path / "out" / "bench.html").read_text(encoding="utf-8")


def test_a_folder_without_pictures_is_an_error_before_the_timing(tmp_path: Path) -> None:
    told: list[str] = []
    settings = Settings(
        bundles=(str(write_tiny_bundle(tmp_path)),), data=tmp_path / "none", work_dir=tmp_path
    )
    with pytest.raises(ContractError, match="no folder"):
        run_bench(settings, told.append)
    assert told == []


def test_a_scene_that_is_not_finite_is_an_error_before_the_timing(tmp_path: Path) -> None:
    told: list[str] = []
    light = np.full((120, 120, 3), 0.5, np.float32)
    light[3, 4] = np.inf
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    (tmp_path / "data").mkdir()
    OpenEXR.File(header, {"RGB": light}).write(str(tmp_path / "data" / "bad.exr"))
    settings = Settings(
        bundles=(str(write_tiny_bundle(tmp_path)),), data=tmp_path / "data", work_dir=tmp_path
    )
    with pytest.raises(DecodeError, match=r"bad\.exr: 3 samples are NaN or infinite"):
        run_bench(settings, told.append)
    assert told == []


def _copy(source: Path, target: Path) -> Path:
    target.write_bytes(source.read_bytes())
    return target


def test_the_timed_capture_is_made_once_and_has_no_clipped_lights(tmp_path: Path) -> None:
    from camkit.runtime.raw import read_capture

    bundle = write_wide_bundle(tmp_path)
    path, size = timed_capture(bundle, None, None, tmp_path)
    assert size == (320, 240)
    written = path.stat().st_mtime_ns
    assert timed_capture(bundle, None, None, tmp_path)[0].stat().st_mtime_ns == written
    other, size = timed_capture(bundle, 160, None, tmp_path)
    assert (other != path, size) == (True, (160, 240))
    capture = read_capture(path)
    assert capture.samples.max() < capture.white_level
    with pytest.raises(ContractError, match="sensor of 320x240"):
        timed_capture(bundle, 322, None, tmp_path)


def test_a_photo_is_taken_by_the_camera_in_place_of_the_scene(tmp_path: Path) -> None:
    from camkit.runtime.raw import read_capture

    bundle = write_wide_bundle(tmp_path)
    pixels = np.zeros((250, 340, 3), np.uint8)
    pixels[:, 170:] = 200
    photo = tmp_path / "photo.png"
    cv2.imwrite(str(photo), pixels)
    path, size = timed_capture(bundle, None, None, tmp_path, photo)
    assert size == (320, 240)
    samples = read_capture(path).samples
    assert samples[:, 240:].mean() > 1.5 * samples[:, :80].mean()
    assert path != timed_capture(bundle, None, None, tmp_path)[0]
    cv2.imwrite(str(photo), pixels[:200])
    with pytest.raises(ContractError, match="at least 320x240 px; it has 340x200"):
        timed_capture(bundle, None, None, tmp_path, photo)
    with pytest.raises(ContractError, match="not both"):
        Settings(bundles=("duet",), capture=photo, photo=photo)
    with pytest.raises(ContractError, match="no photo"):
        Settings(bundles=("duet",), photo=tmp_path / "none.png")


def test_a_reference_must_be_of_one_of_the_cameras(tmp_path: Path) -> None:
    wide = write_wide_bundle(tmp_path)
    tiny = write_tiny_bundle(tmp_path)
    with pytest.raises(ContractError, match="camera of none"):
        open_entrants([str(wide.path)], [str(tiny)])


def test_two_bundles_of_one_name_are_refused(tmp_path: Path) -> None:
    wide, tiny = write_wide_bundle(tmp_path), write_tiny_bundle(tmp_path)
    with pytest.raises(ContractError, match="one name"):
        open_entrants([str(wide.path), str(tiny)], [])


def test_a_bundle_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="no bundle file"):
        open_entrants([str(tmp_path / "no.camkit")], [])


def test_nothing_to_measure_is_an_error_with_the_reasons(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    settings = Settings(
        bundles=(str(path),), axes=Axes(methods=("net",), sizes=("L",)), work_dir=tmp_path
    )
    with pytest.raises(ContractError, match="tiny L: the bundle holds M"):
        run_bench(settings)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"bundles": ()}, "at least one bundle"),
        ({"repeat": 0}, "repeat must be >= 1"),
        ({"images": 0}, "images must be >= 1"),
        ({"width_px": 33}, "width must be even"),
        ({"capture": Path("no.dng")}, "no capture"),
    ],
)
def test_settings_that_make_no_sense_are_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ContractError, match=words):
        Settings(**({"bundles": ("duet",)} | changes))  # type: ignore[arg-type]


def test_the_working_folder_is_the_user_s_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    folder = Settings(bundles=("duet",)).folder()
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o077 == 0
    assert Settings(bundles=("duet",), work_dir=tmp_path / "w").folder().is_dir()
