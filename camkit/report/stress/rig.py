"""Every method on one capture, by the pipeline itself: the input, the bank, the networks.

    scene -> light through a lens -> capture -> the walker, once per method -> light and picture

What methods share (the planes in front of the first network) is computed once and kept.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network
from camkit.errors import ContractError
from camkit.report.kind_finder import check_photographs
from camkit.report.sensor_geometry import in_sensor_geometry
from camkit.report.stress.scene import Scene
from camkit.report.stress.shot import NOISE_SEED, Shot
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.capture import Capture
from camkit.runtime.job.stream import Stream
from camkit.runtime.kind import part_of
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import DEVELOP, Work
from camkit.runtime.plan.rules.size import REFERENCE
from camkit.runtime.plan.ways import offered_methods, planned
from camkit.runtime.stage_finder import module_of
from camkit.runtime.twin.exposure import Setting, expose, levels_of, noise_of
from camkit.runtime.twin.light import (
    Lens,
    Light,
    LightOptions,
    Response,
    lens_of,
    light_of,
    scene_window,
    stated_balance,
)
from camkit.runtime.twin.truth import light_sensor

INPUT: Final = "input"
EARLIER_MARK: Final = "before"
"""Marks the networks of the bundle that is compared with: "M before"."""
KEPT_KERNELS: Final = 256
"""Of a haze: those of the places around one scene, a few 100 MB at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """One way to restore.

    Attributes:
        name: As reports have it.
        pipeline: What does it, on one thread.
        plane: Name of the plane that holds the restored light; None if none does.
        networks: Whether networks take part.
    """

    name: str
    pipeline: Pipeline
    plane: str | None
    networks: bool

    @property
    def bundle(self) -> Bundle:
        """Return the bundle that does it."""
        assert self.pipeline.bundle is not None
        return self.pipeline.bundle


@dataclass(frozen=True, slots=True, kw_only=True)
class Restored:
    """One capture, restored by the methods.

    Attributes:
        planes: Method -> (c, s h, s w) float32 restored light in the geometry of the sensor,
            white-balanced, vignetting still in; empty where no plane holds it.
        pictures: Method -> (3, h, w) linear Rec.709, the product `image` in sensor geometry.
        faults: Method -> why it gave nothing.
    """

    planes: Mapping[str, FloatArray]
    pictures: Mapping[str, FloatArray]
    faults: Mapping[str, str]


