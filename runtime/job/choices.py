"""Options held against what a camera can do with them: what means nothing to it is refused.

Every option belongs to a stage, which names it in its OPTIONS, or to every camera (GENERAL).
"""

from collections.abc import Sequence
from typing import Final

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import StageEntry
from camkit.caller import option_list, option_text
from camkit.errors import ContractError
from camkit.kinds import BAYER, Kind
from camkit.psf import depth_weights
from camkit.runtime.job.setup import DEVELOPMENT
from camkit.runtime.options import Options, check_kind_options, given_options
from camkit.runtime.plan.binned_work import no_binning
from camkit.runtime.plan.decision import DEVELOP, Work
from camkit.runtime.plan.ways import LEFT_OUT, offered_methods, ways_of
from camkit.runtime.stage_finder import methods_of, module_of

GENERAL: Final = frozenset({"max_mem_bytes", "threads", "method"})
ON_A_SENSOR: Final = frozenset({"assume", "origin_px"})
"""What means something wherever the size of the sensor is known."""
WITH_A_BUNDLE: Final = frozenset({"force_bundle"})
WITH_STATES: Final = frozenset({"configuration"})
"""Options that mean something where the lens has several configurations."""
ALWAYS: Final = frozenset({"unit", "tone", "halves"})
OF_CAPTURE: Final = ON_A_SENSOR | WITH_A_BUNDLE | WITH_STATES | ALWAYS
"""What may be said of how a photograph was taken."""


def known_options(stages: Sequence[StageEntry]) -> frozenset[str]:
    """Return the names of the options that some stages use."""
    return GENERAL.union(*(module_of(stage).OPTIONS for stage in stages))


def check_choices(
    bundle: Bundle | None,
    options: Options,
    *,
    kind: Kind = BAYER,
    usual: Sequence[StageEntry] = DEVELOPMENT,
    of_capture: frozenset[str] = OF_CAPTURE,
) -> None:
    """Refuse options before any work.

    Args:
        bundle: The camera; None for none.
        options: What the caller chose.
        kind: Of the captures.
        usual: Stages without a bundle.
        of_capture: What may be said of how such a capture was taken.

    Raises:
        ContractError: If no stage has the method asked for, an option that was given means nothing
            to any stage, the unit is of another bundle, or the PSF does not reach the depth.
    """
    stages = usual if bundle is None else bundle.manifest.stages
    valid_names = known_options(stages) | (_of_capture(bundle) & of_capture)
    where = f"to captures of the kind {kind.name}" if kind != BAYER else "without a bundle"
    if bundle is not None:
        where = f"to bundle {bundle.manifest.name}"
    check_kind_options(options, kind, where)
    kind_names = {name for name, _ in options.of_kind}
    names = [name for name in given_options(options) if name not in kind_names]
    if foreign := [name for name in names if name not in valid_names]:
        raise ContractError(
            f"{option_list(foreign)} does not apply {where}: "
            f"{'nothing' if bundle is None else 'none of its stages'} uses it; leave it out"
        )
    if options.scale != "1" and (why := no_binning(stages)):
        raise ContractError(f"{option_text('scale')} does not apply {where}: {why}; leave it out")
    if options.size is not None and bundle is not None:
        sizes = bundle.manifest.sizes
        if options.size not in sizes:
            raise ContractError(
                f"bundle {bundle.manifest.name} holds size(s) {', '.join(sizes) or 'none'}; asked "
                f"for {options.size}"
            )
    if bundle is None:
        methods = methods_of(stages) or (DEVELOP,)
    else:
        methods = offered_methods(stages, bundle.manifest.all_planes)
    if options.method is not None and options.method not in methods:
        raise ContractError(
            f"method must be one of {', '.join(methods)} {where}; got {options.method!r}"
        )
    if options.unit is not None:
        options.unit.check(bundle)
    if options.depth_m is not None and bundle is not None:
        # a stage that knows of depths never joins without optics
        depth_weights(bundle.psf.depths_mm, options.depth_mm)


def _of_capture(bundle: Bundle | None) -> frozenset[str]:
    """Return the options that may tell how a photograph was taken."""
    if bundle is None:
        return ALWAYS
    if bundle.manifest.sensor.extent is None:
        return ALWAYS | WITH_A_BUNDLE
    return OF_CAPTURE if bundle.configurations else OF_CAPTURE - WITH_STATES


def check_idle(bundle: Bundle | None, options: Options) -> None:
    """Refuse options that only stages know of which the method leaves out.

    For what a person says: programs may hand one set of options to several methods.

    Raises:
        ContractError: If an option was given that changes nothing.
    """
    if bundle is None or options.method is None:
        return
    stages = bundle.manifest.stages
    usual, now = (ways_of(stages, Work(method=method)) for method in (None, options.method))
    left_out = [
        stage
        for stage, before, after in zip(stages, usual, now, strict=True)
        if before != LEFT_OUT and after == LEFT_OUT
    ]
    others = [stage for stage in stages if stage not in left_out]
    idle = known_options(left_out) - known_options(others)
    if names := [name for name in given_options(options) if name in idle]:
        raise ContractError(
            f"{option_list(names)} does not apply with {option_text('method', options.method)}, "
            "which runs no stage that uses it; leave it out"
        )
