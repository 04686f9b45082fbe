"""The ways of a bundle to the fine grid, and what they are held against.

bare      the array without its plate, by its own linear estimate; of pictures alone
bare net  the same by a network that was trained without a plate, where the baselines hold one
bicubic   the array's pixels, interpolated; of depth, times that were fitted on them
linear    the bundle's linear estimate; of depth, of every bin before the fit
S, M      its networks, however few photons there are; "S before" is that of another bundle
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.report.kinds.spad.bicubic import bicubic
from camkit.report.kinds.spad.stress.spad_shot import DepthShot, PictureShot
from camkit.runtime.kinds.spad.finer.camera import FineCamera, white_of
from camkit.runtime.kinds.spad.finer.depth import FineSharpener
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.finer.sampling import point_kernel
from camkit.runtime.kinds.spad.hot_pixels import painted_over
from camkit.runtime.kinds.spad.scatter import growth
from camkit.runtime.kinds.spad.sharpen import Sharpened, Sharpener, Way

BARE: Final = "bare"
BARE_NET: Final = "bare net"
BICUBIC: Final = "bicubic"
LINEAR: Final = "linear"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ways:
    """Ways that make pictures and depth of captures.

    Attributes:
        camera: The array of the bundle.
        networks: Name -> whose network, and its size.
        plain: The array without a plate, with its network; None where there is none.
    """

    camera: FineCamera
    networks: dict[str, tuple[FineCamera, str]]
    plain: FineCamera | None = None

    def pictures(self, shot: PictureShot) -> dict[str, FloatArray]:
        """Return way -> (m h, m w), white = 1."""
        grid, (bare, plate_photons) = self.camera.grid, shot.photons
        frame = self._sound(shot.counts, shot)
        white = white_of(frame) * shot.white_factor
        plain = self._sound(shot.bare, shot)
        pictures = {BARE: self._bare(plain) / bare}
        if self.plain is not None:
            size = self.plain.size(None)
            pictures[BARE_NET] = finer_frames(self.plain, plain[None], shot.dark, size)[0] / bare
        pictures[BICUBIC] = bicubic(frame, grid) / plate_photons
        pictures[LINEAR] = (
            finer_frames(self.camera, frame[None], shot.dark, None)[0] / plate_photons
        )
        for name, (camera, size) in self.networks.items():
            frames = finer_frames(camera, frame[None], shot.dark, size, white=white)
            pictures[name] = frames[0] / plate_photons
        return {name: np.asarray(picture, np.float32) for name, picture in pictures.items()}

    def depths(self, shot: DepthShot) -> dict[str, Sharpened]:
        """Return way -> what it found of every sub-pixel."""
        way = Way(returns=len(shot.times_ps))
        nothing, no_dark = np.zeros_like(shot.blind), np.zeros(shot.blind.shape)
        coarse = Sharpener(shot.axis, shot.pulse, way)
        growth = _growth(coarse, shot)

        def finer(camera: FineCamera, size: str | None) -> Sharpened:
            fine = FineSharpener(camera, shot.axis, shot.pulse, way, size=size, always=True)
            cube = fine.cube(shot.counts, no_dark, hot=nothing, blind=shot.blind, growth=growth)
            return cube.sharpened

        alone = coarse.strip(shot.counts, blind=shot.blind, growth=growth)
        depths = {BICUBIC: self._upsampled(alone), LINEAR: finer(self.camera, None)}
        return depths | {name: finer(*network) for name, network in self.networks.items()}

    def _sound(self, counts: FloatArray, shot: PictureShot) -> FloatArray:
        frame = np.asarray(counts - shot.dark, np.float32)
        return painted_over(frame, shot.hot) if shot.hot.any() else frame

    def _bare(self, frame: FloatArray) -> FloatArray:
        photons = max(float(frame.mean(dtype=np.float64)), 0.0)
        side = self.camera.kernel.shape[0]
        estimate = self.camera.linear(photons, point_kernel(side))
        return np.asarray(np.maximum(estimate(frame[None])[0], 0), np.float32)

    def _upsampled(self, depth: Sharpened) -> Sharpened:
        scale = self.camera.scale
        layers = np.asarray(depth.time_of_flight_ps, np.float32)
        times = np.stack([bicubic(layer, self.camera.grid) for layer in layers])
        return replace(
            depth,
            time_of_flight_ps=times.astype(np.float64),
            sigma_ps=depth.sigma_ps.repeat(scale, axis=1).repeat(scale, axis=2),
            valid=depth.valid.repeat(scale, axis=1).repeat(scale, axis=2),
        )


def _growth(sharpener: Sharpener, shot: DepthShot) -> NDArray[np.float64] | None:
    """Return (h, w) how much more counts scatter for pile-up; None where it took little."""
    if shot.cycles == 0:
        return None
    flat = shot.counts.reshape(-1, shot.counts.shape[2])
    return growth(sharpener.fitter, flat, shot.cycles).reshape(shot.blind.shape)