class Rig:
    """A bundle with its methods made ready, and the lights that its scenarios share.

    Attributes:
        sensor: Of the camera.
        lens: Through which captures are taken: the bundle's, at its reference depth.
        assumed_lens: What restorations go by: the kernels of the bank. Another one only where
            the bundle knows several depths.
        methods: From doing nothing to the networks, those of `earlier_bundle` last.
        rivals: Names of the methods that the others must not fall behind.
    """

    def __init__(
        self,
        bundle: Bundle,
        sizes: Sequence[str],
        *,
        earlier_bundle: Bundle | None = None,
        option_fields: Mapping[str, Any] | None = None,
    ) -> None:
        """Make the methods ready.

        Args:
            bundle: What is tested.
            sizes: Of its networks.
            earlier_bundle: Another bundle of the same camera, whose networks stand beside.
            option_fields: Further fields of `Options`, for all methods.

        Raises:
            ContractError: If the bundle states no optics, or lacks a size.
            UnsupportedError: If its sensor counts photons.
        """
        check_photographs(
            bundle.manifest,
            "this judges cameras by their optics (`camkit bench --capture FILE` measures others)",
        )
        self.bundle = bundle
        self.earlier_bundle = earlier_bundle
        self.sensor = light_sensor(bundle.manifest)
        self._sizes = tuple(sizes)
        self._option_fields = dict(option_fields or {})
        networks = _networks(bundle, sizes, "", self._option_fields)
        if earlier_bundle is not None:
            have = [size for size in sizes if size in earlier_bundle.manifest.sizes]
            networks += _networks(earlier_bundle, have, f" {EARLIER_MARK}", self._option_fields)
        simple = _simple(bundle, self._option_fields)
        self.methods = (*simple, *networks)
        judged = networks or simple[1:]
        self.rivals = tuple(m.name for m in self.methods if m not in judged)
        self.lens = self.lens_at(bundle.reference_depth_mm)
        depth_mm = Options(**self._option_fields).depth_mm
        share = bundle.haze.core_share if bundle.manifest.has_haze else None
        response = self.sensor.response_arrays()
        kernels = color_kernels(bundle.psf, *response, depth_mm=depth_mm, share=share)
        self.assumed_lens = replace(self.lens, kernels_at=kernels.at)
        self._from_array = part_of(bundle.manifest).from_array
        self._lights: dict[str, Light] = {}
        self._others: dict[tuple[tuple[str, Any], ...], Rig] = {}
        self._last: tuple[Capture, Restored] | None = None

    def choosing(self, **fields: Any) -> "Rig":
        """Return a rig like this one whose methods have further options; it is kept."""
        key = tuple(sorted(fields.items()))
        if key not in self._others:
            options = self._option_fields | fields
            self._others[key] = Rig(
                self.bundle, self._sizes, earlier_bundle=self.earlier_bundle, option_fields=options
            )
        return self._others[key]

    @property
    def networks(self) -> tuple[Method, ...]:
        """Return the methods in which networks take part."""
        return tuple(m for m in self.methods if m.networks)

    @property
    def primary(self) -> str:
        """Name the method whose break point is the scenario's: the usual size, else the first."""
        names = [m.name for m in self.methods if m.name not in self.rivals]
        return REFERENCE if REFERENCE in names else (*names, INPUT)[0]

    def lens_at(self, depth_mm: float) -> Lens:
        """Return the lens as the bundle knows it, for one object distance."""
        return self._lens(depth_mm)

    def lens_under(self, response: Response) -> Lens:
        """Return the lens at the reference depth where wavelengths weigh as `lens_of` says."""
        return self._lens(self.bundle.reference_depth_mm, response)

    def _lens(self, depth_mm: float, response: Response | None = None) -> Lens:
        haze = self.bundle.haze if self.bundle.manifest.has_haze else None
        lens = lens_of(
            self.bundle.psf, self.sensor, depth_mm=depth_mm, haze=haze, response=response
        )
        if lens.haze is None:
            return lens
        # what every method made of a capture is spread by the same kernels
        haze_kernels = lru_cache(maxsize=KEPT_KERNELS)(lens.haze.haze_at)
        return replace(lens, haze=replace(lens.haze, haze_at=haze_kernels))

    def light(self, scene: Scene, lens: Lens | None = None) -> Light:
        """Project a scene on the sensor; that through the nominal lens is kept by its name."""
        if lens is None and scene.name in self._lights:
            return self._lights[scene.name]
        light = self.light_amid(scene, scene.linear, lens)
        if lens is None:
            self._lights[scene.name] = light
        return light

    def light_in_place(self, scene: Scene) -> Light:
        """Project a scene on the sensor through the nominal lens, as if it distorted nothing.

        Scene, mirror images around it and capture are then in one geometry: what is photographed
        again after restoration meets the same haze.
        """
        return self.light_amid(scene, scene.linear, distort=False)

    def light_amid(
        self,
        scene: Scene,
        surroundings: FloatArray,
        lens: Lens | None = None,
        *,
        distort: bool = True,
    ) -> Light:
        """Project a scene on the sensor with what surrounds it.

        Args:
            scene: What is in the picture.
            surroundings: (3, h', w') linear Rec.709: the scene, or it with as much on every side
                of it.
            lens: None for the nominal one.
            distort: Whether the lens distorts.
        """
        extent, scale = self.sensor.known_extent, scene.scale
        ring_px = (surroundings.shape[1] - scene.linear.shape[1]) // (2 * scale)
        origin = scene.origin_px((extent.width_px, extent.height_px))
        window = scene_window(surroundings, self.sensor, origin, scale=scale, surround_px=ring_px)
        options = LightOptions(scale=scale, surround_px=ring_px, distort=distort)
        return light_of(surroundings, self.sensor, lens or self.lens, window, options)

    def shoot(self, scene: Scene, lens: Lens | None = None, setting: Setting | None = None) -> Shot:
        """Record a scene through a lens (None: the nominal one) with a setting of the camera."""
        return self.record(scene, self.light(scene, lens), setting)

    def record(self, scene: Scene, light: Light, setting: Setting | None = None) -> Shot:
        """Record light; the same scene has the same noise seed in every scenario."""
        seeded_setting = replace(setting or Setting(), seed=NOISE_SEED + scene.number)
        samples = expose(light, self.sensor, seeded_setting)
        x, y = (int(v) for v in light.window.origin_px)
        balance = stated_balance(light.gains)
        raw_capture = self._from_array(
            samples,
            self.bundle.manifest,
            iso=seeded_setting.iso,
            white_balance=balance,
            origin_px=(x, y),
        )
        black, white = levels_of(self.sensor, seeded_setting)
        capture = replace(
            raw_capture, black_level=np.full_like(raw_capture.black_level, black), white_level=white
        )
        return Shot(
            scene=scene,
            capture=capture,
            light=light,
            sensor=self.sensor,
            exposure=seeded_setting.exposure,
            noise=noise_of(self.sensor, seeded_setting),
        )

    def restore(self, shot: Shot) -> Restored:
        """Restore a capture by every method; what fails is a fault of the method.

        The last result is kept, since a scenario may look at one capture in several ways.
        """
        if self._last is None or not _same(self._last[0], shot.capture):
            self._last = shot.capture, self._restore(shot.capture)
        return self._last[1]

    def _restore(self, capture: Capture) -> Restored:
        planes, pictures, faults = {}, {}, {}
        shared: dict[str, dict[str, Stream]] = {}
        for method in self.methods:
            source = method.bundle.sha256
            if source not in shared:
                shared[source] = self._shared(method.bundle, capture)
            try:
                work = method.pipeline.start(capture, known_planes=shared[source])
                rows = None if method.plane is None else work.keep(method.plane).rows()
                pictures[method.name] = work.fill()
                if rows is not None:
                    planes[method.name] = rows.read(0, rows.shape[1])
            except ContractError as error:
                faults[method.name] = str(error)
        return Restored(planes=planes, pictures=pictures, faults=faults)

    def _shared(self, bundle: Bundle, capture: Capture) -> dict[str, Stream]:
        """Return the planes that the first network takes, which are the same for all sizes."""
        planes: dict[str, Stream] = {}
        first = bundle.manifest.stage(Network)
        method = next((m for m in self.networks if m.bundle is bundle), None)
        if first is None or method is None:
            return planes
        for plane in first.takes:
            planes[plane] = method.pipeline.start(capture, known_planes=planes).keep(plane)
        return planes


