"""Networks that look at the whole picture: one window must hold every picture of the camera."""

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network
from camkit.errors import ParityError
from camkit.runtime.job.walker import FIXED_BYTES
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.tiling import TileLimits, lay_windows
from camkit.runtime.network.windows import SizedNetwork
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES

_SAMPLE_BYTES = 2


def prove_one_window(bundle: Bundle, role: str, size: str) -> str:
    """Show that the usual memory cap holds a whole picture of the sensor in one window.

    Args:
        bundle: The bundle.
        role: Of a network with `global_operators`.
        size: Of it.

    Returns:
        What was shown.

    Raises:
        ParityError: If it does not, or the sensor takes pictures of any size: then pictures would
            have to be tiled, and that is refused in mode exact.
    """
    facts = bundle.network_facts(role, size)
    found = inspect_graph(bundle.network_bytes(role, size))
    cannot = f"cannot be tiled ({facts.global_text})"
    extent = bundle.manifest.sensor.extent
    if extent is None:
        raise ParityError(
            f"size {size}: {cannot}, and the sensor takes pictures of any size: state its extent, "
            "or export a network that looks at windows"
        )
    stage = next(one for one in bundle.manifest.stages_of(Network) if one.role == role)
    ratio = bundle.manifest.all_planes[stage.takes[0]].grid.pitch_ratio
    height, width = round(extent.height_px / ratio), round(extent.width_px / ratio)
    network = SizedNetwork(
        size=size, run=np.copy, facts=facts, block_bytes=found.block_bytes_per_pixel
    )
    whole = TileLimits(stride_px=network.stride_px, halo_px=0, max_bytes=2**62, whole=True)
    window = lay_windows(height, width, whole).needed_bytes(network.cost)
    needed = window + FIXED_BYTES + _SAMPLE_BYTES * extent.height_px * extent.width_px
    if needed > DEFAULT_MAX_MEM_BYTES:
        raise ParityError(
            f"size {size}: {cannot}, and one window of the {width}x{height} px of the sensor takes "
            f"about {needed // 10**6} MB, more than the usual {DEFAULT_MAX_MEM_BYTES // 10**6} MB: "
            "export a network that looks at windows"
        )
    return f"{cannot}; one window holds the {width}x{height} px of the sensor"
