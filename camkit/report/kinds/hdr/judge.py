"""Worth of a method on a capture with lights: linear PSNR to 2^8, stops, what did not clip.

    scene with lights -> HdrJudge.shoot -> capture with streaks, capture of the bare lens, truth
                      -> HdrJudge.score -> every method; the input is the bare lens, developed

Shots of scenarios that serve every camera go to the common judge.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import psf_of_streaks
from camkit.bundle.reader import Bundle
from camkit.psf import FrozenPsf
from camkit.report.hdr_score import mu_law, psnr_db, stops_rmse
from camkit.report.kinds.hdr.capture import clipped_planes, developer
from camkit.report.kinds.hdr.lights import exposed_night
from camkit.report.stress.rig import INPUT, Restored, Rig
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, Numbers, digest_of, see, worst_patch
from camkit.report.stress.shot import Shot
from camkit.report.stress.verdict import Outcome, Verdict
from camkit.runtime.capture import Capture
from camkit.runtime.twin.exposure import Setting
from camkit.runtime.twin.light import Lens, Light, lens_of
from camkit.runtime.twin.simulate import bare_psf
from camkit.runtime.twin.truth import true_picture
from camkit.scenes.saturation import CEILING
from camkit.streaks import StreakOptics

SATURATED: Final = 0.015
"""Share of a scene that saturates unless a scenario says otherwise."""
TIE_DB: Final = 0.5
GOOD_DB: Final = 65.0
"""A result this good may lie below a still better input."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HdrShot:
    """A scene with lights, photographed.

    Attributes:
        coded: The capture with streaks.
        bare: That of the bare lens.
        truth: (3, h, w) linear Rec.709.
    """

    coded: Shot
    bare: Capture
    truth: FloatArray


class HdrJudge:
    """Scores captures of cameras that read clipped lights from streaks.

    Attributes:
        rig: The methods.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._common = Judge(rig)
        self._developer = developer(rig.bundle, threads=1)
        self._scored: dict[bytes, Verdict] = {}
        self._lit: dict[tuple[str, float], Scene] = {}
        self._last: tuple[Scene, tuple[Light, Light]] | None = None

    @property
    def methods(self) -> tuple[str, ...]:
        """Name the methods, from doing nothing to the networks."""
        return self._common.methods

    @property
    def rivals(self) -> tuple[str, ...]:
        """Name the one that nothing may fall behind: the picture of an ordinary lens."""
        return (INPUT,)

    @property
    def primary(self) -> str:
        """Name the method whose break point is the scenario's."""
        return self._common.primary

    @property
    def identity(self) -> tuple[object, ...]:
        """Return bundles and methods."""
        return ("hdr", *self._common.identity)

    def judge(
        self, shot: Shot, restored: Restored, *, with_chi2: bool = True
    ) -> dict[str, Outcome]:
        """Judge a capture of a common scenario; see `Judge.judge`."""
        return self._common.judge(shot, restored, with_chi2=with_chi2)

    def examine(self, shot: Shot, numbers: Numbers) -> Verdict:
        """Judge a capture of a scene of its own; see `Judge.examine`."""
        return self._common.examine(shot, numbers)

    def lit(self, scene: Scene, share: float = SATURATED) -> Scene:
        """Return the lights that belong to a scene, exposed so that a share of it saturates."""
        key = scene.name, share
        if key not in self._lit:
            linear = exposed_night(scene, self.rig.sensor, share)
            self._lit = {key: scene.showing(linear, f"{scene.name} lit {share:g}")}
        return self._lit[key]

    def shoot(
        self,
        scene: Scene,
        *,
        lens: Lens | None = None,
        setting: Setting | None = None,
        surroundings: FloatArray | None = None,
    ) -> HdrShot:
        """Photograph a scene with and without the plate.

        Args:
            scene: What is in the picture.
            lens: With its plate, as it really is; None for the one that the bundle knows.
            setting: Of the camera.
            surroundings: (3, h', w') linear Rec.709: the scene with as much on every side of it;
                None where it goes on as its mirror image.
        """
        is_nominal = lens is None and surroundings is None
        if is_nominal and self._last is not None and self._last[0] is scene:
            coded, bare = self._last[1]
        else:
            light_map = scene.linear if surroundings is None else surroundings
            lenses = (lens, self._bare_lens)
            coded, bare = (self.rig.light_amid(scene, light_map, each) for each in lenses)
            self._last = (scene, (coded, bare)) if is_nominal else self._last
        return HdrShot(
            coded=self.rig.record(scene, coded, setting),
            bare=self.rig.record(scene, bare, setting).capture,
            truth=true_picture(coded.clean, self.rig.sensor),
        )

    def score(self, shot: Shot | HdrShot) -> Verdict:
        """Restore a capture by every method and judge it; equal captures are judged once."""
        if isinstance(shot, Shot):
            return self._common.score(shot)
        key = _digest(shot)
        if key not in self._scored:
            outcomes = self._outcomes(shot)
            self._scored[key] = Verdict(outcomes=outcomes, seen=see(self.rig, shot.coded))
        return self._scored[key]

    def pictures(self, shot: Shot | HdrShot) -> dict[str, FloatArray]:
        """Return the truth and what every method made, to look at; lights by the mu-law."""
        if isinstance(shot, Shot):
            return self._common.pictures(shot)
        pictures = {"sharp": shot.truth, **self._restored(shot)[0]}
        return {name: mu_law(picture).astype(np.float32) for name, picture in pictures.items()}

    def lens_of(self, streaks: StreakOptics) -> Lens:
        """Return the lens that writes other streaks than the bundle knows."""
        return self._at_focus(psf_of_streaks(streaks, len(self.rig.sensor.channels)))

    @cached_property
    def _bare_lens(self) -> Lens:
        return self._at_focus(bare_psf(self.rig.bundle))

    def _at_focus(self, psf: FrozenPsf) -> Lens:
        return lens_of(psf, self.rig.sensor, depth_mm=self.rig.bundle.reference_depth_mm)

    def _restored(self, shot: HdrShot) -> tuple[dict[str, FloatArray], dict[str, str]]:
        """Return the picture of every method, and why some gave none."""
        restored = self.rig.restore(shot.coded)
        developed = {INPUT: self._developer.start(shot.bare).fill()}
        return {**restored.pictures, **developed}, dict(restored.faults)

    def _outcomes(self, shot: HdrShot) -> dict[str, Outcome]:
        pictures, faults = self._restored(shot)
        compare = _Comparison(shot)
        input_outcome = compare.outcome(pictures[INPUT])
        outcomes = {name: Outcome(psnr_db=None, fault=fault) for name, fault in faults.items()}
        for name, picture in pictures.items():
            least = compare.errors(pictures[INPUT]) if name != INPUT else 0.0
            outcome = compare.outcome(picture, least)
            fault = (
                outcome.fault
                if name == INPUT
                else outcome.fault or shortfall(outcome, input_outcome)
            )
            outcomes[name] = replace(outcome, fault=fault)
        return {name: outcomes[name] for name in self.methods if name in outcomes}