def usual_sizes(manifest: Manifest) -> tuple[str, ...]:
    """Return size of network that stands for a bundle: M, else the largest; none without any."""
    return (REFERENCE,) if REFERENCE in manifest.sizes else manifest.sizes[-1:]


def restored_plane(manifest: Manifest) -> str | None:
    """Return the plane that holds the light when all that restores is done; None if none does."""
    last = next((s for s in manifest.stages[::-1] if module_of(s).METHODS), None)
    names = list(manifest.planes)[::-1] if last is None else last.gives
    planes = manifest.planes
    return next((n for n in names if planes[n].domain == "linear" and planes[n].grid.warped), None)


def _networks(
    bundle: Bundle, sizes: Sequence[str], mark: str, option_fields: Mapping[str, Any]
) -> tuple[Method, ...]:
    return tuple(
        _method(bundle, f"{size}{mark}", {"size": size, **option_fields}) for size in sizes
    )


def _simple(bundle: Bundle, option_fields: Mapping[str, Any]) -> tuple[Method, ...]:
    """Return the methods without networks that the bundle offers: nothing, and what comes first."""
    manifest = bundle.manifest
    available = offered_methods(manifest.stages, manifest.all_planes)
    usual = [methods[0] for s in manifest.stages if (methods := module_of(s).METHODS)]
    names = [DEVELOP, *(m for m in usual if not planned(manifest.stages, Work(method=m)).networks)]
    return tuple(
        _method(bundle, INPUT if name == DEVELOP else name, {"method": name, **option_fields})
        for name in names
        if name in available
    )


def _method(bundle: Bundle, name: str, option_fields: Mapping[str, Any]) -> Method:
    options = Options(threads=1, **in_sensor_geometry(bundle.manifest), **option_fields)
    return Method(
        name=name,
        pipeline=Pipeline(bundle, options),
        plane=restored_plane(bundle.manifest),
        networks="size" in option_fields,
    )


def _same(a: Capture, b: Capture) -> bool:
    """Return whether two captures are restored alike."""
    facts = [
        (c.iso, c.white_balance, c.black_level.tolist(), c.white_level, c.origin_px, c.noise)
        for c in (a, b)
    ]
    return facts[0] == facts[1] and np.array_equal(
        a.samples, b.samples, equal_nan=a.samples.dtype == np.float32
    )
