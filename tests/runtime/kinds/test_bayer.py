"""Colour photographs: photographed by the twin, written, read again and given back as arrays.

Developed pictures: of three full colours or grey, whole or in halves.
"""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import Extent
from camkit.bundle.stages import Color, Linearise, Repair, Wiener
from camkit.errors import ContractError
from camkit.kinds import BAYER
from camkit.runtime.color import color_stage
from camkit.runtime.files.picture import read_scene
from camkit.runtime.kind import runtime_part
from camkit.runtime.options import Options
from camkit.runtime.output.exr import ExrWriter
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.sidecar import sidecar_path
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.raw import read_capture
from camkit.runtime.twin.simulate import SimulationOptions
from tests.planes_bundle import SIZE_PX, planes_sensor, write_planes_bundle
from tests.psf_factory import gaussian_kernel, uniform_psf

PART = runtime_part(BAYER.name)


def test_what_is_photographed_and_written_is_read_again(bundle: Bundle, tmp_path: Path) -> None:
    scene = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    taken = PART.simulate(scene, bundle, SimulationOptions(iso=400, seed=3))
    path = tmp_path / f"a{PART.suffixes[0]}"
    PART.write(path, taken, bundle)
    read = PART.read(path, None, bundle.manifest, Options())
    np.testing.assert_array_equal(read.samples, taken.samples)
    assert (read.bundle_name, read.iso) == ("tiny", 400)
    again = PART.from_array(
        taken.samples, bundle.manifest, iso=400.0, white_balance=read.white_balance
    )
    np.testing.assert_array_equal(again.samples, read.samples)
    assert (again.cfa, again.white_level) == (read.cfa, read.white_level)


def test_the_pipeline_reads_by_the_kind_of_its_bundle_and_photographs_without_one(
    bundle: Bundle, tmp_path: Path
) -> None:
    scene = np.full((3, 64, 96), 0.3, np.float32)
    path = tmp_path / "a.dng"
    PART.write(path, PART.simulate(scene, bundle, SimulationOptions(noise=False)), bundle)
    captures = [Pipeline(camera, Options()).read(path) for camera in (bundle, None)]
    np.testing.assert_array_equal(*(capture.samples for capture in captures))


# ------------------------------------------------------------------------------- developed pictures

FORMATS = {"exr": "exr", "tiff": "tif", "png": "png", "jpeg": "jpg"}


def planes_camera(folder: Path, channels: tuple[str, ...]) -> Bundle:
    stages = (
        Linearise(),
        Repair(),
        Wiener(
            takes=("sound", "unknown"),
            block_px=64,
            overlap_px=24,
            prior_scale=3e-4,
            prior_exponent=2.5,
        ),
        Color(takes=("restored",)),
    )
    psf = uniform_psf(gaussian_kernel(1.2)[0], channels=len(channels))
    extent = Extent(width_px=SIZE_PX[0], height_px=SIZE_PX[1], pixel_pitch_um=psf.pixel_pitch_um)
    sensor = planes_sensor(channels, extent=extent)
    return write_planes_bundle(folder, stages, sensor=sensor, psf=psf)


@pytest.fixture
def grey_camera(tmp_path: Path) -> Bundle:
    return planes_camera(tmp_path, ("Y",))


@pytest.fixture
def light() -> FloatArray:
    """Half light with a bright square, which a lens would blur."""
    picture = np.full((SIZE_PX[1], SIZE_PX[0]), 0.2, np.float32)
    picture[20:40, 30:60] = 0.7
    return picture


def as_codes(light: FloatArray) -> np.ndarray:
    return np.rint(light * 65535).astype(np.uint16)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".exr"])
