"""The facts of a lens as JSON; beside every null stands why there is no number."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from torch import Tensor

from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.prescription import grooves_of
from camkit.models_def.optics.trace import Fate
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.report.pages.lens.lens_image import SHARES
from camkit.units import to_degrees

WHY: Final = "why_null"
_AFOCAL: Final = "the lens is afocal: parallel light leaves it parallel"
_WHOLE_LENS: Final = {
    "efl_mm": _AFOCAL,
    "bfl_mm": _AFOCAL,
    "ffl_mm": _AFOCAL,
    "f_number": _AFOCAL,
    "third_order_transverse_mm": _AFOCAL,
    "airy_radius_mm": "the light makes no cone on the axis: the lens has no focus",
    "entrance_pupil_mm": "the entrance pupil lies at infinity",
    "entrance_pupil_diameter_mm": "the entrance pupil lies at infinity",
    "exit_pupil_mm": "the exit pupil lies at infinity: the lens is telecentric behind",
    "exit_pupil_diameter_mm": "the exit pupil lies at infinity: the lens is telecentric behind",
    "narrowest_mm": "the surface has no whole groove",
    "spot_rms_mm": "no ray of the field reaches the sensor",
    "wavefront_rms_um": "fewer than four rays reach the sensor and come from its exit pupil",
}
_FACTS: Final = {
    "stop_radius_real_mm": "the real stop radius",
    "seidel_mm": "third-order sums",
    "third_order_transverse_mm": "third-order sums",
    "relative_illumination": "relative illumination",
}
_NO_NUMBER: Final = "it is infinite or not defined for this lens"


def to_json(facts: LensFacts) -> dict[str, Any]:
    """Return the object that `camkit lens show --json` prints.

    Where there is no number stands None, and in `why_null` beside it the reason by name.
    """
    data, sums = facts.paraxial, facts.seidel
    path = chief_path(facts.lens)

    def why(name: str) -> str:
        return facts.reasons.get(_FACTS.get(name, ""), _WHOLE_LENS.get(name, _NO_NUMBER))

    report = {
        "name": facts.lens.name,
        "efl_mm": data.efl_mm,
        "bfl_mm": data.bfl_mm,
        "ffl_mm": data.ffl_mm,
        "f_number": data.f_number,
        "total_track_mm": facts.total_track_mm,
        "entrance_pupil_mm": data.entrance_pupil_mm,
        "entrance_pupil_diameter_mm": data.entrance_pupil_diameter_mm,
        "exit_pupil_mm": data.exit_pupil_mm,
        "exit_pupil_diameter_mm": data.exit_pupil_diameter_mm,
        "stop_radius_paraxial_mm": data.stop_semi_diameter_mm,
        "stop_radius_real_mm": facts.real_stop_mm,
        "reference_wavelength_um": facts.lens.reference_wavelength_um,
        "seidel_mm": None if sums is None else sums.sums_mm.tolist(),
        "third_order_transverse_mm": None if sums is None else sums.transverse_mm(),
        "aimed_to_deg": to_degrees(float(path.angles_rad[-1])),
        "aimed_to_mm": float(path.heights_mm[-1]),
        "pupil": facts.pupil.definition,
        "pupil_reason": facts.choice.definition_reason,
        "pupil_sampling": facts.pupil.sampling,
        "pupil_sampling_reason": facts.choice.sampling_reason,
        "psf_model": facts.model.regime,
        "psf_model_reason": facts.model.reason,
        "grooves": grooves_of(facts.lens),
    }
    result: dict[str, Any] = _plain(report, why)
    result["fields"] = [
        _plain(_field(facts, i, j), _why_field(facts, i, j))
        for i in range(len(facts.lens.field_angles_rad))
        for j in range(len(facts.lens.wavelengths_um))
    ]
    result["all_wavelengths"] = [
        _plain(_all_waves(facts, i), partial(_all_waves_reason, facts, i))
        for i in range(len(facts.lens.field_angles_rad))
    ]
    result["encircled_energy"] = [
        _plain(_encircled(facts, i), partial(_light_reason, facts, i))
        for i in range(len(facts.lens.field_angles_rad))
        if facts.image is not None
    ]
    result["convergence"] = [_plain(row, why) for row in _convergence(facts)]
    result["configurations"] = [_plain(state.to_json(), why) for state in facts.states]
    result["notes"] = list(facts.notes)
    return result


def _field(facts: LensFacts, i: int, j: int) -> dict[str, Any]:
    def at(values: Tensor) -> float:
        return float(values[i, j])

    return {
        "field_angle_deg": round(to_degrees(facts.lens.field_angles_rad[i]), 12),
        "wavelength_um": facts.lens.wavelengths_um[j],
        "spot_rms_mm": at(facts.rms_mm),
        "spot_rms_chief_mm": at(facts.rms_chief_mm),
        "spot_max_mm": at(facts.max_mm),
        "airy_radius_mm": float(facts.airy_mm[j]),
        "chief_height_mm": at(facts.chief_mm),
        "distortion_percent": 100 * at(facts.distortion),
        "relative_illumination": at(facts.illumination),
        "wavefront_rms_um": at(facts.wavefront_um),
        "strehl": None if facts.image is None else at(facts.image.strehl),
        "rays": facts.fates(i, j),
    }


def _why_field(facts: LensFacts, i: int, j: int) -> Callable[[str], str]:
    """Return what says why a number of a field and wavelength is missing."""
    fates = facts.fates(i, j)
    lost_text = ", ".join(
        f"{count} {name.replace('_', ' ')}"
        for name, count in fates.items()
        if count and name != Fate.VALID.name.lower()
    )

    def why(name: str) -> str:
        dark = facts.dark_reason(i)
        if not dark and not fates[Fate.VALID.name.lower()]:
            dark = "no ray of this wavelength reaches the sensor"
        if name == "airy_radius_mm":
            return _WHOLE_LENS[name]
        if dark:
            return f"{dark}: {lost_text}" if lost_text else dark
        if name == "strehl":
            return _light_reason(facts, i)
        return facts.reasons.get(_FACTS.get(name, ""), _WHOLE_LENS.get(name, _NO_NUMBER))

    return why


def _all_waves(facts: LensFacts, i: int) -> dict[str, Any]:
    return {
        "field_angle_deg": round(to_degrees(facts.lens.field_angles_rad[i]), 12),
        "spot_rms_mm": float(facts.rms_all_mm[i]),
    }


def _all_waves_reason(facts: LensFacts, i: int, name: str) -> str:
    return facts.dark_reason(i) or _WHOLE_LENS[name]


def _light_reason(facts: LensFacts, i: int, _name: str = "") -> str:
    """Return why the image of a field is not known in full."""
    if facts.image is None:
        return "images of points were not asked for"
    return (
        facts.dark_reason(i) or facts.image.reasons[i] or "the circle is wider than what was summed"
    )


def _encircled(facts: LensFacts, i: int) -> dict[str, Any]:
    image = facts.image
    assert image is not None
    dark = bool(facts.dark_reason(i))
    return {
        "field_angle_deg": round(to_degrees(facts.lens.field_angles_rad[i]), 12),
        "by": None if dark else "rays" if image.images[i] is None else "waves",
        **{
            f"radius_{100 * share:.0f}_mm": math.nan if dark else image.radius_mm(i, share)
            for share in SHARES
        },
    }


def _convergence(facts: LensFacts) -> list[dict[str, Any]]:
    convergence = facts.convergence
    return [
        {"pupil_sampling": name, "rays": rays, "spot_rms_mm": rms}
        for name, rays, rms in zip(
            convergence.samplings, convergence.rays, convergence.rms_mm.tolist(), strict=True
        )
    ]


def _plain(value: Any, why: Callable[[str], str]) -> Any:
    """Return JSON values: None for what is no number, and in the same object why."""
    if isinstance(value, list):
        return [_plain(inner, why) for inner in value]
    if not isinstance(value, dict):
        return None if isinstance(value, float) and not math.isfinite(value) else value
    plain = {name: _plain(inner, why) for name, inner in value.items()}
    missing = {name: why(name) for name, inner in plain.items() if _has_none(inner)}
    return {**plain, WHY: missing} if missing else plain


def _has_none(value: Any) -> bool:
    return value is None or (isinstance(value, list) and any(map(_has_none, value)))
