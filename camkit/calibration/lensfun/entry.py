"""The entry that lensfun reads: the model that misses a distortion least, written as XML.

    bundle or geometry -> source -> models of distortion and vignetting -> XML

Ideal pictures may have any scale, and lensfun's models fix it: d = 1 at r = 1 (ptlens, poly3), or
d = r near the middle (poly5). So a polynomial with the powers of a model is fitted by least
squares, and ideal radii are scaled until it has the model's form:

    p1 r + p2 r^2 + ...  =  q1 (s r) + q2 (s r)^2 + ...,   q_n = p_n / s^n

with 1 / s the ideal radius that falls on d = 1, or s = p1 for poly5.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.lensfun.database import check_positive
from camkit.calibration.lensfun.models import TERMS, Distortion, Vignetting
from camkit.calibration.lensfun.source import Source, read_source
from camkit.calibration.lensfun.xml import ROOT
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.radial import RadialDistortion, RadialIllumination
from camkit.runtime.geometry.distortion import check_distortion, undistort_points

FloatGrid = NDArray[np.float64]
POWERS: Final = {"poly3": (1, 3), "poly5": (1, 3, 5), "ptlens": (1, 2, 3, 4)}
SAMPLES: Final = 1001
SAME_PX: Final = 1e-3
"""Models that differ by less are as good: the one with fewer terms is taken."""
FAR_M: Final = 1000.0
ANY: Final = "Generic"
"""Maker and mount where nobody states them."""
MOST_RESIDUAL_PX: Final = 0.5
_DIGITS: Final = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryOptions:
    """The options of an entry.

    Attributes:
        focal_mm: Focal length; None for that of the source, which a bundle does not know.
        lens_name: Model of the lens; None for the name of the source.
        maker: Of the lens.
        mount: Of the camera, as lensfun's database names it.
        crop_factor: Of the camera; None for that of the source, which a geometry does not know.
        aperture: F-number; None leaves vignetting out.
        most_residual_px: By which the model may miss the distortion.
    """

    focal_mm: float | None = None
    lens_name: str | None = None
    maker: str = ANY
    mount: str = ANY
    crop_factor: float | None = None
    aperture: float | None = None
    most_residual_px: float = MOST_RESIDUAL_PX

    def __post_init__(self) -> None:
        """Refuse values that no entry can have.

        Raises:
            ContractError: If a number is not > 0, or a name is empty or cannot be printed.
        """
        if not 0 < self.most_residual_px < np.inf:
            raise ContractError(
                f"{option_text('most_residual_px')} must be > 0; got {self.most_residual_px:g}"
            )
        for option in ("focal_mm", "crop_factor", "aperture"):
            value = getattr(self, option)
            if value is not None:
                check_positive(value, option)
        for option in ("lens_name", "maker", "mount"):
            text = getattr(self, option)
            if text is not None and not (text.strip() and text.isprintable()):
                raise ContractError(f"{option_text(option)} must be a name; got {text!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Name:
    """The name by which lensfun knows a lens.

    Attributes:
        maker: Who made it.
        model: Its name.
        mount: Of the camera, as lensfun's database names it.
        crop_factor: Of the camera.
    """

    maker: str
    model: str
    mount: str
    crop_factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A model that stands for a distortion.

    Attributes:
        distortion: The entry.
        residual_px: The most by which it misses, in the picture.
        scale: By which its ideal picture is larger.
    """

    distortion: Distortion
    residual_px: float
    scale: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """An entry of lensfun's database.

    Attributes:
        name: What lensfun knows the lens by.
        source: What it stands for.
        fit: Its distortion.
        vignetting: And the most that it misses, as a share of the light; None for none.
        notes: What is lost.
    """

    name: Name
    source: Source
    fit: Fit
    vignetting: tuple[Vignetting, float] | None
    notes: tuple[str, ...]

    @property
    def size_px(self) -> tuple[int, int]:
        """Return width and height of the pictures."""
        return self.source.size_px

    def straight_px(self, placed_px: FloatGrid) -> FloatGrid:
        """Return the radii of the source's straight picture that fall on radii of the capture."""
        assert self.source.distortion is not None  # without, there is no fit
        return _ideal_px(placed_px, self.source.distortion)

    def missed_px(self, placed_px: FloatGrid) -> FloatGrid:
        """Return by how much the entry puts light farther out than the source, at such radii."""
        unit_px = min(self.size_px) / 2
        ideal = self.fit.scale * self.straight_px(placed_px) / unit_px
        return self.fit.distortion.captured_radius(ideal) * unit_px - placed_px

    def to_xml(self) -> str:
        """Return the file that lensfun reads."""
        light = None if self.vignetting is None else self.vignetting[0]
        return to_xml(self.name, self.size_px, self.fit.distortion, light)

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        distortion = self.fit.distortion
        light = None
        if self.vignetting is not None:
            vignetting, missed = self.vignetting
            light = {"terms": list(vignetting.terms), "residual": missed}
        return {
            "lens": self.name.model,
            "crop_factor": self.name.crop_factor,
            "model": distortion.model,
            "focal_mm": distortion.focal_mm,
            "terms": dict(zip(TERMS[distortion.model], distortion.terms, strict=True)),
            "residual_px": round(self.fit.residual_px, 6),
            "scale": self.fit.scale,
            "vignetting": light,
            "notes": list(self.notes),
        }


