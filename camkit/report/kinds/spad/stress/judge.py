"""The examiner of single photons: takes captures, lets every way work on them, and judges."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.report.kinds.spad.stress.spad_scene import SpadScene
from camkit.report.kinds.spad.stress.spad_score import (
    depth_errors,
    depth_outcome,
    picture_errors,
    picture_outcome,
)
from camkit.report.kinds.spad.stress.spad_shot import (
    DepthSetting,
    DepthShot,
    PictureSetting,
    PictureShot,
)
from camkit.report.kinds.spad.stress.studio import Studio
from camkit.report.kinds.spad.stress.way import BARE, BARE_NET, BICUBIC, LINEAR, Ways
from camkit.report.kinds.spad.ways import read_baselines
from camkit.report.stress.rig import EARLIER_MARK
from camkit.report.stress.verdict import Outcome, Verdict
from camkit.runtime.kinds.spad.finer.camera import DEFAULT_SIZE, FineCamera

PLAIN: Final = "low_fill"
"""Role of the network without a plate, of the baselines."""
VERSION: Final = 2
"""Raised when the same bundle gives other points than before."""


class SpadJudge:
    """Judges captures of one array.

    Attributes:
        studio: Takes them.
        ways: Work on them.
    """

    def __init__(self, studio: Studio, ways: Ways, earlier_bundle: Bundle | None = None) -> None:
        self.studio, self.ways = studio, ways
        self._earlier_bundle = earlier_bundle
        self._undisturbed: dict[str, Mapping[str, float]] = {}

    @property
    def methods(self) -> tuple[str, ...]:
        """Name the ways, from an array without a plate to the networks."""
        return (*self.rivals, LINEAR, *self.ways.networks)

    @property
    def rivals(self) -> tuple[str, ...]:
        """Name those that make do without the plate, or without the fine grid."""
        return (BARE, BICUBIC) if self.ways.plain is None else (BARE, BARE_NET, BICUBIC)

    @property
    def primary(self) -> str:
        """Name M, or the largest network there is, or the linear estimate."""
        networks = [name for name in self.ways.networks if EARLIER_MARK not in name]
        return DEFAULT_SIZE if DEFAULT_SIZE in networks else (networks or [LINEAR])[-1]

    @property
    def identity(self) -> tuple[object, ...]:
        """Return bundles and ways."""
        plain = None if self.ways.plain is None else self.ways.plain.bundle
        others = [b.sha256 for b in (self._earlier_bundle, plain) if b is not None]
        return ("spad", VERSION, self.ways.camera.bundle.sha256, others, self.methods)

    def shoot(
        self, scene: SpadScene, setting: PictureSetting, *, with_chi2: bool = False
    ) -> PictureShot:
        """Count a picture; for chi^2 the undisturbed one is counted too."""
        shot = self.studio.picture(scene, setting)
        return replace(shot, undisturbed=self.undisturbed(scene)) if with_chi2 else shot

    def scan(self, scene: SpadScene, setting: DepthSetting) -> DepthShot:
        """Count surfaces by time."""
        return self.studio.depth(scene, setting)

    def score(self, shot: PictureShot | DepthShot) -> Verdict:
        """Run every way on a capture, and judge what came out."""
        if isinstance(shot, DepthShot):
            return Verdict(outcomes=self._depths(shot))
        return Verdict(outcomes=self._pictures(shot))

    def pictures(self, shot: PictureShot | DepthShot) -> dict[str, FloatArray]:
        """Return the truth and what every way made, grey; depth is brighter the later it is."""
        if isinstance(shot, PictureShot):
            pictures = {"sharp": shot.truth, **self.ways.pictures(shot)}
        else:
            depths = self.ways.depths(shot)
            edges = shot.axis.edges_ps
            truth = (shot.times_ps[0] - edges[0]) / (edges[-1] - edges[0])
            pictures = {"sharp": np.asarray(truth, np.float32)}
            pictures |= {name: depth_errors(s, shot).preview for name, s in depths.items()}
        return {name: np.repeat(picture[None], 3, axis=0) for name, picture in pictures.items()}

    def undisturbed(self, scene: SpadScene) -> Mapping[str, float]:
        """Return way -> mean squared error on the undisturbed capture of a scene."""
        if scene.name not in self._undisturbed:
            shot = self.shoot(scene, PictureSetting())
            errors = {n: picture_errors(p, shot.truth) for n, p in self.ways.pictures(shot).items()}
            self._undisturbed[scene.name] = {n: float(e.mean()) for n, e in errors.items()}
        return self._undisturbed[scene.name]

    def _pictures(self, shot: PictureShot) -> dict[str, Outcome]:
        pictures = self.ways.pictures(shot)
        errors = {name: picture_errors(picture, shot.truth) for name, picture in pictures.items()}
        least = np.minimum.reduce([errors[name] for name in self.rivals])
        nominal = shot.undisturbed or {}
        return {
            name: picture_outcome(e, 0.0 if name in self.rivals else least, nominal.get(name))
            for name, e in errors.items()
        }

    def _depths(self, shot: DepthShot) -> dict[str, Outcome]:
        depths = self.ways.depths(shot)
        plain = np.abs(depth_errors(depths[BICUBIC], shot).first_ps)
        return {
            name: depth_outcome(s, shot, 0.0 if name == BICUBIC else plain)
            for name, s in depths.items()
        }


def spad_judge_of(
    bundle: Bundle, sizes: tuple[str, ...], earlier_bundle: Bundle | None
) -> SpadJudge:
    """Return the examiner of a bundle.

    Args:
        bundle: What is tested.
        sizes: Of its networks.
        earlier_bundle: Another bundle of the same camera, whose networks stand beside.

    Raises:
        BundleError: If it makes no picture of photons finer.
        ContractError: If it has no network of a size.
    """
    camera = FineCamera.of(bundle)
    networks = {size: (camera, camera.size(size)) for size in sizes}
    if earlier_bundle is not None:
        other = FineCamera.of(earlier_bundle)
        networks |= {f"{s} {EARLIER_MARK}": (other, s) for s in sizes if s in other.sizes}
    plain = read_baselines(camera).cameras.get(PLAIN)
    ways = Ways(camera=camera, networks=networks, plain=plain)
    return SpadJudge(Studio(camera=camera), ways, earlier_bundle)
