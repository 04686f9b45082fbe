"""Every built-in camera at work: as taken, restored and the truth, pixel for pixel.

    VIEWS   camera -> its view, made when it is called

A new camera is a line of `VIEWS`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Final

import numpy as np

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.stages import Deglare
from camkit.colorimetry import encode_srgb
from camkit.runtime.files.picture import read_light
from camkit.runtime.kinds.hdr.deglare.removal import Glare, GlareSettings, find_glare
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.twin.photon_twin import fitted, luminance, record
from camkit.runtime.kinds.spad.twin.recording import PhotonOptions
from camkit.runtime.kinds.spad.twin.write import write_recorded
from tools.hdr.glare_twin import exposed_scene, photographed, two_point_star
from tools.hdr.glare_twin import psnr_db as streaks_psnr_db
from tools.hdr.night_gallery import night_pictures
from tools.pictures.crops import Place, around_brightest, crop_pictures, psnr_db, take

SCENES: Final = Path(__file__).parent.parent / "scenes"
SIDE_PX: Final = 272
"""Three of them fit into the width that a page of a repository has."""
BORDER_PX: Final = 16
EXPOSURE: Final = 0.9
"""White of a photograph, as a share of what the sensor holds."""
COFFEE: Final = "Photograph by Rachel Michetti (CC0)"
CAT: Final = "Photograph by Stefan van der Walt (CC0)"
AS_TAKEN, RESTORED, TRUTH = "as taken", "restored", "truth"


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A capture of a camera, its restored picture, and the truth.

    Attributes:
        title: The camera.
        rows: What is shown -> caption -> (3, h, w) sRGB values: as taken, restored, the truth.
    """

    title: str
    rows: Mapping[str, Mapping[str, FloatArray]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """A photograph taken through a lens or a plate, half way between axis and corner.

    Attributes:
        scene: File in `SCENES`.
        subject: What it shows, and whose it is.
        middle: (x, y) of what is shown, as shares of the photograph.
        depth_mm: Object distance; None for the only one that the camera knows.
        iso: Sensitivity.
    """

    scene: str
    subject: str
    middle: tuple[float, float]
    depth_mm: float | None = None
    iso: float = 100.0

    def __call__(self, name: str) -> View:
        """Photograph it with a camera, and restore it."""
        bundle = open_bundle(find_bundle(name))
        scene = read_light(SCENES / self.scene)
        extent = bundle.manifest.sensor.extent
        assert extent is not None
        _, height, width = scene.shape
        origin = (extent.width_px * 3 // 4 - width // 2, extent.height_px * 3 // 4 - height // 2)
        shot = take(scene, bundle, origin, iso=self.iso, exposure=EXPOSURE, depth_mm=self.depth_mm)
        corner = tuple(
            int(np.clip(side * share - SIDE_PX / 2, 0, side - SIDE_PX)) // 2 * 2
            for side, share in zip((width, height), self.middle, strict=True)
        )
        place = Place(corner_px=(corner[0], corner[1]), size_px=(SIDE_PX, SIDE_PX))
        pipeline = camkit.load(name, undistort=False)
        developed, restored, truth = crop_pictures(
            shot, bundle, [pipeline], place, iso=self.iso, margin_px=max(width, height)
        )
        decibels = (psnr_db(developed, truth, BORDER_PX), psnr_db(restored, truth, BORDER_PX))
        distance = "" if self.depth_mm is None else f", {self.depth_mm / 1000:g} m away"
        what = f"{self.subject}{distance}, half way between axis and corner"
        return _view(bundle, {what: (developed, restored, truth)}, decibels)


@dataclass(frozen=True, slots=True, kw_only=True)
class Night:
    """A night with lamps beyond what the sensor can count, shown at several exposures.

    Attributes:
        stops: What is shown is 2^stops times as bright as it was exposed; a row each.
    """

    stops: tuple[int, ...]

    def __call__(self, name: str) -> View:
        """Photograph it with a camera, and read its lamps back."""
        bundle = open_bundle(find_bundle(name))
        with TemporaryDirectory() as folder:
            pictures = night_pictures(bundle, Path(folder) / "night.dng")
        light, decibels = zip(*(pictures[way] for way in ("developed", "network")), strict=True)
        truth, _ = pictures["truth"]
        part = around_brightest(truth, SIDE_PX, SIDE_PX)
        rows = {
            f"A synthetic night, shown {_exposure(stop)}": [
                encode_srgb(picture[part] * np.float32(2.0**stop)) for picture in (*light, truth)
            ]
            for stop in self.stops
        }
        return _view(bundle, rows, (decibels[0], decibels[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Windshield:
    """A synthetic night behind a wiped windshield.

    Attributes:
        seed: Of the scene.
        angle_deg: Of the streaks, from the vertical.
    """

    seed: int
    angle_deg: float

    def __call__(self, name: str) -> View:
        """Photograph it with any camera, and remove its streaks."""
        bundle = open_bundle(find_bundle(name))
        scene = exposed_scene(f"night:{self.seed}", 384, 512)
        shot = photographed(scene, two_point_star(np.deg2rad(self.angle_deg)), self.seed)
        glare, cleared = _deglared(shot.picture)
        level = glare.settings.level
        decibels = [streaks_psnr_db(picture, shot, level) for picture in (shot.picture, cleared)]
        part = around_brightest(shot.picture, SIDE_PX, SIDE_PX)
        tiles = [encode_srgb(picture[part]) for picture in (shot.picture, cleared, shot.truth)]
        row = {"A synthetic night behind a wiped windshield": tiles}
        return _view(bundle, row, (decibels[0], decibels[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Photons:
    """A photograph counted by an array of single-photon pixels.

    Attributes:
        scene: File in `SCENES`.
        subject: What it shows, and whose it is.
        photons: Of a pixel that sees white.
    """

    scene: str
    subject: str
    photons: float

    def __call__(self, name: str) -> View:
        """Count it, and make it finer."""
        bundle = open_bundle(find_bundle(name))
        camera = FineCamera.of(bundle)
        light = read_light(SCENES / self.scene)
        recorded = record(light, bundle, PhotonOptions(photons=self.photons, seed=1))
        with TemporaryDirectory() as folder:
            capture = Path(folder) / "counts.npz"
            write_recorded(capture, recorded)
            camkit.process(capture, bundle=name, out_dir=Path(folder) / "out")
            with np.load(Path(folder) / "out" / "counts.npz") as products:
                restored = products["intensity"] / self.photons
        truth = fitted(luminance(light), camera)
        scale = camera.scale
        counted = (recorded.values / self.photons).astype(np.float32)
        coarse = counted.repeat(scale, axis=0).repeat(scale, axis=1)
        *both, sharp = (encode_srgb(np.clip(p, 0, 1))[None] for p in (coarse, restored, truth))
        decibels = [psnr_db(picture, sharp, 1) for picture in both]
        tiles = [np.broadcast_to(picture, (3, *truth.shape)) for picture in (*both, sharp)]
        rows, columns = counted.shape
        title = f"{self.subject}, counted by {columns}x{rows} pixels of single photons"
        return _view(bundle, {title: tiles}, (decibels[0], decibels[1]))


VIEWS: Final[Mapping[str, Callable[[str], View]]] = MappingProxyType(
    {
        "duet": Photograph(scene="coffee.png", subject=COFFEE, middle=(0.55, 0.5)),
        "duet-joint": Photograph(scene="chelsea.png", subject=CAT, middle=(0.5, 0.45)),
        "trio-edof": Photograph(
            scene="chelsea.png", subject=CAT, middle=(0.5, 0.45), depth_mm=700.0
        ),
        "thin-plate": Photograph(scene="coffee.png", subject=COFFEE, middle=(0.55, 0.5)),
        "streak-hdr": Night(stops=(0, -4)),
        "streak-rank1": Night(stops=(0, -4)),
        "deglare": Windshield(seed=6, angle_deg=5.0),
        "spad-sr": Photons(scene="chelsea.png", subject=CAT, photons=3000.0),
    }
)


def _view(
    bundle: Bundle, rows: Mapping[str, Sequence[FloatArray]], decibels: tuple[float, float]
) -> View:
    """Return rows of three pictures with captions; decibels are the same for all rows."""
    before, after = decibels
    captions = (f"{AS_TAKEN}: {before:.1f} dB", f"{RESTORED}: {after:.1f} dB", TRUTH)
    return View(
        title=f"{bundle.manifest.name} {bundle.manifest.version}",
        rows={title: dict(zip(captions, row, strict=True)) for title, row in rows.items()},
    )


def _exposure(stop: int) -> str:
    return f"{-stop} stops darker" if stop else "as exposed"


def _deglared(picture: FloatArray) -> tuple[Glare, FloatArray]:
    """Remove the streaks from a picture (3, h, w) that clips at 1, as the bundle does."""
    entry = Deglare()
    settings = GlareSettings(
        least_rad=math.radians(entry.least_angle_deg),
        most_rad=math.radians(entry.most_angle_deg),
        reach=entry.reach,
        level=entry.level,
    )
    _, height, width = picture.shape
    glare = find_glare(lambda: lambda top, bottom: picture[:, top:bottom], height, width, settings)
    cleared = picture.copy()
    glare.paint(cleared, 0, (1.0, 1.0, 1.0))
    return glare, cleared
