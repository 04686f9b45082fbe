"""A `Lens` as a .zmx file: read back to the last bit by camkit, and read by other programs."""

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Final

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.glass.catalogue import AIR, builtin_catalogues
from camkit.models_def.optics.glass.material import Glass
from camkit.models_def.optics.lens_file.states import configuration_name, plain_lens
from camkit.models_def.optics.lens_file.zmx_configuration_writer import (
    configuration_lines,
    field_texts,
)
from camkit.models_def.optics.lens_file.zmx_glass import (
    MODEL_NAME,
    GlassOrder,
    gcat_name,
    glass_order,
    glass_words,
)
from camkit.models_def.optics.lens_file.zmx_shape import shape_lines
from camkit.models_def.optics.prescription import Lens, Surface

_BLOCK: Final = ("  HIDE 0 0 0 0 0 0 0 0 0 0", "  MIRR 2 0")
_TABLE_SIZE: Final = 12
_MAX_ORDERED: Final = 4


def write_zmx(lens: Lens, path: Path) -> None:
    """Write a lens as UTF-16 with byte order mark and Windows line ends, as its program does.

    Raises:
        UnsupportedError: If a surface has grooves, or a shape that the format does not hold, or
            its configurations differ in what the format does not hold.
        ContractError: If the lens is a fabricated copy (index offsets are not written).
    """
    path.write_bytes(format_zmx(lens).replace("\n", "\r\n").encode("utf-16"))


def format_zmx(lens: Lens) -> str:
    """Return the .zmx text of a lens; see `write_zmx`."""
    if any(surface.index_offset for surface in lens.surfaces):
        raise ContractError("a lens file holds no index offsets; write the nominal lens")
    states = [replace(plain_lens(lens, s.name), name=lens.name) for s in lens.configurations]
    usual = configuration_name(lens)
    current = [state.name for state in lens.configurations].index(usual) if states else 0
    lens, states = (states[current], states) if states else (lens, [lens])
    by_height = all(math.isfinite(state.object_distance_mm) for state in states)
    names = _catalogue_names(lens)
    order = glass_order(names, ())
    lines = [
        *_system_lines(lens, names, field_texts(states)[current], by_height),
        *_object_lines(lens, order),
    ]
    for i, surface in enumerate(lens.surfaces):
        lines += _surface_lines(lens, surface, i, order)
    last = len(lens.surfaces) + 1
    lines += [f"SURF {last}", "  TYPE STANDARD", '  CURV 0.0 0 0 0 0 ""', *_BLOCK, "  DISZ 0"]
    # other programs take the medium of the image from its own surface
    back = lens.surfaces[-1]
    lines += _glass_lines(back.medium, order, is_user_glass=back.material is not None)[0]
    lines += ['  DIAM 0 0 0 0 1 ""', "TOL TOFF   0   0   0   0   0 0 0"]
    lines += configuration_lines(states, current)
    return "\n".join(lines) + "\n"


def _catalogue_names(lens: Lens) -> list[str]:
    """Return the makers whose glasses the lens uses, for GCAT.

    Two makers may have glasses of one name: the order is the one in which most glasses of the
    lens can go out by their names, since other programs know no camkit model glass.
    """
    names: dict[str, None] = {}
    makers = [c for c in builtin_catalogues() if not c.literature]
    media = [(lens.object_medium, lens.object_material)]
    media += [(surface.medium, surface.material) for surface in lens.surfaces]
    for medium, users_glass in media:
        if users_glass is not None and "-" in medium.name:
            names[medium.name.rpartition("-")[2]] = None
        names |= {gcat_name(c): None for c in makers if c.get(medium.name) is not None}
    glasses = {medium.name: medium for medium, _ in media}.values()

    def model_free_count(order: list[str]) -> int:
        read = glass_order(order, ())
        return sum(
            MODEL_NAME not in glass_words(glass, read, is_user_glass=False)[0] for glass in glasses
        )

    if len(names) > _MAX_ORDERED:
        return list(names)
    return max(map(list, itertools.permutations(names)), key=model_free_count)


