"""The facts of a photograph before its stages are made ready, and its plan.

checked against the sensor -> placed -> looked at by the stages -> planned
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor
from camkit.bundle.stages import StageEntry
from camkit.bundle.states.lens_state import usual_note
from camkit.caller import option_text
from camkit.cfa import CfaPattern, shifted_cfa
from camkit.errors import ContractError
from camkit.runtime.capture import COLOURS, Capture
from camkit.runtime.content import Content, light_squares, measure_content
from camkit.runtime.files.doubts import notes_behind
from camkit.runtime.geometry.placement import place
from camkit.runtime.job.job import Job
from camkit.runtime.options import Options
from camkit.runtime.plan.binned_work import SIDES_PX, draft_side_px
from camkit.runtime.plan.decision import DEVELOP, Subject, Work, cells_record
from camkit.runtime.plan.planner import make_plan, needs_content
from camkit.runtime.plan.rules.lights import needs_lights
from camkit.runtime.plan.ways import ways_of, without_networks
from camkit.runtime.signal.binned_capture import binned_capture
from camkit.runtime.stage_finder import module_of, stage_keys

BINNING: Final = "binning"
"""Name of the clock of averaging the mosaic."""


def know_photograph(job: Job) -> Job:
    """Return the job of a photograph with all that is known of it.

    Raises:
        ContractError: If capture, bundle and options do not fit each other.
    """
    job.log.clipped_fraction = 0.0
    if job.options.iso is not None:
        job = replace(job, capture=replace(job.capture, iso=job.options.iso, noise=None))
    job.log.notes += _first_notes(job)
    extent = None if job.bundle is None else job.bundle.manifest.sensor.extent
    placement = place(job.capture, extent, job.options.assume)
    job = _binned(replace(job, sensor_place=placement))
    ones = (1.0,) * job.capture.channels
    job = looked_at(replace(job, white_balance=ones), job.setup.stages)
    if placement.note and job.bundle is not None:
        job.log.notes.append(placement.note)
    job = _planned(job)
    ways = ways_of(job.setup.stages, job.work)
    job.log.record["stages"] = {
        key: {"way": way or "left out"}
        for key, way in zip(stage_keys(job.setup.stages), ways, strict=True)
    }
    return job


def _binned(job: Job) -> Job:
    """Return the job whose mosaic is averaged over squares, if the caller wants less of it.

    Raises:
        ContractError: If a smaller picture was asked for of what is no mosaic.
    """
    options, capture = job.options, job.capture
    side_px = SIDES_PX[options.scale]
    if side_px > 1 and capture.cfa is None:
        raise ContractError(
            f"{option_text('scale', options.scale)} averages a mosaic, and the capture has full "
            "colour; leave it out"
        )
    enlarged_px = None
    if side_px == 1 and job.bundle is not None and capture.cfa is not None:
        side_px = draft_side_px(options, job.setup.stages)
        enlarged_px = (capture.height, capture.width) if side_px > 1 else None
    if side_px == 1:
        return job
    with job.log.clock.stage(BINNING):
        small = binned_capture(capture, side_px, threads=job.threads)
    if enlarged_px is not None:
        small = replace(small, window=capture.window)
    return replace(
        job,
        capture=small,
        sensor_place=job.placement.binned(side_px),
        enlarged_px=enlarged_px,
    )


def looked_at(job: Job, stages: Sequence[StageEntry]) -> Job:
    """Return the job with what its stages find before anything is planned, in their order."""
    for stage in stages:
        look = getattr(module_of(stage), "look", None)
        if look is not None:
            job = look(stage, job)
    return job


def content_of(job: Job) -> Content:
    """Return what is in the picture, of a job that knows its noise."""
    noise = job.noise.with_gains(job.white_balance)
    with job.log.clock.stage("scene"):
        content = measure_content(job.capture, noise, job.white_balance, job.placement.window)
    job.log.record["scene"] = content.to_json()
    return content


def _planned(job: Job) -> Job:
    """Plan no more than the capture needs; without a bundle there is nothing to plan."""
    bundle = job.bundle
    if bundle is None:
        return replace(job, work=Work(method=DEVELOP, networks=False))
    options = job.options
    if job.falls_back:
        options = replace(options, method=_method_below(bundle))
    content = None
    binning = job.capture.binning
    if needs_content(options) and binning is None:
        job = job.with_noise()
        content = content_of(job)
    lights = None
    if needs_lights(bundle):
        lights = light_squares(job.capture) if content is None else content.lights
    subject = Subject(
        bundle=bundle,
        options=options,
        height_px=job.capture.height,
        width_px=job.capture.width,
        placement=job.placement,
        content=content,
        lights=lights,
        side_px=1 if binning is None else binning.side_px,
        enlarged=job.enlarged_px is not None,
    )
    plan = make_plan(subject, lambda: job.setup.speed(bundle.manifest.sizes))
    if plan.note:
        job.log.notes.append(plan.note)
    job.log.record["quality"] = options.quality
    job.log.record["decisions"] = [decision.to_json() for decision in plan.decisions()]
    if plan.work.labels is not None:
        job.log.record["cells"] = cells_record(plan.work.labels)
    return replace(job, plan=plan, work=plan.work)


def _method_below(bundle: Bundle) -> str | None:
    work = without_networks(bundle.manifest, Work())
    if work is None:
        raise ContractError(
            f"bundle {bundle.manifest.name} has nothing to fall back to: its networks "
            f"cannot be left out; use {option_text('on_unsafe', 'warn')}"
        )
    return work.method


def _first_notes(job: Job) -> list[str]:
    """Refuse a capture that the sensor does not give; return what is to be said of it.

    Raises:
        ContractError: Names both sides.
    """
    capture, bundle = job.capture, job.bundle
    if bundle is None:
        if capture.channels != COLOURS:
            raise ContractError(
                f"without a bundle only captures of {COLOURS} colours are developed; this one "
                f"has {capture.channels} channel(s)"
            )
        return list(capture.notes)
    manifest = bundle.manifest
    notes = notes_behind(capture, bundle.haze) if manifest.has_haze else list(capture.notes)
    notes += _camera_notes(capture, bundle, job.options)
    if bundle.configuration:
        job.log.record["configuration"] = bundle.configuration
        if job.options.configuration is None:
            notes.append(usual_note(bundle.configurations, bundle.configuration))
    inputs = manifest.sensor.inputs
    if capture.contract not in inputs:
        raise ContractError(
            f"bundle {manifest.name} takes {' or '.join(inputs)}, the capture is "
            f"{capture.contract}; use another bundle or {option_text('bundle', 'none')}"
        )
    if isinstance(manifest.sensor, BayerSensor):
        _check_cfa(capture, manifest.sensor.cfa, job.options)
    if capture.contract != inputs[0]:
        notes.append("the capture has full colour instead of a mosaic: demosaicking is skipped")
    return notes


def _camera_notes(capture: Capture, bundle: Bundle, options: Options) -> list[str]:
    """Refuse a capture of another camera; warn where that can only be feared.

    A bundle without optics that takes pictures of any size is for every camera.
    """
    manifest, notes = bundle.manifest, list[str]()
    if manifest.optics is None and manifest.sensor.extent is None:
        return notes
    has_optics = capture.psf_sha256 in (None, bundle.psf_sha256)
    if capture.bundle_name == manifest.name and not has_optics:
        notes.append(
            f"the capture was made through other kernels than those of {bundle.path.name}, though "
            f"by a bundle of the same name: name that one by {option_text('bundle')}"
        )
    is_of_optics = has_optics and capture.psf_sha256 is not None
    if capture.bundle_name not in (None, manifest.name) and not is_of_optics:
        text = f"the capture names bundle {capture.bundle_name}, not {manifest.name}"
        if not options.force_bundle:
            raise ContractError(
                f"{text}; name that one, or add {option_text('force_bundle')} if both have one lens"
            )
        notes.append(f"{text}: the result is right only if both have the same lens")
    is_file = capture.sha256 is not None
    if capture.bundle_name is None and manifest.has_kernels and (capture.camera or is_file):
        camera = capture.camera
        source = f"is from the camera {camera}" if camera else "names no camera"
        notes.append(
            f"the capture {source}: the result is right only with the lens of bundle "
            f"{manifest.name}"
        )
    return notes


def _check_cfa(capture: Capture, cfa: CfaPattern, options: Options) -> None:
    """Refuse a mosaic that does not begin as the sensor does at the place of the capture."""
    capture_cfa, origin = capture.cfa, capture.origin_px
    if capture_cfa is None or origin is None or options.assume is not None:
        return
    expected = shifted_cfa(cfa, origin)
    if capture_cfa != expected:
        raise ContractError(
            f"the mosaic begins with {capture_cfa}, the sensor (CFA {cfa}) has {expected} at "
            f"{origin}: the place of the crop ({option_text('origin_px')}) or the "
            "pattern is wrong"
        )
