"""In which numbers a step multiplies: bfloat16 only where that is the faster way."""

import torch

from camkit.models_def.training.recipe import ScheduleRecipe


def half_precision(schedule: ScheduleRecipe, device: torch.device, progress: float) -> bool:
    """Return whether a step multiplies in bfloat16.

    A processor without instructions for it emulates them, several times slower than float32, and
    so computes in float32.

    Args:
        schedule: Asks for a precision, and for float32 in the last share of the schedule.
        device: Where the network is.
        progress: How much of the schedule lies behind, 0..1.
    """
    if schedule.precision != "bfloat16" or progress >= 1 - schedule.float32_share:
        return False
    return multiplies_bfloat16(device)


def multiplies_bfloat16(device: torch.device) -> bool:
    """Return whether a device multiplies bfloat16 itself; of devices but CPUs it is assumed."""
    if device.type != "cpu":
        return True
    capabilities = torch.cpu.get_capabilities()
    return any(
        capabilities.get(name, False) for name in ("avx512_bf16", "amx_bf16", "sve_bf16", "bf16")
    )
