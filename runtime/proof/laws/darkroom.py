"""Scenes photographed by a bundle's twin, and what networks and their front end make of them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Color, Undistort
from camkit.runtime.job.choices import known_options
from camkit.runtime.kind import part_of, photograph_by_twin
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import Work
from camkit.runtime.plan.ways import without_networks
from camkit.runtime.twin.exposure import Setting
from camkit.runtime.twin.light import stated_balance
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, photograph_series
from camkit.runtime.twin.truth import light_sensor, true_picture

PLACES: Final = {"middle": 0.0, "half-way": 0.5, "corner": 1.0}
"""Place on the sensor -> share of the way from its middle to its corner."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposed:
    """A scene as the camera sees it, and pictures of it.

    Attributes:
        truth: (3, h, w) linear Rec.709.
        network: Picture behind the networks.
        front: Picture of the front end alone, as the camera has it without its networks.
        light: (c, h, w) of `network` in the colours of the camera.
        front_light: Likewise of `front`.
    """

    truth: FloatArray
    network: FloatArray
    front: FloatArray
    light: FloatArray
    front_light: FloatArray


@dataclass(frozen=True, kw_only=True)
class Darkroom:
    """A bundle with one size of its networks, and its twin.

    Attributes:
        bundle: The camera; its twin photographs, and its networks can be left out.
        size: Of the networks.
        threads: To compute with.
    """

    bundle: Bundle
    size: str
    threads: int

    @cached_property
    def isos(self) -> tuple[float, float]:
        """Lowest and highest ISO that the bundle states."""
        isos = [entry.iso for entry in light_sensor(self.bundle.manifest).noise]
        return min(isos), max(isos)

    @cached_property
    def depth_mm(self) -> float | None:
        """Distance of the scenes."""
        return None if self.bundle.manifest.optics is None else self.bundle.reference_depth_mm

    @cached_property
    def _networks(self) -> Pipeline:
        return Pipeline(
            self.bundle, Options(size=self.size, threads=self.threads, **self._undistorted())
        )

    @cached_property
    def _front(self) -> Pipeline:
        work = without_networks(self.bundle.manifest, Work())
        assert work is not None
        return Pipeline(
            self.bundle, Options(method=work.method, threads=self.threads, **self._undistorted())
        )

    def _undistorted(self) -> dict[str, Any]:
        """Return the options of pictures that lie where their scene does: without distortion."""
        names = known_options(self.bundle.manifest.stages)
        return {"undistort": False} if "undistort" in names else {}

    def origin_px(self, place: str, size_px: tuple[int, int]) -> tuple[int, int] | None:
        """Return the place of a crop of (height, width); None for a sensor of any size."""
        extent = self.bundle.manifest.sensor.extent
        if extent is None:
            return None
        share = PLACES[place]
        room = extent.width_px - size_px[1], extent.height_px - size_px[0]
        left, top = (int(side / 2 * (1 + share)) // 2 * 2 for side in room)
        return left, top

    def expose(
        self, scene: FloatArray, place: str, settings: Sequence[Setting]
    ) -> Iterator[Exposed]:
        """Photograph a scene with every setting, and make both pictures of each capture."""
        options = SimulationOptions(
            origin_px=self.origin_px(place, scene.shape[1:]),
            depth_mm=self.depth_mm,
            distort=False,  # parts of a chart stay where they are drawn
        )
        for simulation in self._photographs(scene, options, settings):
            network, light = self._pictures(self._networks, simulation)
            front, front_light = self._pictures(self._front, simulation)
            yield Exposed(
                truth=true_picture(simulation.clean, light_sensor(self.bundle.manifest)),
                network=network,
                front=front,
                light=light,
                front_light=front_light,
            )

    def _photographs(
        self, scene: FloatArray, options: SimulationOptions, settings: Sequence[Setting]
    ) -> Iterable[Simulation]:
        simulate = part_of(self.bundle.manifest).simulate
        if simulate is photograph_by_twin:  # whose light is projected once
            return photograph_series(scene, self.bundle, options, settings)
        words = ("iso", "exposure", "seed", "noise")
        every = ({word: getattr(setting, word) for word in words} for setting in settings)
        return (simulate(scene, self.bundle, replace(options, **some)) for some in every)

    def _pictures(
        self, pipeline: Pipeline, simulation: Simulation
    ) -> tuple[FloatArray, FloatArray]:
        """Return the picture, and its light before the colours of the output."""
        x_px, y_px = simulation.window.origin_px
        capture = pipeline.capture_of(
            simulation.samples,
            iso=simulation.iso,
            white_balance=stated_balance(simulation.white_balance),
            origin_px=(int(x_px), int(y_px)),
        )
        work = pipeline.start(capture)
        colour = self.bundle.manifest.stage(Color)
        assert colour is not None
        stream = work.keep(colour.takes[0])
        height = stream.shape[1]
        light = np.asarray(stream.rows().read(0, height), np.float32)
        return work.fill(), light


def reason_not_judged(bundle: Bundle) -> str | None:
    """Return why no laws of photographs can be held against a bundle; None if they can."""
    manifest = bundle.manifest
    if manifest.stage(Color) is None:
        return "it makes no photographs"
    if not manifest.networks:
        return "no network"
    if not manifest.is_trained:
        return "its weights are random"
    if not manifest.has_kernels:
        return "its optics have no kernels, so there is no twin that photographs"
    if without_networks(manifest, Work()) is None:
        return "its networks cannot be left out"
    grid = manifest.planes[manifest.products["image"]].grid
    if manifest.stage(Undistort) is None and not grid.warped:
        return "its pictures lie on another grid than its captures"
    return None
