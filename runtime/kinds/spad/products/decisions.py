"""The plan of a capture of single photons: what would be done, and why."""

from collections.abc import Iterator
from dataclasses import replace

from camkit.bundle.stages import SuperResolve
from camkit.runtime.job.job import Job
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture, photons_of
from camkit.runtime.kinds.spad.products.record import told_axis, told_way
from camkit.runtime.kinds.spad.stages.super_resolve import camera_of, size_of_network
from camkit.runtime.plan.decision import Work
from camkit.runtime.plan.planner import asked_work

Told = tuple[str, str, str]
"""What is decided, what is chosen, why."""


def know_photons(job: Job) -> Job:
    """Return the job of a capture with its plan.

    Raises:
        ContractError: If no stage has the method asked for.
    """
    capture, log, bundle = photons_of(job), job.log, job.bundle
    options = job.options
    work = Work(method=options.method) if bundle is None else asked_work(bundle, options)
    log.notes += capture.notes
    log.record |= {
        "product": capture.product,
        "width": capture.width,
        "height": capture.height,
        "bins": capture.bins,
    }
    if capture.axis is not None:
        log.record |= told_axis(capture.axis)
    if capture.product == "depth":
        log.record |= told_way(capture.settings.way)
    log.record["decisions"] = [
        {"what": what, "choice": choice, "reason": reason, "saving_s": 0.0, "cost_db": 0.0}
        for what, choice, reason in _decisions(job, capture)
    ]
    return replace(job, white_balance=(1.0,), work=work)


def _decisions(job: Job, capture: PhotonCapture) -> Iterator[Told]:
    settings, timing = capture.settings, capture.timing
    of_file = (
        "the capture holds counts" if capture.axis is None else "the capture holds times of photons"
    )
    yield "product", capture.product, of_file if settings.product is None else "asked"
    if (file := settings.timing_file) is not None:
        is_named = job.options.chosen("timing") is not None
        yield "timing", file.name, "asked" if is_named else "lies beside the capture"
    finer = [stage for stage in job.setup.stages if isinstance(stage, SuperResolve)]
    if capture.product == "depth":
        yield from _depth(capture, is_finer=bool(finer))
    if finer:
        yield from _finer(job, finer[0], capture)
    cycles = timing.timing.cycles
    reason = f"{cycles} cycles are stated" if cycles else "no cycles are stated"
    yield "pile-up", "corrected" if cycles else "left as it is", reason


def _depth(capture: PhotonCapture, *, is_finer: bool) -> Iterator[Told]:
    way, is_stated = capture.settings.way, capture.timing.pulse() is not None
    if is_stated:
        yield "pulse", "stated", "a pulse is stated"
    else:
        yield "pulse", "estimated", "none is stated"
    is_asked = "method" in capture.settings.chosen
    yield "method", way.method, "asked" if is_asked else "default"
    if is_finer:
        told = "the estimate of the fine grid takes as many as the light demands"
        yield "neighbours", "weighed", told
    else:
        told = "only where one pixel has too few photons" if way.pool == "auto" else "asked"
        yield "neighbours", way.pool, told
    if way.returns == 2:
        yield "second return", "sought", "only where the residual of one asks for it"
    else:
        yield "second return", "left out", "not asked"


def _finer(job: Job, stage: SuperResolve, capture: PhotonCapture) -> Iterator[Told]:
    """Yield how pictures become finer behind a plate, as the capture's light will decide."""
    camera = camera_of(stage, job)
    size, is_asked = size_of_network(camera, capture), capture.settings.finer is not None
    network = "linear" if size is None else f"network {size}"
    if is_asked or size is None:
        yield "finer", network, "asked" if is_asked else "the bundle holds no network"
    elif capture.product == "depth":
        yield (
            "finer",
            f"{network} or linear",
            f"the network from {stage.network_from_photons:g} signal photons of a pixel on, "
            "nearer to the truth there; below, the linear estimate; a larger network brings times "
            "little nearer",
        )
    else:
        yield "finer", network, "the best that the bundle has"
        yield "empty frames", "skipped", "a frame without photons stays dark"