def shortfall(outcome: Outcome, input_outcome: Outcome) -> str | None:
    """Return how far a result lies below the input, where that is a fault; else None."""
    if outcome.psnr_db is None or input_outcome.psnr_db is None:
        return None
    lost_db = input_outcome.psnr_db - outcome.psnr_db
    if lost_db <= TIE_DB or outcome.psnr_db >= GOOD_DB:
        return None
    return f"{lost_db:.1f} dB below the input, at {outcome.psnr_db:.1f} dB"


def hdr_judge_of(bundle: Bundle, sizes: tuple[str, ...], earlier_bundle: Bundle | None) -> HdrJudge:
    """Return the judge of a snapshot HDR camera.

    Args:
        bundle: What is tested.
        sizes: Of its networks.
        earlier_bundle: Another bundle of the same camera, whose networks stand beside.
    """
    return HdrJudge(Rig(bundle, sizes, earlier_bundle=earlier_bundle))


class _Comparison:
    """The truth of a shot, against which pictures are rated."""

    def __init__(self, shot: HdrShot) -> None:
        self._truth = shot.truth
        border = shot.coded.border_px
        self._inside = np.s_[:, border : -border or None, border : -border or None]
        captures = (shot.coded.capture, shot.bare)
        masks = [np.asarray(clipped_planes(capture).any(axis=0)) for capture in captures]
        scale = shot.coded.scene.scale
        self._clipped = np.logical_or(*masks).repeat(scale, axis=0).repeat(scale, axis=1)

    def errors(self, picture: FloatArray) -> NDArray[np.float64]:
        """Return (h, w) squared errors, the mean over the colours; 0 in the border."""
        error = np.zeros(picture.shape[1:])
        difference = picture.astype(np.float64) - self._truth
        error[self._inside[1:]] = np.square(difference[self._inside]).mean(axis=0)
        return error

    def outcome(self, picture: FloatArray, least: NDArray[np.float64] | float = 0.0) -> Outcome:
        """Rate a picture; its worst patch is where its error exceeds `least` most."""
        if not np.isfinite(picture).all():
            return Outcome(psnr_db=None, fault="NaN or inf in the picture")
        got, truth = picture[self._inside], self._truth[self._inside]
        squared = np.square(got.astype(np.float64) - truth)
        unclipped = ~self._clipped[self._inside[1:]]
        extra = {}
        if unclipped.any():
            extra["unclipped_psnr_db"] = psnr_db(float(squared[:, unclipped].mean()))
        stops = stops_rmse(got, truth)
        return Outcome(
            psnr_db=psnr_db(float(squared.mean()), CEILING),
            patch_px=worst_patch(self.errors(picture) - least),
            extra=extra if stops is None else {"stops_rmse": stops, **extra},
        )


def _digest(shot: HdrShot) -> bytes:
    """Return what decides the verdict on a shot."""
    capture = shot.coded.capture
    facts = (capture.iso, capture.white_level, capture.white_balance, shot.coded.border_px)
    return digest_of(facts, (capture.samples, shot.bare.samples, shot.truth))
