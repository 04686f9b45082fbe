"""Lens prescriptions: frozen dataclasses, TOML files, fabrication errors.

Lengths in mm. +z along the light; radius > 0 when the centre of curvature lies towards +z.
Thickness and glass are those after a surface; the last thickness leads to the sensor.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal, cast, get_args

from camkit.caller import option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.configuration.configuration import (
    Configuration,
    check_configurations,
)
from camkit.models_def.optics.configuration.configuration_table import (
    configuration_lines,
    parse_configuration,
)
from camkit.models_def.optics.configuration.exact_text import degrees_text, radius_text
from camkit.models_def.optics.configuration.field_limits import check_fields
from camkit.models_def.optics.glass.agf import read_agf
from camkit.models_def.optics.glass.catalogue import (
    AIR,
    GlassCatalogue,
    find_glass,
    own_glass,
)
from camkit.models_def.optics.glass.material import Glass
from camkit.models_def.optics.glass.table import glass_table, parse_glass_table
from camkit.models_def.optics.grooves import (
    Grooves,
    Profile,
    check_grooves,
    groove_facts,
    groove_table,
)
from camkit.models_def.optics.shape.phase import Phase, parse_phase, phase_lines
from camkit.models_def.optics.shape.polynomial import Asphere, Polynomial
from camkit.models_def.optics.shape.stance import Stance, check_stances, parse_stance
from camkit.models_def.toml_table import key_line, section
from camkit.side_file import parse_toml, read_side_text
from camkit.units import to_radians

ApertureKind = Literal["f_number", "entrance_pupil_diameter_mm", "stop_semi_diameter_mm"]
Vary = Literal[
    "curvature", "conic", "thickness", "even_asphere", "odd_asphere", "q_asphere", "phase"
]
VARY: Final[tuple[Vary, ...]] = get_args(Vary)
APERTURE_KINDS: Final[tuple[ApertureKind, ...]] = get_args(ApertureKind)


@dataclass(frozen=True, slots=True, kw_only=True)
class _SurfaceTable:
    """The keys of [[surface]], as people write them."""

    radius_mm: float
    thickness_mm: float
    glass: str = "air"
    semi_diameter_mm: float = math.inf
    conic: float = 0.0
    even_asphere: tuple[float, ...] = ()
    odd_asphere: tuple[float, ...] = ()
    q_bfs: tuple[float, ...] = ()
    q_con: tuple[float, ...] = ()
    normal_radius_mm: float | None = None
    phase_radial_rad: tuple[float, ...] | None = None
    phase_free_rad: dict[str, Any] | None = None
    phase_radius_mm: float | None = None
    phase_order: float | None = None
    element_decentre_mm: tuple[float, ...] | None = None
    element_tilt_deg: tuple[float, ...] | None = None
    vary: tuple[str, ...] = ()
    groove_depth_um: float | None = None
    groove_walls: bool | None = None
    tool_radius_um: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _LensTable:
    """The keys of a prescription; exactly one of `APERTURE_KINDS` is needed."""

    name: str
    stop: int
    surface: list[dict[str, Any]]
    note: str = ""
    object_glass: str = AIR.name
    object_distance_mm: float | None = None
    field_angles_deg: tuple[float, ...] | None = None
    wavelengths_um: tuple[float, ...] | None = None
    reference_wavelength_um: float | None = None
    f_number: float | None = None
    entrance_pupil_diameter_mm: float | None = None
    stop_semi_diameter_mm: float | None = None
    glass: list[dict[str, Any]] = field(default_factory=list)
    glass_catalogues: tuple[str, ...] = ()
    tolerance: dict[str, Any] | None = None
    configuration: list[dict[str, Any]] = field(default_factory=list)
    default_configuration: str = ""
    state: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """One surface and the medium after it.

    Attributes:
        curvature_per_mm: 1 / radius; 0 is a plane.
        thickness_mm: Distance along the axis to the next surface or the sensor.
        glass: Strict name of the medium after the surface ("air" or see `glass`); a trade name
            that one catalogue has becomes the strict one.
        semi_diameter_mm: Rays further out are vignetted; inf for no limit.
        conic: 0 sphere, -1 paraboloid.
        even_asphere: Coefficients of r^2, r^4, r^6, ... (mm^-1, mm^-3, ...).
        odd_asphere: Coefficients of r, r^3, r^5, ... (1, mm^-2, ...).
        q_bfs: Coefficients of Forbes' Q_bfs in mm, in place of both.
        q_con: Coefficients of Forbes' Q_con in mm, in place of both.
        normal_radius_mm: If stated, r is divided by it and coefficients are in mm.
        phase: That it adds to light; None for none.
        stance: Of the piece of glass that begins here; None where it stands centred.
        index_offset: Added to the index after the surface (fabrication error).
        material: The glass itself where it comes from a user's catalogue; its name is `glass`.
        grooves: That it is cut into; None for none. They need a finite semi-diameter.
        vary: What an optimisation may change.
    References: Sun 2021, eq. (2.2).
    """

    curvature_per_mm: float
    thickness_mm: float
    glass: str = "air"
    semi_diameter_mm: float = math.inf
    conic: float = 0.0
    even_asphere: tuple[float, ...] = ()
    odd_asphere: tuple[float, ...] = ()
    q_bfs: tuple[float, ...] = ()
    q_con: tuple[float, ...] = ()
    normal_radius_mm: float | None = None
    phase: Phase | None = None
    stance: Stance | None = None
    index_offset: float = 0.0
    material: Glass | None = None
    grooves: Grooves | None = None
    vary: tuple[Vary, ...] = ()

    def __post_init__(self) -> None:
        if not set(self.vary) <= set(VARY):
            raise ContractError(f"vary names some of {', '.join(VARY)}; got {self.vary}")
        object.__setattr__(self, "glass", _strict_name(self.glass, self.material))
        numbers = (self.curvature_per_mm, self.thickness_mm, self.conic, self.index_offset)
        if not all(map(math.isfinite, (*numbers, *self.even_asphere))):
            raise ContractError(f"a surface needs finite numbers; got {self}")
        self.asphere.check(self.conic)
        if not self.semi_diameter_mm > 0:
            raise ContractError(f"semi_diameter_mm must be > 0; got {self.semi_diameter_mm}")
        if self.grooves is not None:
            check_grooves(self.profile, self.grooves)

    @property
    def medium(self) -> Glass:
        """The glass after the surface."""
        return self.material or find_glass(self.glass)

    @property
    def profile(self) -> Profile:
        """The continuous profile, up to the rim."""
        return Profile(
            curvature_per_mm=self.curvature_per_mm,
            conic=self.conic,
            polynomial=self.polynomial,
            rim_mm=self.semi_diameter_mm,
        )

    @property
    def asphere(self) -> Asphere:
        """Its polynomial part as stated."""
        return Asphere(
            even=self.even_asphere,
            odd=self.odd_asphere,
            q_bfs=self.q_bfs,
            q_con=self.q_con,
            normal_radius_mm=self.normal_radius_mm,
        )

    @property
    def polynomial(self) -> Polynomial:
        """Its polynomial part as the tracer has it."""
        return self.asphere.polynomial()

    @property
    def radius_mm(self) -> float:
        """Radius of curvature; inf for a plane."""
        return 1 / self.curvature_per_mm if self.curvature_per_mm else math.inf


def _strict_name(name: str, material: Glass | None) -> str:
    """Return the name of a medium, checked against the glass itself where there is one."""
    if material is None:
        return find_glass(name).name
    if material.name != name:
        raise ContractError(f"glass and material must have one name; got {name}, {material.name}")
    return name


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """A lens in front of a sensor; round, unless a free phase or a stance says otherwise.

    Attributes:
        name: For people.
        surfaces: In the order of the light.
        stop: Index of the surface that is the aperture stop.
        aperture_kind: What `aperture_value` is.
        aperture_value: F-number (EFL / entrance pupil diameter) or a length in mm.
        object_distance_mm: From the first vertex, positive; inf for a distant scene.
        field_angles_rad: Fields of interest, increasing from the axis.
        wavelengths_um: Wavelengths of interest, increasing.
        reference_wavelength_um: Defines the chief ray, the EFL and the focus.
        note: For people: where the design comes from.
        object_glass: Strict name of the medium between the object and the first surface.
        object_material: The glass itself where it comes from a user's catalogue.
        configurations: Focus positions and zoom states; `lens_file.states.plain_lens` gives the
            lens in one of them. All else sees the lens as its surfaces state it.
        default_configuration: Name of the one that is taken where none is named; empty for the
            first.
        state: Name of the configuration that a lens without any was taken from; else empty.
    """

    name: str
    surfaces: tuple[Surface, ...]
    stop: int
    aperture_kind: ApertureKind
    aperture_value: float
    object_distance_mm: float = math.inf
    field_angles_rad: tuple[float, ...] = (0.0,)
    wavelengths_um: tuple[float, ...] = (0.55,)
    reference_wavelength_um: float = 0.55
    note: str = ""
    object_glass: str = AIR.name
    object_material: Glass | None = None
    configurations: tuple[Configuration, ...] = ()
    default_configuration: str = ""
    state: str = ""

    def __post_init__(self) -> None:
        medium = _strict_name(self.object_glass, self.object_material)
        object.__setattr__(self, "object_glass", medium)
        if not self.surfaces:
            raise ContractError("a lens needs at least one surface; got none")
        if not 0 <= self.stop < len(self.surfaces):
            raise ContractError(f"stop must be 0..{len(self.surfaces) - 1}; got {self.stop}")
        if self.aperture_kind not in APERTURE_KINDS:
            raise ContractError(
                f"aperture must be one of {APERTURE_KINDS}; got {self.aperture_kind}"
            )
        if not (math.isfinite(self.aperture_value) and self.aperture_value > 0):
            raise ContractError(f"{self.aperture_kind} must be > 0; got {self.aperture_value}")
        if not self.object_distance_mm > 0:
            raise ContractError(f"object_distance_mm must be > 0; got {self.object_distance_mm}")
        check_fields(self.field_angles_rad, self.object_distance_mm)
        check_stances([(s.stance, s.glass) for s in self.surfaces], self.stop)
        check_configurations(self.configurations, len(self.surfaces), self.default_configuration)
        waves = (*self.wavelengths_um, self.reference_wavelength_um)
        if not all(0.2 < w < 20 for w in waves):
            raise ContractError(f"wavelengths must lie in 0.2..20 um; got {waves}")

    @property
    def object_medium(self) -> Glass:
        """The glass in front of the first surface."""
        return self.object_material or find_glass(self.object_glass)

    @property
    def is_round(self) -> bool:
        """True if it is the same at all azimuths."""
        phases = (surface.phase for surface in self.surfaces)
        skewed = any(surface.stance is not None for surface in self.surfaces)
        return not skewed and all(phase is None or phase.is_round for phase in phases)


def require_round(lens: Lens, what: str, *, allow_phases: bool = False) -> None:
    """Refuse a lens that is not round where only its fields along +y are looked at.

    Args:
        lens: The prescription.
        what: That needs it round, for the message.
        allow_phases: Whether a free phase may stand in it.

    Raises:
        UnsupportedError: Naming what makes it uneven.
    """
    for i, surface in enumerate(lens.surfaces):
        if surface.stance is not None:
            raise UnsupportedError(f"{what} needs a round lens; surface {i} is tilted or decentred")
        if not (allow_phases or surface.phase is None or surface.phase.is_round):
            raise UnsupportedError(f"{what} needs a round lens; surface {i} has a free phase")


def grooves_of(lens: Lens) -> list[dict[str, Any]]:
    """Return the facts about the grooves of a lens, one entry for each grooved surface."""
    return [
        {"surface": number, **groove_facts(surface.profile, surface.grooves)}
        for number, surface in enumerate(lens.surfaces)
        if surface.grooves is not None
    ]


def with_focus_shift(lens: Lens, shift_mm: float) -> Lens:
    """Return the lens with its sensor moved away from it by `shift_mm`, in all configurations."""
    *others, last = lens.surfaces
    back_surface = replace(last, thickness_mm=last.thickness_mm + shift_mm)
    states = tuple(state.shifted(len(others), shift_mm) for state in lens.configurations)
    return replace(lens, surfaces=(*others, back_surface), configurations=states)


def require_plain(lens: Lens, what: str) -> None:
    """Refuse a lens with configurations where one lens alone is looked at.

    Raises:
        ContractError: Naming them.
    """
    if lens.configurations:
        names = ", ".join(state.name for state in lens.configurations)
        raise ContractError(
            f"{what} is for one configuration; choose by {option_text('configuration')} of {names}"
        )


def read_prescription(
    path: Path,
    catalogues: Sequence[GlassCatalogue] = (),
    preferred: Sequence[GlassCatalogue] = (),
) -> Lens:
    """Read a lens from a TOML file.

    Args:
        path: The file; its `glass_catalogues` are .agf files relative to it.
        catalogues: More glasses, asked after those that the file brings along.
        preferred: Those of camkit; the first that has a trade name decides.

    Raises:
        ContractError: If the file is not TOML, or a key is unknown, missing or of a wrong type.
        DecodeError: If a glass catalogue is damaged.
    """
    text = read_side_text(path, "the lens")
    try:
        return parse_prescription(text, catalogues, preferred, folder=path.parent)
    except ContractError as error:
        raise ContractError(f"{path.name}: {error}") from error


def parse_prescription(
    text: str,
    catalogues: Sequence[GlassCatalogue] = (),
    preferred: Sequence[GlassCatalogue] = (),
    *,
    folder: Path | None = None,
) -> Lens:
    """Read a lens from TOML text; see `read_prescription`."""
    table = section("the lens", _LensTable, parse_toml(text.encode(), "the prescription"))
    apertures = {kind: getattr(table, kind) for kind in APERTURE_KINDS}
    kinds = [kind for kind, value in apertures.items() if value is not None]
    if len(kinds) != 1:
        raise ContractError(f"give exactly one of {', '.join(APERTURE_KINDS)}; got {kinds}")
    names = ("object_distance_mm", "wavelengths_um", "reference_wavelength_um")
    optional = {name: getattr(table, name) for name in names}
    if table.field_angles_deg is not None:
        optional["field_angles_rad"] = tuple(map(to_radians, table.field_angles_deg))
    glasses = (*_own_catalogues(table, folder), *catalogues)

    def medium(name: str) -> Glass:
        return find_glass(name, glasses, preferred)

    object_medium = medium(table.object_glass)
    return Lens(
        name=table.name,
        note=table.note,
        object_glass=object_medium.name,
        object_material=own_glass(object_medium, glasses),
        surfaces=tuple(
            _parse_surface(
                section(f"surface {i}", _SurfaceTable, one), f"surface {i}", medium, glasses
            )
            for i, one in enumerate(table.surface)
        ),
        stop=table.stop,
        aperture_kind=kinds[0],
        aperture_value=apertures[kinds[0]],
        configurations=tuple(
            parse_configuration(f"configuration {i}", one)
            for i, one in enumerate(table.configuration, start=1)
        ),
        default_configuration=table.default_configuration,
        state=table.state,
        **{name: value for name, value in optional.items() if value is not None},
    )


def _own_catalogues(table: _LensTable, folder: Path | None) -> list[GlassCatalogue]:
    """Return the glasses that a prescription brings along: its own tables, then its .agf files."""
    tables = GlassCatalogue(name=table.name, glasses=tuple(map(parse_glass_table, table.glass)))
    if table.glass_catalogues and folder is None:
        raise ContractError("glass_catalogues are relative to a file; this prescription is none")
    return [tables, *(read_agf((folder or Path()) / name) for name in table.glass_catalogues)]


def write_prescription(lens: Lens, path: Path) -> None:
    """Write a lens as TOML.

    `read_prescription` gives it back to the last bit, if its curvatures are inverses of radii
    (as they are in a lens that was read); others come back within 1e-15 of themselves. Glasses of
    a user's catalogue are written into the file, which needs no other file then.

    Raises:
        ContractError: If the lens is a fabricated copy (index offsets are not written).
    """
    path.write_text(format_prescription(lens), encoding="utf-8")


def format_prescription(lens: Lens) -> str:
    """Return the TOML text of a lens; see `write_prescription`."""
    if any(surface.index_offset for surface in lens.surfaces):
        raise ContractError("a prescription holds no index offsets; write the nominal lens")
    angles = ", ".join(degrees_text(angle) for angle in lens.field_angles_rad)
    lines = [
        key_line("name", lens.name),
        key_line("note", lens.note),
        f"{lens.aperture_kind} = {lens.aperture_value!r}",
        f"stop = {lens.stop}",
        *_object_glass_lines(lens),
        f"object_distance_mm = {lens.object_distance_mm!r}",
        f"field_angles_deg = [{angles}]",
        f"wavelengths_um = [{', '.join(map(repr, lens.wavelengths_um))}]",
        f"reference_wavelength_um = {lens.reference_wavelength_um!r}",
    ]
    for key in ("default_configuration", "state"):
        lines += [key_line(key, getattr(lens, key))] if getattr(lens, key) else []
    materials = (lens.object_material, *(s.material for s in lens.surfaces))
    for glass in {m: None for m in materials if m is not None}:
        lines += ["", "[[glass]]", *(key_line(k, v) for k, v in glass_table(glass).items())]
    for surface in lens.surfaces:
        lines += ["", "[[surface]]", *_surface_lines(surface)]
    for state in lens.configurations:
        lines += ["", "[[configuration]]", *configuration_lines(state)]
    return "\n".join(lines) + "\n"


def _object_glass_lines(lens: Lens) -> list[str]:
    is_air = lens.object_glass == AIR.name
    return [] if is_air else [key_line("object_glass", lens.object_glass)]


def _surface_lines(surface: Surface) -> list[str]:
    lines = [
        f"radius_mm = {radius_text(surface.curvature_per_mm)}",
        f"thickness_mm = {surface.thickness_mm!r}",
        key_line("glass", surface.glass),
        f"semi_diameter_mm = {surface.semi_diameter_mm!r}",
    ]
    if surface.conic:
        lines.append(f"conic = {surface.conic!r}")
    rows = ("even_asphere", "odd_asphere", "q_bfs", "q_con")
    lines += [key_line(key, getattr(surface, key)) for key in rows if getattr(surface, key)]
    if surface.normal_radius_mm is not None:
        lines.append(f"normal_radius_mm = {surface.normal_radius_mm!r}")
    if surface.phase is not None:
        lines += phase_lines(surface.phase)
    if surface.stance is not None:
        tilt = ", ".join(map(degrees_text, surface.stance.tilt_rad))
        lines.append(key_line("element_decentre_mm", surface.stance.decentre_mm))
        lines.append(f"element_tilt_deg = [{tilt}]")
    if surface.grooves is not None:
        lines += [key_line(key, value) for key, value in groove_table(surface.grooves).items()]
    if surface.vary:
        lines.append(key_line("vary", surface.vary))
    return lines


def _parse_surface(
    table: _SurfaceTable,
    where: str,
    medium: Callable[[str], Glass],
    catalogues: Sequence[GlassCatalogue],
) -> Surface:
    if table.radius_mm == 0:
        raise ContractError(f"{where}: radius_mm must not be 0 (a plane is inf)")
    try:
        glass = medium(table.glass)
        surface = Surface(
            curvature_per_mm=1 / table.radius_mm,
            thickness_mm=table.thickness_mm,
            glass=glass.name,
            material=own_glass(glass, catalogues),
            semi_diameter_mm=table.semi_diameter_mm,
            conic=table.conic,
            even_asphere=table.even_asphere,
            odd_asphere=table.odd_asphere,
            q_bfs=table.q_bfs,
            q_con=table.q_con,
            normal_radius_mm=table.normal_radius_mm,
            phase=parse_phase(
                table.phase_radial_rad,
                table.phase_free_rad,
                radius_mm=table.phase_radius_mm,
                order=table.phase_order,
            ),
            stance=parse_stance(table.element_decentre_mm, table.element_tilt_deg),
            vary=cast("tuple[Vary, ...]", table.vary),
        )
        return replace(surface, grooves=_parse_grooves(table))
    except (ContractError, UnsupportedError) as error:
        raise type(error)(f"{where}: {error}") from error


def _parse_grooves(table: _SurfaceTable) -> Grooves | None:
    if table.groove_depth_um is None:
        further = {name: getattr(table, name) for name in ("groove_walls", "tool_radius_um")}
        astray = [name for name, value in further.items() if value is not None]
        if astray:
            raise ContractError(f"{', '.join(astray)} without groove_depth_um")
        return None
    return Grooves(
        depth_um=table.groove_depth_um,
        walls=table.groove_walls is not False,
        tool_radius_um=table.tool_radius_um or 0.0,
    )
