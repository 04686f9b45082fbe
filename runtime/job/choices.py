"""Options held against what a camera can do with them: what means nothing to it is refused.

Every option belongs to a stage, which names it in its OPTIONS, or to every camera (GENERAL).
"""

from collections.abc import Sequence
from dataclasses import fields
from typing import Final

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Stage, Wiener
from camkit.contracts import depth_weights
from camkit.errors import ContractError
from camkit.runtime.job.setup import DEVELOPMENT
from camkit.runtime.options import Options, flag_of
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.plan.ways import offered_methods
from camkit.runtime.stage_finder import stage_module

GENERAL: Final = frozenset({"max_mem_bytes", "threads", "method", "unit"})
ON_A_SENSOR: Final = frozenset({"assume", "origin_px"})
"""What means something wherever the size of the sensor is known."""


def known_options(stages: Sequence[Stage]) -> frozenset[str]:
    """Name the options that mean something to some stages."""
    return GENERAL.union(*(stage_module(stage.type).OPTIONS for stage in stages))


def check_choices(bundle: Bundle | None, options: Options) -> None:
    """Refuse options before any work.

    Raises:
        ContractError: If no stage has the method asked for, an option that was given means nothing
            to any stage, the unit is of another bundle, or the PSF does not reach the depth.
    """
    stages = DEVELOPMENT if bundle is None else bundle.manifest.stages
    known = known_options(stages)
    if bundle is not None and bundle.manifest.sensor.extent is not None:
        known |= ON_A_SENSOR
    plain = Options()
    given = [f.name for f in fields(Options) if getattr(options, f.name) != getattr(plain, f.name)]
    where = "without a bundle" if bundle is None else f"to bundle {bundle.manifest.name}"
    if foreign := [name for name in given if name not in known]:
        raise ContractError(
            f"{', '.join(map(flag_of, foreign))} means nothing {where}: "
            f"{'nothing there' if bundle is None else 'no stage of it'} knows of that; leave it out"
        )
    if options.size is not None and bundle is not None:
        sizes = bundle.manifest.sizes
        if options.size not in sizes:
            raise ContractError(
                f"bundle {bundle.manifest.name} holds size(s) {', '.join(sizes) or 'none'}; asked "
                f"for {options.size}"
            )
    methods = (DEVELOP,) if bundle is None else offered_methods(stages, bundle.manifest.all_planes)
    if options.method is not None and options.method not in methods:
        raise ContractError(
            f"method must be one of {', '.join(methods)} {where}; got {options.method!r}"
        )
    if options.unit is not None:
        options.unit.check(bundle)
    if options.depth_m is not None and bundle is not None:
        assert bundle.manifest.stage(Wiener) is not None  # only a bank knows of depths
        depth_weights(bundle.psf.depths_mm, options.depth_mm)
