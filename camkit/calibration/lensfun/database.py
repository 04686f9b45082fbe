"""Lenses of a lensfun database by name, and what it holds of them."""

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from camkit.calibration.lensfun.models import (
    TERMS,
    USUAL_ASPECT,
    Distortion,
    Vignetting,
)
from camkit.calibration.lensfun.xml import MOST_BYTES, read_xml
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError

MOST_FILES: Final = 1024
LEAST: Final = 1e-5
MOST: Final = 1e5
_NEAR: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """A lens as it was measured with one camera.

    Attributes:
        name: Its model.
        file: Where it stands.
        kind: Projection, like rectilinear or fisheye.
        crop_factor: Of the camera with which it was measured.
        aspect: Longer over shorter side of its pictures.
        distortion: Entries as they stand.
        vignetting: Entries of the model pa as they stand.
    """

    name: str
    file: str
    kind: str
    crop_factor: float
    aspect: float
    distortion: tuple[Distortion, ...]
    vignetting: tuple[Vignetting, ...]


class Database:
    """A folder of XML files, or one of them."""

    def __init__(self, place: Path) -> None:
        """Read all files.

        Raises:
            DecodeError: If there is none, or one is refused.
        """
        self._files = {path.name: read_xml(path) for path in _files_of(place)}
        self._place = place

    def lenses(self) -> Iterator[tuple[str, Element]]:
        """Yield every lens with the name of its file."""
        for file, root in self._files.items():
            for element in root.iter("lens"):
                yield file, element

    def find(self, name: str) -> list[Lens]:
        """Return a lens as it was measured with every camera.

        Args:
            name: Its model, with or without its maker; case, spaces and the
                slash of f/ do not count.

        Raises:
            DecodeError: If there is none of that name (near ones are named), or it is malformed.
        """
        plain_name, lenses = _plain(name), []
        names_by_plain: dict[str, str] = {}
        for file, element in self.lenses():
            names = _names(element)
            if plain_name in (_plain(one) for one in names):
                lenses.append(lens_of(element, file))
            names_by_plain |= {_plain(one): one for one in names[:1]}
        if not lenses:
            near = _near(plain_name, names_by_plain)
            hint = (
                f"near: {'; '.join(names_by_plain[one] for one in near)}"
                if near
                else "none is near"
            )
            raise DecodeError(f"{self._place} has no lens {name!r}; {hint}")
        return lenses

    def crop_factor(self, make: str, model: str) -> float | None:
        """Return the crop factor of a camera; None if it is not known."""
        plain_model = _plain(model)
        for root in self._files.values():
            for camera in root.iter("camera"):
                models = {_plain(one.text or "") for one in camera.iter("model")}
                makers = {_plain(one.text or "") for one in camera.iter("maker")}
                if plain_model and plain_model in models and (not make or _plain(make) in makers):
                    return _number(camera.findtext("cropfactor"), f"crop factor of {model}")
        return None


def _files_of(place: Path) -> list[Path]:
    if place.is_file():
        return [place]
    if not place.is_dir():
        raise DecodeError(f"{place} is neither a file nor a folder of a lensfun database")
    files = sorted(place.glob("*.xml"))
    if not files or len(files) > MOST_FILES:
        raise DecodeError(f"{place} holds {len(files)} XML files; a lensfun database has some")
    if sum(path.stat().st_size for path in files) > 4 * MOST_BYTES:
        raise DecodeError(f"{place} is larger than any lensfun database")
    return files


def _near(name: str, candidates: Iterable[str]) -> list[str]:
    """Return similar names, those with all the words first."""
    words, names = name.split(), list(candidates)
    with_all = [one for one in names if words and all(word in one for word in words)]
    alike = difflib.get_close_matches(name, names, n=_NEAR, cutoff=0.5)
    return list(dict.fromkeys((*sorted(with_all, key=len), *alike)))[:_NEAR]


def _plain(name: str) -> str:
    # cameras state f-numbers as F4.5 where the database writes f/4.5
    return " ".join(name.casefold().replace("f/", "f").split())


def _names(lens: Element) -> list[str]:
    models = [one.text or "" for one in lens.findall("model")]
    makers = [one.text or "" for one in lens.findall("maker")]
    return [*models, *(f"{maker} {model}" for maker in makers for model in models)]


def lens_of(element: Element, file: str) -> Lens:
    """Read a lens element.

    Raises:
        DecodeError: If something in it is no number, or of an unknown model.
    """
    name = element.findtext("model") or "(no name)"
    where = f"{file}, {name}"
    return Lens(
        name=" ".join(name.split()),
        file=file,
        kind=(element.findtext("type") or "rectilinear").strip(),
        crop_factor=_positive(element.findtext("cropfactor") or "1", f"{where}: cropfactor"),
        aspect=_aspect(element.findtext("aspect-ratio"), where),
        distortion=tuple(_distortion(one.attrib, where) for one in element.iter("distortion")),
        vignetting=tuple(
            _vignetting(one.attrib, where)
            for one in element.iter("vignetting")
            if one.get("model") == "pa"
        ),
    )


def _distortion(attributes: Mapping[str, str], where: str) -> Distortion:
    model = attributes.get("model", "")
    if model not in TERMS:
        raise DecodeError(
            f"{where}: the model {model!r} of distortion is not known; expected one of "
            f"{', '.join(TERMS)}"
        )
    return Distortion(
        model=model,
        focal_mm=_positive(attributes.get("focal"), f"{where}: focal"),
        terms=tuple(
            _number(attributes.get(term, "0"), f"{where}: {term}") for term in TERMS[model]
        ),
    )


def _vignetting(attributes: Mapping[str, str], where: str) -> Vignetting:
    k1, k2, k3 = (
        _number(attributes.get(term, "0"), f"{where}: {term}") for term in ("k1", "k2", "k3")
    )
    return Vignetting(
        focal_mm=_positive(attributes.get("focal"), f"{where}: focal"),
        aperture=_positive(attributes.get("aperture"), f"{where}: aperture"),
        distance_m=_positive(attributes.get("distance", "1000"), f"{where}: distance"),
        terms=(k1, k2, k3),
    )


def _aspect(text: str | None, where: str) -> float:
    if text is None:
        return USUAL_ASPECT
    parts = [_positive(part, f"{where}: aspect-ratio") for part in text.split(":", 1)]
    ratio = parts[0] / parts[1] if len(parts) > 1 else parts[0]
    return max(ratio, 1 / ratio)


def _number(text: str | None, what: str) -> float:
    try:
        number = float(text or "")
    except ValueError:
        number = math.nan
    if not abs(number) <= MOST:
        raise DecodeError(f"{what} must be a number; got {text!r}")
    return number


def _positive(text: str | None, what: str) -> float:
    number = _number(text, what)
    if not number > LEAST:
        raise DecodeError(f"{what} must be > 0; got {text!r}")
    return number


def check_positive(value: float, option: str) -> None:
    """Refuse an option that no lens can have.

    Raises:
        ContractError: If so.
    """
    if not LEAST <= value <= MOST:
        raise ContractError(
            f"{option_text(option)} must be > 0, {LEAST:g} to {MOST:g}; got {value:g}"
        )
