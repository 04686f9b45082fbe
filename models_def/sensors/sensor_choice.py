"""The sensor of a camera by few words: a size and a pitch, a name, or a photograph of it.

    "6000x4000@3.9um", "6000x4000@3.9um:BGGR"    what is not said are stated defaults
    "768x512@46.9um:planes", "...:grey"          no mosaic: developed pictures, three colours or one
    "IMX264", "IMX264:BGGR", "IMX264:grey"       facts of `named_sensors.toml`, with their source
    shot.dng, shot.jpg                           what the file says of its sensor

The result is the table `[sensor]` of a recipe, and for every key where its value comes from.
"""

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Final

import numpy as np

from camkit.bundle.sensor import GREY, RGB
from camkit.caller import option_text
from camkit.cfa import CFA_PATTERNS, shifted_cfa
from camkit.entry_points import entry_points, load_entry_point
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.units import UM_PER_MM

DATA: Final = "named_sensors.toml"
GROUP: Final = "camkit.sensors"
"""Of entry points, by which packages bring sensors: mappings with the keys of that file."""
DEFAULT: Final = "default"
FROM_CALLER: Final = "stated"
BLACK_LEVEL: Final = 256.0
WHITE_LEVEL: Final = 4095.0
WELL_E_PER_UM2: Final = 2000.0
"""Between 900 (machine vision, global shutter) and 3700 (photography)."""
READ_NOISE_E: Final = 3.0
PLANES: Final[Mapping[str, tuple[str, ...]]] = {"PLANES": RGB, "GREY": GREY}
"""Words in place of a pattern -> channels of a sensor without a mosaic."""
PICTURE_WHITE: Final = 65535.0
MOST_PICTURE_WELL_E: Final = 200_000.0
"""Shot noise of so many electrons is what rounding to 8 bits of sRGB leaves, at any level."""
ISOS: Final = (100, 200, 400, 800, 1600, 3200, 6400)
LEAST_WHITE_E: Final = 250.0
"""Of electrons at white: a pixel that holds few is not used at a high ISO."""
COLOR_MATRIX: Final = (
    (0.6640, -0.1847, -0.0503),
    (-0.5238, 1.3010, 0.2474),
    (-0.0993, 0.1673, 0.6527),
)
MATRIX_SOURCE: Final = "default: a Sony ILCE-7RM3, as LibRaw's table of cameras states it"
PEAKS_UM: Final = (0.600, 0.540, 0.460)
WIDTH_UM: Final = 0.090
"""Full width at half maximum."""
WAVELENGTHS_UM: Final = tuple(round(0.42 + 0.02 * i, 2) for i in range(14))
RESPONSE_SOURCE: Final = (
    "model: Gaussians at 0.600, 0.540 and 0.460 um with a full width of 0.090 um at half maximum"
)
_DESCRIPTION: Final = re.compile(
    r"(?P<width>\d+)x(?P<height>\d+)@(?P<pitch>\d+(?:\.\d+)?|\.\d+)um(?::(?P<cfa>[A-Za-z]+))?"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorChoice:
    """The sensor of a recipe.

    Attributes:
        table: `[sensor]` without its response.
        response: `[sensor.channel_response]`.
        sources: Key -> where its value comes from.
    """

    table: Mapping[str, Any]
    response: Mapping[str, Any]
    sources: Mapping[str, str]

    @property
    def corner_mm(self) -> float:
        """Half the diagonal, by the outermost pixel edges."""
        diagonal_px = math.hypot(self.table["width_px"], self.table["height_px"])
        return diagonal_px / 2 * float(self.table["pixel_pitch_um"]) / UM_PER_MM


def isos_of(full_well_e: float) -> tuple[int, ...]:
    """Return the ISOs of a sensor: at the highest one white is still `LEAST_WHITE_E` electrons."""
    enough = tuple(iso for iso in ISOS if full_well_e * ISOS[0] / iso >= LEAST_WHITE_E)
    return enough or ISOS[:1]


def choose_sensor(text: str) -> SensorChoice:
    """Return the sensor that a text names or describes.

    Raises:
        ContractError: If it does neither.
    """
    match = _DESCRIPTION.fullmatch(text.strip())
    if match is not None:
        pattern = (match["cfa"] or "RGGB").upper()
        facts: dict[str, Any] = {
            "width_px": int(match["width"]),
            "height_px": int(match["height"]),
            "pixel_pitch_um": float(match["pitch"]),
            "cfa": pattern,
        }
        sources = dict.fromkeys(facts, FROM_CALLER)
        if match["cfa"] is None:
            sources["cfa"] = DEFAULT
        return _completed(facts, sources)
    entries = named_sensors()
    name, _, pattern = text.strip().partition(":")
    facts = dict(entries.get(name.casefold()) or _sensor_of_package(name))
    if not facts:
        names = ", ".join([*(entry["name"] for entry in entries.values()), *entry_points(GROUP)])
        raise ContractError(
            f"{option_text('sensor')} takes WIDTHxHEIGHT@PITCHum, such as 6000x4000@3.9um (with "
            "or without :BGGR for another pattern, :planes for developed pictures, :grey), or one "
            f"of {names}; got {text!r}"
        )
    source = f"{facts.pop('name')}: {facts.pop('source')}"
    sources = dict.fromkeys(facts, source)
    if pattern or "cfa" not in facts:
        facts["cfa"], sources["cfa"] = (
            pattern.upper() or "RGGB",
            FROM_CALLER if pattern else DEFAULT,
        )
    return _completed(facts, sources)


def sensor_of(capture: Capture, pitch_um: float | None = None) -> SensorChoice:
    """Return the sensor that a photograph was taken with; of a developed one its size alone.

    Args:
        capture: Of a mosaic, or of three colours.
        pitch_um: Of the pixels; None for what the file states.

    Raises:
        ContractError: If nobody states the pitch.
    """
    pitch = capture.pixel_pitch_um if pitch_um is None else pitch_um
    if pitch is None:
        raise ContractError(
            f"the file states no pixel pitch; state it by {option_text('pitch_um')}"
        )
    height, width = capture.samples.shape[-2:]
    width, height = capture.sensor_size_px or (width, height)
    facts: dict[str, Any] = {
        "width_px": width,
        "height_px": height,
        "pixel_pitch_um": float(pitch),
    }
    if capture.cfa is None:
        facts["cfa"] = "PLANES"
    else:
        facts |= {
            "cfa": shifted_cfa(capture.cfa, capture.origin_px or (0, 0)),
            "black_level": round(float(np.mean(capture.black_level)), 4),
            "white_level": float(capture.white_level),
        }
    if capture.color_matrix is not None:
        facts["color_matrix"] = tuple(map(tuple, np.round(capture.color_matrix, 5).tolist()))
    if capture.noise is not None and capture.iso is not None:
        shot = float(np.mean(capture.noise.shot))
        facts["full_well_e"] = capture.iso / (100 * shot)
        facts["read_noise_e"] = float(np.sqrt(np.mean(capture.noise.read_variance))) / shot
    sources = dict.fromkeys(facts, capture.camera or "the photograph")
    if pitch_um is not None:
        sources["pixel_pitch_um"] = FROM_CALLER
    return _completed(facts, sources)


@cache
def named_sensors() -> Mapping[str, Mapping[str, Any]]:
    """Return the facts of the sensors that camkit knows, by their names in small letters."""
    text = (resources.files("camkit.models_def.sensors") / DATA).read_text(encoding="utf-8")
    return {entry["name"].casefold(): entry for entry in tomllib.loads(text)["sensor"]}


def _sensor_of_package(name: str) -> Mapping[str, Any]:
    """Return the facts of a sensor that a package brings; nothing if none has this name.

    Raises:
        ContractError: If they are not those of a sensor.
    """
    point = next(
        (p for n, p in entry_points(GROUP).items() if n.casefold() == name.casefold()), None
    )
    if point is None:
        return {}
    facts = load_entry_point(point, "sensor")
    keys = {"width_px", "height_px", "pixel_pitch_um", "source"}
    if not isinstance(facts, Mapping) or not keys <= facts.keys():
        raise ContractError(
            f"the sensor {point.name!r} of {point.value} must state {', '.join(sorted(keys))}"
        )
    return {"name": point.name, **facts}


def _completed(facts: dict[str, Any], sources: dict[str, str]) -> SensorChoice:
    """Return a sensor with defaults where nothing is known."""
    channels = PLANES.get(facts["cfa"])
    if channels is None and facts["cfa"] not in CFA_PATTERNS:
        raise ContractError(
            f"the pattern of a sensor is one of {', '.join((*CFA_PATTERNS, *PLANES))}; got "
            f"{facts['cfa']!r}"
        )
    usual = _usual(facts["pixel_pitch_um"], is_mosaic=channels is None)
    if channels is not None:
        facts = {"type": "planes", "channels": channels, **facts}
        sources["channels"] = sources.pop("cfa")
        del facts["cfa"]
    for key, (value, source) in usual.items():
        if key not in facts:
            facts[key], sources[key] = value, source
    read_e = facts.pop("read_noise_e")
    sources["noise"] = (
        f"full well over white less black at ISO 100, half of it at twice the ISO; read noise "
        f"{sources.pop('read_noise_e')}"
    )
    span = facts["white_level"] - facts["black_level"]
    facts["full_well_e"] = float(f"{facts['full_well_e']:.6g}")
    if channels is None:
        facts["illuminant"] = "D65"
    facts["noise"] = [
        {
            "iso": float(iso),
            "gain_e_per_dn": float(f"{facts['full_well_e'] / span * 100 / iso:.7g}"),
            "read_noise_e": float(f"{read_e:.4g}"),
        }
        for iso in isos_of(facts["full_well_e"])
    ]
    sharpness = 4 * np.log(2) / WIDTH_UM**2
    waves = np.array(WAVELENGTHS_UM)
    response = np.exp(-sharpness * np.square(waves - np.array(PEAKS_UM)[:, None]))
    if channels == GREY:
        response = response.sum(axis=0, keepdims=True)
    return SensorChoice(
        table=facts,
        response={
            "wavelengths_um": WAVELENGTHS_UM,
            "response": tuple(map(tuple, np.round(response, 4).tolist())),
            "source": f"{RESPONSE_SOURCE}{', summed' if channels == GREY else ''}",
        },
        sources=sources,
    )


def _usual(pitch_um: float, *, is_mosaic: bool) -> dict[str, tuple[Any, str]]:
    """Return the values of keys that nobody states, and where they come from."""
    well_e, well_text = WELL_E_PER_UM2 * pitch_um**2, f"default: {WELL_E_PER_UM2:g} a square um"
    usual: dict[str, tuple[Any, str]] = {"read_noise_e": (READ_NOISE_E, DEFAULT)}
    if is_mosaic:
        return usual | {
            "black_level": (BLACK_LEVEL, DEFAULT),
            "white_level": (WHITE_LEVEL, DEFAULT),
            "full_well_e": (well_e, well_text),
            "color_matrix": (COLOR_MATRIX, MATRIX_SOURCE),
        }
    if well_e > MOST_PICTURE_WELL_E:
        well_e = MOST_PICTURE_WELL_E
        well_text = f"default: noise of {well_e:,.0f} electrons is that of rounding to 8 bits"
    return usual | {
        "black_level": (0.0, "default: light of developed pictures"),
        "white_level": (PICTURE_WHITE, DEFAULT),
        "full_well_e": (well_e, well_text),
    }