def lensfun_entry(path: Path, options: EntryOptions) -> Entry:
    """Make the entry of a bundle, or of a measured geometry.

    Args:
        path: The bundle, by its path or name, or what `camkit calibrate geometry` wrote (.toml).
        options: What the entry is for.

    Raises:
        DecodeError: If the file is neither, states no distortion, or one that no model of lensfun's
            fits as well as asked.
        BundleError: If the bundle is refused.
        ContractError: If nothing says how large the sensor is, or how long the lens.
    """
    source = read_source(path)
    crop = source.crop_factor if options.crop_factor is None else options.crop_factor
    if crop is None:
        raise ContractError(
            f"{path} does not state the size of the sensor: add {option_text('crop_factor')}"
        )
    focal_mm = source.focal_mm(crop) if options.focal_mm is None else options.focal_mm
    if focal_mm is None:
        raise ContractError(
            f"{path} does not state the focal length: add {option_text('focal_mm')}"
        )
    fit = fit_distortion(source, focal_mm)
    if fit.residual_px > options.most_residual_px:
        raise DecodeError(
            f"{fit.distortion.model}, the nearest of lensfun's models, misses the distortion of "
            f"{source.name} by {fit.residual_px:.2f} px; {option_text('most_residual_px')} is "
            f"{options.most_residual_px:g}: raise it; a geometry goes into a bundle as it is "
            "(`camkit calibrate bundle --geometry`)"
        )
    notes, light = source.notes, None
    if source.light is not None and options.aperture is not None:
        half_px = math.hypot(*source.size_px) / 2
        light = fit_vignetting(source.light, half_px, focal_mm, options.aperture)
    elif source.light is not None:
        notes = (*notes, f"vignetting is left out: it needs {option_text('aperture')}")
    model = source.name if options.lens_name is None else options.lens_name
    name = Name(maker=options.maker, model=model, mount=options.mount, crop_factor=crop)
    return Entry(name=name, source=source, fit=fit, vignetting=light, notes=notes)


def fit_distortion(source: Source, focal_mm: float) -> Fit:
    """Choose and fit a model of lensfun's.

    Raises:
        DecodeError: If the source states no distortion, or it folds back inside the picture.
    """
    if source.distortion is None:
        raise DecodeError(f"{source.name} states no distortion")
    try:
        check_distortion(source.distortion, source.corner_px)
    except ContractError as error:
        raise DecodeError(f"{source.name}: {error}") from error
    unit_px = min(source.size_px) / 2
    placed_px = np.linspace(0, source.corner_px, SAMPLES)
    ideal = _ideal_px(placed_px, source.distortion)
    fits = [_fitted(model, ideal / unit_px, placed_px / unit_px, focal_mm) for model in POWERS]
    usable = [
        Fit(distortion=one, scale=scale, residual_px=missed * unit_px)
        for one, scale, missed in (fit for fit in fits if fit is not None)
    ]
    if not usable:
        raise DecodeError(f"no model of lensfun's fits the distortion of {source.name}")
    least = min(fit.residual_px for fit in usable)
    return next(fit for fit in usable if fit.residual_px <= least + SAME_PX)


