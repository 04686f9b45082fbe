"""Optics to a frozen PSF and its files: `camkit.freeze` and `camkit freeze`."""

import json
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from camkit.bundle.frozen_optics import write_optics_files
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.stages import Wiener
from camkit.caller import command_text, option_list, option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.field_types import checked
from camkit.models_def.face.torch_need import require_torch
from camkit.runtime.files.in_memory import FilePath, optional_path
from camkit.runtime.output.part_file import refuse_existing

if TYPE_CHECKING:
    from camkit.models_def.optics.freezable_optics import Optics

AUTO: Final = "auto"
DEFAULT_RECIPE: Final = "duet.toml"


@checked
def freeze(
    optics: FilePath,
    out: FilePath,
    *,
    recipe: FilePath | None = None,
    depths_mm: Sequence[float] = (),
    limit_db: float | None = None,
    energy: float | None = None,
    max_side_px: int | None = None,
    focus_um: float | str | None = None,
    haze: FilePath | None = None,
    stress_out: FilePath | None = None,
    stress_haze: FilePath | None = None,
    report: FilePath | None = None,
    quick: bool = False,
    glass: Sequence[FilePath] = (),
    catalogue: str | None = None,
    configuration: str | int | None = None,
    configurations: str | Sequence[str | int] | None = None,
    psf_model: str | None = None,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Compute the PSF of a lens or a plate with as few samples as the loss allows (needs torch).

    Args:
        optics: A lens (.toml, .zmx, .json), a plate (.toml, name, bundle) or a measured PSF
            (.safetensors).
        out: PSF to write (.safetensors).
        recipe: Recipe (.toml) with the sensor and its Wiener bank; None for duet's.
        depths_mm: Object distances, near to far; empty for those of the lens.
        limit_db: Largest mean loss from storing fewer samples; None for 0.05.
        energy: Least share of each colour's light inside the kernels; None for 0.995, of plates
            0.999.
        max_side_px: Largest kernel side, odd; None for 151, of plates 401.
        focus_um: Also store kernels for a sensor shifted by up to this much, or "auto"; None for
            none.
        haze: Store only sharp peaks as kernels, and write the veiling glare to this file.
        stress_out: Also write kernels off the design point to this file (.safetensors).
        stress_haze: With `haze` and `stress_out`: write the veiling glare of those kernels.
        report: Also write the facts to this file (.json), for `camkit.export.bundle`.
        quick: Whether fields, wavelengths and blocks are taken as they usually suit, without a
            search that measures what they cost.
        glass: Catalogues (.agf), and `names` or `numbers`; see `read_noted_lens`.
        catalogue: Catalogues of camkit that are asked first, such as schott,hikari.
        configuration: State of a zoom or focusing lens, by name or number; None for the usual one.
        configurations: Several states in one file, "all" or names; the first is the one that is
            taken where none is named. None for one state.
        psf_model: Of a lens: "rays" or "waves"; None for what the recipe says, or else for waves
            where the blur is small against the Airy disc.
        overwrite: Whether files that exist are replaced.

    Returns:
        What was kept and what it costs, plain JSON values as `camkit freeze --json` prints them.

    Raises:
        ContractError: If an option or the optics are wrong, or a file exists.
        UnsupportedError: If torch is not installed, or the optics cannot be frozen so.
    """
    extra = (haze, stress_out, stress_haze, report)
    haze_path, stress_path, stress_haze_path, report_path = map(optional_path, extra)
    refuse_existing(map(optional_path, (out, *extra)), overwrite=overwrite)
    require_torch(command_text("freeze"))
    from camkit.models_def.face.state_freezing import freeze_states
    from camkit.models_def.optics.freezer import FreezeRequest, freeze_optics
    from camkit.models_def.optics.optics_file import read_optics, read_states
    from camkit.models_def.torch_threads import one_torch_thread

    if (stress_haze is None) != (haze is None or stress_out is None):
        raise ContractError(
            f"with {option_text('haze')}, {option_text('stress_out')} and "
            f"{option_text('stress_haze')} go together; else omit {option_text('stress_haze')}"
        )
    sensor, bank, recipe_model = _camera_of(default_recipe() if recipe is None else Path(recipe))

    def request_of(source: "Optics") -> FreezeRequest:
        return FreezeRequest(
            sensor=sensor,
            bank=bank,
            depths_mm=tuple(depths_mm),
            limit_db=limit_db,
            energy=energy,
            max_side_px=max_side_px,
            focus_um=focus_range_um(source, focus_um),
            haze=haze is not None,
            stress=stress_out is not None,
            quick=quick,
            psf_model=recipe_model if psf_model is None else psf_model,
        )

    file, glasses = Path(optics), tuple(map(str, glass))
    with one_torch_thread():
        if configurations is None:
            source = read_optics(file, glasses, catalogue, configuration)
            freezing = freeze_optics(source, request_of(source))
        else:
            alone = {"configuration": configuration, "haze": haze, "stress_out": stress_out}
            _refuse_beside_states([name for name, value in alone.items() if value is not None])
            states = read_states(file, glasses, catalogue, configurations)
            freezing = freeze_states(states, request_of)
    write_optics_files(
        freezing.optics, Path(out), haze_path, source=_source_text(file, freezing.facts)
    )
    if stress_path is not None and freezing.stress is not None:
        write_optics_files(freezing.stress, stress_path, stress_haze_path)
    if report_path is not None:
        report_path.parent.mkdir(parents=True, exist_ok=True)
        report_path.write_text(json.dumps(freezing.facts, indent=2) + "\n", encoding="utf-8")
    return dict(freezing.facts)


def _refuse_beside_states(names: list[str]) -> None:
    """Refuse what one configuration alone is frozen with."""
    if names:
        raise ContractError(
            f"{option_list(names)} does not apply with {option_text('configurations')}: freeze "
            f"one by {option_text('configuration')}"
        )


def _source_text(file: Path, facts: Mapping[str, object]) -> str:
    """Return where a PSF is from, and its model where it is that of a lens in one state."""
    model = facts.get("psf_model")
    return f"camkit freeze of {file.name}" + (f", by {model}" if model else "")


def focus_range_um(optics: "Optics", focus_um: float | str | None) -> float:
    """Return the range of a moved sensor: a number > 0, or that of a lens for "auto"; 0 for none.

    Raises:
        ContractError: If it is neither.
        UnsupportedError: If the optics are no lens, whose fabricated samples are known.
    """
    if focus_um is None:
        return 0.0
    if focus_um == AUTO:
        from camkit.models_def.optics.lens_optics import LensOptics

        if not isinstance(optics, LensOptics):
            raise UnsupportedError(
                "auto needs a lens, whose fabricated samples differ in focus; give a number in um"
            )
        return optics.focus_range_um()
    try:
        range_um = float(focus_um)
    except ValueError:
        range_um = np.nan
    if not 0 < range_um < np.inf:
        raise ContractError(
            f"{option_text('focus_um')} takes a number > 0 or {AUTO}; got {focus_um!r}"
        )
    return range_um


def default_recipe() -> Path:
    """Return the recipe whose sensor is taken where none is named."""
    return Path(str(resources.files("camkit.models_def.recipes"))) / DEFAULT_RECIPE


def _camera_of(recipe: Path) -> tuple[ColorSensor, Wiener | None, str]:
    """Return the sensor of a recipe, its bank, and the PSF model that it states."""
    from camkit.models_def.kinds.bayer.recipe import BayerRecipe
    from camkit.models_def.training.kind import read_recipe, training_kind

    plan = read_recipe(recipe)
    stages = training_kind(plan.kind).design(plan).stages
    if not isinstance(plan.sensor, ColorSensor):
        raise UnsupportedError(f"a {plan.sensor.type} sensor has no response to freeze a PSF for")
    bank = next((stage for stage in stages if isinstance(stage, Wiener)), None)
    return plan.sensor, bank, plan.lens.psf_model if isinstance(plan, BayerRecipe) else ""