def test_a_grey_camera_takes_grey_pictures_and_writes_them(
    grey_camera: Bundle, light: FloatArray, tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"in{suffix}"
    if suffix == ".exr":
        size = {"width": light.shape[1], "height": light.shape[0]}
        written = PictureFormat(**size, color=color_stage(None), is_grey=True)
        with ExrWriter(path, written) as writer:
            writer.write(np.stack([light] * 3))
    else:
        cv2.imwrite(str(path), as_codes(light))
    whole = camkit.load(grey_camera.path, noise=(1e-5, 1e-9)).process(path).image
    for format_, name in FORMATS.items():
        (result,) = camkit.process(
            path,
            bundle=grey_camera.path,
            noise=(1e-5, 1e-9),
            out_dir=tmp_path / format_,
            format=format_,  # type: ignore[arg-type]
            preview=True,
        )
        assert result.error is None
        written = read_capture(tmp_path / format_ / f"in.{name}", is_grey=True)
        assert written.channels == 1
        assert not any("three equal" in note for note in written.notes)
        if format_ == "exr":
            assert np.abs(written.linear_rows(0, 64) - whole[:1]).max() < 1e-3
    assert tifffile.imread(tmp_path / "tiff" / "in.tif").shape == light.shape


def test_a_grey_picture_states_its_curve(
    grey_camera: Bundle, light: FloatArray, tmp_path: Path
) -> None:
    cv2.imwrite(str(tmp_path / "in.png"), as_codes(light))
    for linear in (False, True):
        for format_ in ("tiff", "png", *(() if linear else ("jpeg",))):
            folder = tmp_path / f"{format_}{linear}"
            camkit.process(
                tmp_path / "in.png",
                bundle=grey_camera.path,
                out_dir=folder,
                format=format_,  # type: ignore[arg-type]
                linear=linear,
            )
            scene = read_scene(folder / f"in.{FORMATS[format_]}")
            assert scene[:, :10, :10].mean() == pytest.approx(0.2, abs=0.004)


def test_three_equal_channels_are_grey_and_colours_are_refused_by_a_grey_camera(
    grey_camera: Bundle, light: FloatArray, tmp_path: Path
) -> None:
    equal = np.repeat(as_codes(light)[..., None], 3, axis=2)
    colours = equal.copy()
    colours[3, 4, 0] += 1
    for name, picture in (("equal", equal), ("colours", colours)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture)
    results = camkit.process(
        [tmp_path / "equal.png", tmp_path / "colours.png"],
        bundle=grey_camera.path,
        out_dir=tmp_path / "out",
    )
    assert [result.status for result in results] == ["ok", "failed"]
    assert any("three equal channels" in note for note in results[0].warnings)
    assert "expected a grey picture" in (results[1].error or "")


def test_a_camera_of_three_colours_takes_grey_as_three(light: FloatArray, tmp_path: Path) -> None:
    camera = planes_camera(tmp_path, ("R", "G", "B"))
    cv2.imwrite(str(tmp_path / "in.png"), as_codes(light))
    (result,) = camkit.process(
        tmp_path / "in.png", bundle=camera.path, out_dir=tmp_path / "out", format="png"
    )
    assert result.error is None
    assert cv2.imread(str(tmp_path / "out" / "in.png"), cv2.IMREAD_UNCHANGED).ndim == 3


def write_halves(folder: Path, light: FloatArray, names: str) -> None:
    for name in names:
        for half, factor in (("_l", 0.8), ("_r", 1.2)):
            cv2.imwrite(str(folder / f"{name}{half}.png"), as_codes(factor * light))


def test_halves_are_processed_as_their_mean_and_named_in_the_sidecar(
    grey_camera: Bundle, light: FloatArray, tmp_path: Path
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    write_halves(folder, light, "ab")
    cv2.imwrite(str(tmp_path / "whole.png"), as_codes(light))
    said = {"bundle": grey_camera.path, "noise": (1e-5, 1e-9), "out_dir": tmp_path / "out"}
    results = camkit.process(folder, halves=("_l", "_r"), **said)
    assert [result.input.name for result in results] == ["a_l.png", "b_l.png"]
    camera = camkit.load(grey_camera.path, noise=(1e-5, 1e-9))
    mean = camkit.load(grey_camera.path, noise=(1e-5, 1e-9), halves=("_l", "_r"))
    np.testing.assert_allclose(
        mean.process(folder / "a_l.png").image,
        camera.process(tmp_path / "whole.png").image,
        atol=1e-4,
    )
    record = json.loads(sidecar_path(tmp_path / "out" / "a_l.exr").read_text())
    assert record["input"].endswith("a_l.png")
    assert record["other_half"].endswith("a_r.png")
    again = camkit.process(folder, halves=("_l", "_r"), resume=True, **said)
    assert [result.status for result in again] == ["skipped", "skipped"]
    cv2.imwrite(str(folder / "b_r.png"), as_codes(light))
    again = camkit.process(folder, halves=("_l", "_r"), resume=True, **said)
    assert [result.status for result in again] == ["skipped", "ok"], "the other half is another"


def test_a_half_without_its_other_one_fails_alone(
    grey_camera: Bundle, light: FloatArray, tmp_path: Path
) -> None:
    write_halves(tmp_path, light, "ab")
    (tmp_path / "b_r.png").unlink()
    cv2.imwrite(str(tmp_path / "c.png"), as_codes(light))
    results = camkit.process(
        [tmp_path / "a_l.png", tmp_path / "b_l.png", tmp_path / "c.png"],
        bundle=grey_camera.path,
        halves=("_l", "_r"),
        out_dir=tmp_path / "out",
    )
    assert [result.status for result in results] == ["ok", "failed", "failed"]
    assert "b_r.png" in (results[1].error or "")
    assert "c.png is no left half" in (results[2].error or "")


@pytest.mark.parametrize(
    ("said", "text"),
    [
        ({"noise": (0.0, 1e-9)}, "noise takes the shot noise and the read variance"),
        ({"noise": (1e-5, -1.0)}, "noise takes"),
        ({"noise": (1e-5, 1e-9), "iso": 100.0}, "noise and iso both say"),
        ({"iso": -1.0}, "iso must be a number"),
        ({"halves": ("_l", "_l")}, "halves takes two texts that differ"),
        ({"tone": "gamma"}, "tone takes srgb, linear or a file"),
        ({"noise": (1e-5, 1e-9), "method": "develop"}, "noise does not apply with"),
    ],
)
def test_words_that_mean_nothing_are_refused_before_work(
    grey_camera: Bundle, tmp_path: Path, said: dict[str, object], text: str
) -> None:
    with pytest.raises(ContractError, match=text):
        camkit.process(tmp_path / "a.png", bundle=grey_camera.path, **said)  # type: ignore[arg-type]


def test_noise_means_nothing_without_a_bundle() -> None:
    with pytest.raises(ContractError, match="noise does not apply without a bundle"):
        Pipeline(None, Options(noise=(1e-5, 1e-9)))