def _ideal_px(placed_px: FloatGrid, distortion: RadialDistortion) -> FloatGrid:
    points = np.stack([placed_px, np.zeros_like(placed_px)], axis=-1)
    return undistort_points(points, distortion, channel=0)[:, 0]


def _fitted(
    model: str, ideal: FloatGrid, radii: FloatGrid, focal_mm: float
) -> tuple[Distortion, float, float] | None:
    """Fit one model; return it, its scale and its largest error. None where it has no form."""
    powers = np.array(POWERS[model])
    p = np.linalg.lstsq(ideal[:, None] ** powers, radii, rcond=None)[0]
    scale = float(p[0]) if model == "poly5" else _unit_scale(p, powers)
    if scale is None or not scale > 0:
        return None
    q = dict(zip(powers.tolist(), p / scale**powers, strict=True))
    if model == "ptlens":
        terms: Sequence[float] = (q[4], q[3], q[2])
    else:
        terms = [q[power] for power in powers[1:].tolist()]
    distortion = Distortion(model=model, focal_mm=focal_mm, terms=tuple(map(_rounded, terms)))
    return distortion, scale, float(np.abs(distortion.captured_radius(scale * ideal) - radii).max())


def _unit_scale(p: FloatGrid, powers: NDArray[np.int64]) -> float | None:
    """Return one over the ideal radius that falls on 1."""
    polynomial = np.zeros(powers[-1] + 1)
    polynomial[powers[-1] - powers] = p
    polynomial[-1] = -1.0
    roots = np.roots(polynomial)
    real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)].real
    return 1 / float(real.min()) if real.size else None


def fit_vignetting(
    light: RadialIllumination, corner_px: float, focal_mm: float, aperture: float
) -> tuple[Vignetting, float]:
    """Fit the model pa; return it and its largest error, as a share of the light.

    Args:
        light: Relative illumination; its heights are in pixels.
        corner_px: Half the diagonal of the picture.
        focal_mm: Focal length.
        aperture: F-number.
    """
    u = np.linspace(0, 1, SAMPLES)
    samples = np.interp(u * corner_px**2, light.heights_mm**2, light.light)
    k1, k2, k3 = np.linalg.lstsq(u[:, None] ** [1, 2, 3], samples - 1, rcond=None)[0]
    terms = (_rounded(k1), _rounded(k2), _rounded(k3))
    vignetting = Vignetting(focal_mm=focal_mm, aperture=aperture, distance_m=FAR_M, terms=terms)
    return vignetting, float(np.abs(vignetting.light(np.sqrt(u)) - samples).max())


def to_xml(
    name: Name, size_px: tuple[int, int], distortion: Distortion, vignetting: Vignetting | None
) -> str:
    """Return a file of lensfun's database with one lens."""
    root = Element(ROOT, {"version": "1"})
    lens = SubElement(root, "lens")
    common = math.gcd(*size_px)
    aspect = ":".join(str(side // common) for side in sorted(size_px, reverse=True))
    texts = {
        "maker": name.maker,
        "model": name.model,
        "mount": name.mount,
        "cropfactor": _number(name.crop_factor),
        "aspect-ratio": aspect,
    }
    for tag, text in texts.items():
        SubElement(lens, tag).text = text
    calibration = SubElement(lens, "calibration")
    terms = dict(zip(TERMS[distortion.model], map(_number, distortion.terms), strict=True))
    focal = _number(distortion.focal_mm)
    SubElement(calibration, "distortion", {"model": distortion.model, "focal": focal, **terms})
    if vignetting is not None:
        values = {"focal": vignetting.focal_mm, "aperture": vignetting.aperture}
        values |= {"distance": vignetting.distance_m}
        values |= dict(zip(("k1", "k2", "k3"), vignetting.terms, strict=True))
        numbers = {key: _number(value) for key, value in values.items()}
        SubElement(calibration, "vignetting", {"model": "pa", **numbers})
    indent(root, "    ")
    return tostring(root, encoding="unicode") + "\n"


def _rounded(value: float) -> float:
    """Return a number as the file will hold it."""
    return float(_number(value))


def _number(value: float) -> str:
    return f"{value:.{_DIGITS}g}"
