import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

import camkit
from camkit.bundle.reader import built_in_bundles, open_bundle
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.development import begin
from camkit.runtime.options import Options
from camkit.runtime.output.sidecar import sidecar_path
from camkit.runtime.output.writer import FileFormat
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.raw import read_capture
from camkit.runtime.write_options import WriteOptions
from tests.capture_factory import write_tiny_captures
from tests.decoded_here import decoded_here  # noqa: F401
from tests.dng_factory import write_scene


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("shot") / "shot.dng"
    write_scene(path, orientation=6)
    return path


def made(shot: Path, out_dir: Path, **choices: object) -> tuple[str, Path, dict[str, object]]:
    """Develop the capture; give what became of it, the picture and the sidecar."""
    (result,) = camkit.process(shot, bundle="none", out_dir=out_dir, **choices)
    assert result.output is not None, result.error
    return result.status, result.output, json.loads(sidecar_path(result.output).read_text())


@pytest.mark.parametrize("format_", ["exr", "tiff", "png", "jpeg", "dng"])
def test_metadata_are_carried_unless_they_are_stripped(
    shot: Path, tmp_path: Path, format_: str
) -> None:
    _, picture, record = made(shot, tmp_path / "all", format=format_)
    carried = read_capture(picture).metadata
    assert (carried.model, carried.iso) == ("duet", 400)
    assert carried.exposure_time_s == pytest.approx(0.02)
    assert record["metadata"]["model"] == "duet"  # type: ignore[index]
    _, bare, record = made(shot, tmp_path / "bare", format=format_, strip_metadata=True)
    assert record["metadata"] == {}
    assert b"duet" not in bare.read_bytes()
    assert read_capture(bare).metadata.iso is None
    turned = read_capture(bare).orientation
    assert turned == (6 if format_ == "dng" else 1), "what shows a picture upright stays"


def test_a_jpeg_is_the_png_in_fewer_bits(shot: Path, tmp_path: Path) -> None:
    _, jpeg, record = made(shot, tmp_path, format="jpeg", jpeg_quality=100)
    assert record["options"]["jpeg_quality"] == 100  # type: ignore[index]
    assert jpeg.name == "shot.jpg"
    _, tiff, _ = made(shot, tmp_path / "tiff", format="tiff")
    with Image.open(jpeg) as image:
        found = np.asarray(image).astype(float)
    assert np.abs(found - tifffile.imread(tiff) / 257).mean() < 1.5


def test_resume_makes_anew_what_other_options_wrote(shot: Path, tmp_path: Path) -> None:
    def status(**choices: object) -> str:
        return made(shot, tmp_path, format="jpeg", resume=True, **choices)[0]

    assert status() == "ok"
    assert status() == status(jpeg_quality=92) == "skipped"
    assert status(jpeg_quality=50) == "ok"
    assert status(jpeg_quality=50, strip_metadata=True) == "ok"
    assert status(jpeg_quality=50, strip_metadata=True) == "skipped"


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"format": "png", "jpeg_quality": 90}, "leave it out for png"),
        ({"format": "jpeg", "jpeg_quality": 0}, r"1\.\.100; got 0"),
        ({"format": "jpeg", "jpeg_quality": 101}, r"1\.\.100; got 101"),
        ({"format": "jpeg", "linear": True}, "8 bits hold no linear light"),
        ({"format": "bmp"}, "exr, tiff, png, jpeg, dng; got 'bmp'"),
    ],
)
def test_options_that_mean_nothing_are_refused(choices: dict[str, object], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        WriteOptions(**choices)  # type: ignore[arg-type]


def test_a_restored_picture_names_its_camera_too(tmp_path: Path) -> None:
    bundle = write_tiny_captures(tmp_path, ["a"])
    (result,) = camkit.process(
        tmp_path / "a.dng", bundle=bundle, out_dir=tmp_path / "out", format="png"
    )
    assert result.output is not None, result.error
    assert read_capture(result.output).metadata.model == "tiny"


@pytest.fixture(scope="module")
def whole_frames() -> list[tuple[Pipeline, Capture]]:
    """Return a whole frame of every built-in camera that photographs."""
    frames = []
    for path in built_in_bundles().values():
        bundle = open_bundle(path)
        sensor = bundle.manifest.sensor
        if sensor.type == "spad" or sensor.extent is None:
            continue
        samples = np.full((sensor.extent.height_px, sensor.extent.width_px), 900, np.uint16)
        pipeline = Pipeline(bundle, Options(threads=1))
        capture = pipeline.capture_of(samples, iso=100, white_balance=None, origin_px=None)
        frames.append((pipeline, capture))
    return frames


@pytest.mark.parametrize("format_", ["exr", "jpeg"])
@pytest.mark.parametrize("orientation", [1, 6])
def test_whole_frames_of_built_in_cameras_fit_the_default_memory(
    whole_frames: list[tuple[Pipeline, Capture]], format_: FileFormat, orientation: int
) -> None:
    assert len(whole_frames) >= 5
    for pipeline, capture in whole_frames:
        turned = replace(capture, orientation=orientation)
        assert begin(pipeline, turned, WriteOptions(format=format_))
