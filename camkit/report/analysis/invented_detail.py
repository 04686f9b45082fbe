"""`camkit analyse hallucination`: what restored pictures show that their captures do not hold.

    pictures -> captures -> every method -> patches: against the truth, and against the capture
                                         -> the same with detail planted: the control

Measures against the truth say how wrong a patch is, chi^2 how far it is from its capture, in all
and in its detail. No picture is without residual at edges, where demosaicking and regularisation
leave some; so what counts is the excess: chi^2 of detail less that of the filter alone. Below 0 the
capture confirms what a method added, above 0 it denies it. Detail that the optics pass nothing of
is denied by no capture; only the truth knows it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.colorimetry import encode_srgb
from camkit.errors import ContractError
from camkit.progress import counted
from camkit.report.analysis.patches import MEASURES, Patch, corners_of, measure_patches, summary
from camkit.report.analysis.perceptual import SUBSTITUTE, Measure, looks_different
from camkit.report.analysis.planted import plant
from camkit.report.analysis.point_image import Array
from camkit.report.analysis.unexplained import unexplained
from camkit.report.stress.rig import INPUT, Rig, usual_sizes
from camkit.report.stress.scene import Scene
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting
from camkit.runtime.twin.light import Lens
from camkit.runtime.twin.truth import true_picture

SIDE_PX: Final = 64
WORST: Final = 16
TRUTH: Final = "truth"
"""The method whose chi^2 must be about 1."""
PLANTED: Final = " planted"


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Settings of the measurement.

    Attributes:
        iso: Sensitivity.
        side_px: Of a patch.
        sizes: Of the networks; empty for the usual one.
        perceptual: Gives (h, w) of two pictures of sRGB values.
        perceptual_name: Which it is.
    """

    iso: float = 100.0
    side_px: int = SIDE_PX
    sizes: tuple[str, ...] = ()
    perceptual: Measure = looks_different
    perceptual_name: str = SUBSTITUTE

    def __post_init__(self) -> None:
        if self.side_px < 16 or self.side_px % 2:
            raise ContractError(f"a patch has an even side of at least 16 px; got {self.side_px}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Crop:
    """A patch to look at, sRGB values (3, n, n).

    Attributes:
        patch: What is known of it.
        truth: The scene.
        capture: Developed only.
        restored: By the method.
    """

    patch: Patch
    truth: FloatArray
    capture: FloatArray
    restored: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """One method, measured.

    Attributes:
        name: As reports have it.
        patches: Of all pictures, each row by row.
        worst: Of the largest excess, the first the worst; none of the truth.
    """

    name: str
    patches: tuple[Patch, ...]
    worst: tuple[Crop, ...] = ()

    def values(self, measure: str) -> Array:
        """Return a measure of every patch."""
        return np.array([patch.values[measure] for patch in self.patches])

    def maps(self, measure: str) -> dict[str, Array]:
        """Return a measure of the patches of every picture, by row and column."""
        by_scene: dict[str, list[Patch]] = {}
        for patch in self.patches:
            by_scene.setdefault(patch.scene, []).append(patch)
        return {
            scene: np.array([patch.values[measure] for patch in patches]).reshape(
                -1, len({patch.place[1] for patch in patches})
            )
            for scene, patches in by_scene.items()
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """Detail that was planted into the pictures of one method.

    Attributes:
        method: Which.
        planted: How many patches.
        detected: How many of them have a larger excess than 99 of 100 patches of the method itself.
        first: How many of as many patches of the largest excess are among them.
        rise: Least `detail` of a planted patch less that of the same patch without.
    """

    method: str
    planted: int
    detected: int
    first: int
    rise: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _View:
    """A capture and what it is compared with: truth and capture as sRGB, the filter's detail."""

    shot: Shot
    truth: FloatArray
    capture: FloatArray
    filtered: Array
    lens: Lens


@dataclass(slots=True, kw_only=True)
class _Gathered:
    """Patches of a method, gathered picture by picture."""

    patches: list[Patch] = field(default_factory=list)
    crops: list[Crop] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Results of the analysis.

    Attributes:
        options: What was measured.
        methods: The truth first, then from doing nothing to the networks, the control last.
        control: How well it was found.
    """

    options: Options
    methods: tuple[Method, ...]
    control: Control

    def method(self, name: str) -> Method:
        """Return a method by its name."""
        return next(method for method in self.methods if method.name == name)


def analyse(bundle: Bundle, scenes: Sequence[Scene], options: Options) -> Report:
    """Restore the captures of scenes and judge the patches.

    Args:
        bundle: The camera.
        scenes: Sharp, at their places on the sensor.
        options: Settings of the measurement.

    Raises:
        ContractError: If a scene holds no whole patch.
    """
    rig = Rig(bundle, options.sizes or usual_sizes(bundle.manifest))
    filtered = next(m.name for m in rig.methods[::-1] if not m.networks)
    primary = rig.primary if rig.networks else filtered
    gathered: dict[str, _Gathered] = {}
    places: set[tuple[str, tuple[int, int]]] = set()
    for scene in counted(scenes, "judging", "pictures"):
        light = rig.light_in_place(scene)
        shot = rig.record(scene, light, Setting(iso=options.iso))
        pictures = _restored(rig, shot)
        clean = true_picture(shot.light.clean, rig.sensor)
        truth = encode_srgb(clean)
        corners = corners_of(truth.shape[1], truth.shape[2], options.side_px)
        if not corners:
            raise ContractError(
                f"{scene.name} holds no patch of {options.side_px} px within its border"
            )
        control = plant(pictures[primary], corners, options.side_px, seed=scene.number)
        places |= {(scene.name, place) for place in control.places}
        pictures |= {primary + PLANTED: control.picture}
        view = _View(
            shot=shot,
            truth=truth,
            capture=encode_srgb(pictures[INPUT]),
            filtered=unexplained(pictures[filtered], shot, rig.lens).detail,
            lens=rig.lens,
        )
        for name, picture in ({TRUTH: clean} | pictures).items():
            _take(gathered.setdefault(name, _Gathered()), picture, view, options)
    methods = tuple(
        Method(
            name=name,
            patches=tuple(entry.patches),
            worst=() if name == TRUTH else tuple(sorted(entry.crops, key=_crop_rank)[:WORST]),
        )
        for name, entry in gathered.items()
    )
    return Report(options=options, methods=methods, control=_judge(methods, primary, places))


def _take(gathered: _Gathered, picture: FloatArray, view: _View, options: Options) -> None:
    """Measure a picture and keep its worst patches."""
    shot, side = view.shot, options.side_px
    remainder = unexplained(picture, shot, view.lens)
    cell = np.ones((shot.scene.scale, shot.scene.scale))
    excess = remainder.detail - view.filtered
    denied = {
        name: np.asarray(np.kron(plane, cell), np.float64)
        for name, plane in (
            ("chi2", remainder.chi2),
            ("detail", remainder.detail),
            ("excess", excess),
        )
    }
    patches = measure_patches(
        shot.scene.name, picture, view.truth, denied, side, options.perceptual
    )
    gathered.patches += patches
    restored = encode_srgb(picture)
    for patch in sorted(patches, key=_rank)[:WORST]:
        y, x = patch.place
        cut = np.s_[:, y : y + side, x : x + side]
        gathered.crops.append(
            Crop(
                patch=patch,
                truth=view.truth[cut].copy(),
                capture=view.capture[cut].copy(),
                restored=restored[cut].copy(),
            )
        )


def _restored(rig: Rig, shot: Shot) -> dict[str, FloatArray]:
    """Return the picture of every method.

    Raises:
        ContractError: If one gives none.
    """
    restoration = rig.restore(shot)
    for name, reason in restoration.faults.items():
        raise ContractError(f"{shot.scene.name}: {name} gives no picture: {reason}")
    return dict(restoration.pictures)


def _rank(patch: Patch) -> tuple[float, float]:
    """Sort by excess, then by detail (that of the filter, which has no excess); largest first."""
    values = (patch.values[name] for name in ("excess", "detail"))
    first, second = (-value if np.isfinite(value) else np.inf for value in values)
    return first, second


def _crop_rank(crop: Crop) -> tuple[float, float]:
    return _rank(crop.patch)


def _judge(
    methods: Sequence[Method], primary: str, places: set[tuple[str, tuple[int, int]]]
) -> Control:
    by_name = {method.name: method for method in methods}
    plain, planted = by_name[primary], by_name[primary + PLANTED]
    excesses = plain.values("excess")
    excesses = excesses[np.isfinite(excesses)]
    limit = float(np.percentile(excesses, 99)) if excesses.size else np.inf
    before, after = ({(p.scene, p.place): p.values for p in m.patches} for m in (plain, planted))
    ranked = [(p.scene, p.place) for p in sorted(planted.patches, key=_rank)]
    rises = [after[key]["detail"] - before[key]["detail"] for key in places]
    return Control(
        method=primary,
        planted=len(places),
        detected=sum(after[key]["excess"] > limit for key in places),
        first=len(places & set(ranked[: len(places)])),
        rise=float(np.nanmin(rises)) if np.isfinite(rises).any() else 0.0,
    )


def to_json(report: Report, crops: Sequence[str] = ()) -> dict[str, Any]:
    """Return what was found as plain JSON values.

    Args:
        report: It.
        crops: Names of the files of the worst patches of the control's method; empty for none.
    """
    control = report.control
    return {
        "iso": report.options.iso,
        "patch_px": report.options.side_px,
        "patches": len(report.methods[0].patches),
        "perceptual": report.options.perceptual_name,
        "methods": {method.name: _method(method, report, crops) for method in report.methods},
        "control": {
            "method": control.method,
            "planted": control.planted,
            "found": control.detected,
            "first": control.first,
            "least_rise": round(control.rise, 4),
        },
    }


def _method(method: Method, report: Report, crops: Sequence[str]) -> dict[str, Any]:
    columns: dict[str, Any] = {name: summary(method.values(name)) for name in MEASURES}
    for measure in ("chi2", "detail"):
        columns[measure] |= {
            "map": {
                scene: [[_rounded(v) for v in row] for row in values]
                for scene, values in method.maps(measure).items()
            }
        }
    names = crops if method.name == report.control.method else ()
    columns["worst"] = [
        {
            "picture": crop.patch.scene,
            "x_px": crop.patch.place[1],
            "y_px": crop.patch.place[0],
            **{name: _rounded(crop.patch.values[name]) for name in MEASURES},
            "crop": names[number] if number < len(names) else None,
        }
        for number, crop in enumerate(method.worst)
    ]
    return columns


def _rounded(value: float) -> float | None:
    return round(float(value), 6) if np.isfinite(value) else None


def to_text(report: dict[str, Any]) -> str:
    """Return what was found, as `to_json` has it, as a table."""
    lines = [f"{report['patches']} patches of {report['patch_px']} px, ISO {report['iso']:g}"]
    lines.append(f"perceptual: {report['perceptual']}")
    lines.append(f"  {'':16}" + "".join(f"{name + ' median, p99':>24}" for name in MEASURES))
    for name, method in report["methods"].items():
        cells = [_pair(method[measure]) for measure in MEASURES]
        lines.append(f"  {name:16}" + "".join(f"{cell:>24}" for cell in cells))
    control = report["control"]
    lines.append(
        f"control: {control['found']} of {control['planted']} patches with planted detail found in "
        f"{control['method']}, {control['first']} of them first; detail rose by "
        f"{control['least_rise']:.2f} at least"
    )
    return "\n".join(lines)


def _pair(figures: dict[str, Any]) -> str:
    if figures["median"] is None:
        return "-"
    return f"{figures['median']:.4g}, {figures['p99']:.4g}"