def _system_lines(
    lens: Lens, catalogues: list[str], fields: list[str], by_height: bool
) -> list[str]:
    words = {
        "f_number": f"FNUM {lens.aperture_value!r} 0",
        "entrance_pupil_diameter_mm": f"ENPD {lens.aperture_value!r}",
        "stop_semi_diameter_mm": "FLOA",
    }
    count = max(_TABLE_SIZE, len(fields))
    zeros = " ".join(["0"] * count)
    waves = list(lens.wavelengths_um)
    # a reference that is none of the wavelengths of interest is written with weight 0
    extra = [lens.reference_wavelength_um] if lens.reference_wavelength_um not in waves else []
    name = " ".join(lens.name.split())
    return [
        "VERS 140730 0 0",
        "MODE SEQ",
        f"NAME {name}",
        *(f"NOTE 0 {line}" for line in lens.note.splitlines()),
        "UNIT MM X W X CM MR CPMM",
        words[lens.aperture_kind],
        "ENVD 20 1 0",
        "GFAC 0 0",
        *([f"GCAT {' '.join(catalogues)}"] if catalogues else []),
        "RAIM 0 0 1 1 0 0 0 0 0",
        f"FTYP {1 if by_height else 0} 0 {len(fields)} {len(waves + extra)} 0 0 0",
        f"XFLN {zeros}",
        f"YFLN {' '.join([*fields, *['0'] * (count - len(fields))])}",
        f"FWGN {' '.join(['1'] * count)}",
        *(f"{key} {zeros}" for key in ("VDXN", "VDYN", "VCXN", "VCYN", "VANN")),
        *(f"WAVM {i} {wave!r} 1" for i, wave in enumerate(waves, start=1)),
        *(f"WAVM {len(waves) + 1} {wave!r} 0" for wave in extra),
        f"PWAV {(waves + extra).index(lens.reference_wavelength_um) + 1}",
    ]


def _object_lines(lens: Lens, order: GlassOrder) -> list[str]:
    near = math.isfinite(lens.object_distance_mm)
    distance = repr(lens.object_distance_mm) if near else "INFINITY"
    head = ["SURF 0", "  TYPE STANDARD", '  CURV 0.0 0 0 0 0 ""', *_BLOCK]
    is_user_glass = lens.object_material is not None
    glass, comment = _glass_lines(lens.object_medium, order, is_user_glass=is_user_glass)
    return [*head, *comment, f"  DISZ {distance}", *glass, '  DIAM 0 0 0 0 1 ""']


def _glass_lines(
    glass: Glass, order: GlassOrder, *, is_user_glass: bool
) -> tuple[list[str], list[str]]:
    """Return the GLAS line of a medium and its comment; nothing for air."""
    if glass == AIR:
        return [], []
    words, comment = glass_words(glass, order, is_user_glass=is_user_glass)
    return [f"  GLAS {words}"], [f"  COMM {comment}"] if comment else []


def _surface_lines(lens: Lens, surface: Surface, position: int, order: GlassOrder) -> list[str]:
    if surface.grooves is not None:
        raise UnsupportedError(
            f"surface {position} has grooves, which a .zmx file does not carry; write .toml"
        )
    if surface.stance is not None:
        raise UnsupportedError(
            f"surface {position} begins an element that is tilted or decentred; write .toml"
        )
    try:
        kind, shape = shape_lines(surface)
    except UnsupportedError as error:
        raise UnsupportedError(f"surface {position} has {error}") from error
    is_user_glass = surface.material is not None
    glass, comment = _glass_lines(surface.medium, order, is_user_glass=is_user_glass)
    lines = [
        f"SURF {position + 1}",
        *comment,
        *(["  STOP"] if position == lens.stop else []),
        f"  TYPE {kind}",
        f'  CURV {surface.curvature_per_mm!r} 0 0 0 0 ""',
        *_BLOCK,
        *shape,
        f"  DISZ {surface.thickness_mm!r}",
        *glass,
        *([f"  CONI {surface.conic!r}"] if surface.conic else []),
    ]
    return lines + _aperture_lines(lens, surface, position)


def _aperture_lines(lens: Lens, surface: Surface, position: int) -> list[str]:
    """Return DIAM, fixed where the surface vignettes; a floating stop holds the aperture there.

    A fixed one is said again as floating aperture (FLAP), without which some programs let rays by.
    """
    size_mm, limit = surface.semi_diameter_mm, math.isfinite(surface.semi_diameter_mm)
    floating = position == lens.stop and lens.aperture_kind == "stop_semi_diameter_mm"
    if floating and size_mm != lens.aperture_value:
        clap = [f"  CLAP 0 {size_mm!r} 0"] if limit else []
        return [f'  DIAM {lens.aperture_value!r} 0 0 0 1 ""', *clap]
    if not limit:
        return ['  DIAM 0 0 0 0 1 ""']
    return [f'  DIAM {size_mm!r} 1 0 0 1 ""', f"  FLAP 0 {size_mm!r} 0"]
