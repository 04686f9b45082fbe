"""A recipe for a lens of somebody else: every key written out, with where its value comes from.

The numbers that have proved themselves for the built-in cameras stand in place of the defaults.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from camkit.bundle.light_bound import LightBound
from camkit.bundle.stages import Wiener
from camkit.models_def.kinds.bayer.recipe import BayerDataRecipe, LensRecipe
from camkit.models_def.recipe_text import table_lines
from camkit.models_def.sensors.sensor_choice import SensorChoice
from camkit.models_def.toml_table import key_line
from camkit.models_def.training.recipe import ScheduleRecipe

BEYOND_ISO: Final = 2.0
"""Times the highest ISO of the sensor: what networks are trained up to."""
COPIES: Final[Mapping[str, int]] = {
    "copies": 6,
    "validation_copies": 2,
    "fields": 13,
    "rays": 2048,
    "wavelengths": 13,
}
"""Traced in a twelfth of the time that the built-in cameras took for theirs."""
WIENER: Final[Mapping[str, Any]] = {
    "block_px": 256,
    "overlap_px": 96,
    "prior_scale": 3e-4,
    "prior_exponent": 2.5,
    "clip_iterations": 3,
    "clip_power": 2.0,
    "clip_reach_px": 16,
}
DATA: Final[Mapping[str, Any]] = {
    "first_samples": 400,
    "pool_samples": 1600,
    "steps_per_sample": 4,
    "exposure_min_ev": -4.0,
    "exposure_max_ev": 1.5,
    "drift_share": 0.2,
    "edge_share": 0.1,
    "night_share": 0.06,
    "lamp_share": 0.12,
    "patch_share": 0.06,
    "light_share": 0.25,
    "designed_share": 0.15,
}
SCHEDULE: Final[Mapping[str, Any]] = {"steps": 48000, "learning_rate": 8e-4, "overshoot": 1.5}
NETWORKS: Final = {"S": ("lean_s", 2.0), "M": ("lean_m", 1.5)}
OF_MEASURED: Final = ("psf", "uncertainty")
OF_LENSES: Final = (
    *("prescription", "fields", "kernel_px", "rays", "wavelengths", "bank_in_focus", "uncertainty"),
)
"""Keys of `[lens]` that the other kind of optics has; the uncertainty is that of the file."""
_STAGE_KEYS: Final = ("type", "takes", "gives")


@dataclass(frozen=True, slots=True, kw_only=True)
class RecipeDraft:
    """The parts of a recipe.

    Attributes:
        name: Of the camera.
        sensor: Its sensor.
        optics: Path of the lens beside the recipe, or of its measured PSF.
        is_measured: Whether it is a PSF.
        is_own_colours: Whether its kernels are those of the sensor's own colours, so that no
            response weights them.
        focus_mm: Distance that it is focused on, from the first vertex.
        objects_mm: Distances of the scene likewise; of one that is the focus none are stated, of
            several the bank finds which it is.
        kernel_px: Side of the kernels that are trained with, odd.
        blocks: (block_px, overlap_px) of the bank; None for the usual ones.
    """

    name: str
    sensor: SensorChoice
    optics: str
    focus_mm: float
    is_measured: bool = False
    is_own_colours: bool = False
    objects_mm: Sequence[float] = ()
    kernel_px: int = 129
    blocks: tuple[int, int] | None = None


def recipe_text(draft: RecipeDraft) -> str:
    """Return the recipe as TOML."""
    depths = tuple(draft.objects_mm) if tuple(draft.objects_mm) != (draft.focus_mm,) else ()
    lens = {
        "psf" if draft.is_measured else "prescription": draft.optics,
        "kernel_px": draft.kernel_px,
        "depths_mm": depths,
        **COPIES,
    }
    left_out = OF_LENSES if draft.is_measured else OF_MEASURED
    block_px, overlap_px = draft.blocks or (WIENER["block_px"], WIENER["overlap_px"])
    bank = dict(WIENER) | {"block_px": block_px, "overlap_px": overlap_px}
    if len(depths) > 1:
        bank["depth"] = "estimated"
    lines = [
        f"# The camera {draft.name}: every key, with its default. See docs/guides/training.md.",
        "",
        key_line("name", draft.name),
        "# Of the focus, from the first vertex of the lens.",
        key_line("object_distance_mm", draft.focus_mm),
        "# Between linear light and what the networks work in.",
        key_line("scale", 64.0),
        "",
        *_sensor_lines(draft.sensor),
        *([] if draft.is_own_colours else _response_lines(draft.sensor)),
        *table_lines("wiener", Wiener, bank, left_out=_STAGE_KEYS),
        *table_lines("light", LightBound, {"spread": 0.2, "keeps_bright": True}),
        *table_lines("lens", LensRecipe, lens, left_out=left_out),
        *table_lines("data", BayerDataRecipe, _data_of(draft.sensor, block_px, overlap_px)),
        *table_lines("schedule", ScheduleRecipe, SCHEDULE),
    ]
    for size, (network, overshoot) in NETWORKS.items():
        lines += [
            f"[networks.{size}]",
            key_line("network", network),
            "config = { bias = true }",
            f"schedule = {{ {key_line('overshoot', overshoot)} }}",
            "",
        ]
    return "\n".join(lines)


def _data_of(sensor: SensorChoice, block_px: int, overlap_px: int) -> dict[str, Any]:
    """Return the settings of samples.

    From the bank they take half its overlap, and half the way between blocks, from the sensor twice
    its highest ISO. Developed pictures are white-balanced already.
    """
    highest_iso = max(entry["iso"] for entry in sensor.table["noise"])
    balanced = {} if "cfa" in sensor.table else {"light_share": 0.0}
    blocks = {"margin_px": overlap_px // 2, "block_jitter_px": (block_px - overlap_px) / 2}
    return {**DATA, "iso_max": BEYOND_ISO * highest_iso, **balanced, **blocks}


def _sensor_lines(sensor: SensorChoice) -> list[str]:
    lines = ["[sensor]"]
    for key, value in sensor.table.items():
        source = sensor.sources.get(key)
        lines += [] if source is None else [f"# {source}"]
        if key == "noise":
            entries = (", ".join(key_line(k, v) for k, v in entry.items()) for entry in value)
            lines += ["noise = [", *(f"    {{ {entry} }}," for entry in entries), "]"]
        elif key == "color_matrix":
            lines += ["color_matrix = [", *(f"    {list(row)}," for row in value), "]"]
        else:
            lines.append(key_line(key, value))
    return [*lines, ""]


def _response_lines(sensor: SensorChoice) -> list[str]:
    response = sensor.response
    return [
        "[sensor.channel_response]",
        key_line("wavelengths_um", response["wavelengths_um"]),
        "response = [",
        *(f"    {list(row)}," for row in response["response"]),
        "]",
        key_line("source", response["source"]),
        "",
    ]
