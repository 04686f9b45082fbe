"""The times and the pulse of a bundle, where its captures state none themselves."""

from typing import Any, Final

from camkit.bundle.manifest import Manifest
from camkit.bundle.sensor import SpadSensor
from camkit.bundle.stages import Sharpen
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.files.counts_file import CountsFile
from camkit.runtime.kinds.spad.timing import Timing, timing_beside

GATE: Final = frozenset({"width_ps", "rc_ps"})
PULSE: Final = GATE | {"jitter_ps", "fwhm_ps"}
WHAT: Final = {"gate": "a scan with a gate", "histogram": "a histogram of arrivals"}
"""Orientation -> what such a capture is."""


def times_of_bundle(manifest: Manifest) -> dict[str, Any]:
    """Return what a bundle says of times and pulse, by the names of a timing file."""
    usual, sensor = manifest.stage(Sharpen), manifest.sensor
    if usual is None or not isinstance(sensor, SpadSensor):
        return {}
    values = {
        "orientation": usual.orientation,
        "time_bin_ps": sensor.time_bin_ps,
        "first_ps": usual.first_ps,
        "width_ps": usual.gate_width_ps,
        "rc_ps": usual.gate_rc_ps,
        "jitter_ps": usual.jitter_ps,
        "fwhm_ps": usual.laser_fwhm_ps,
        "wavelength_nm": usual.laser_wavelength_nm,
    }
    return {name: value for name, value in values.items() if value is not None}


def with_bundle(timing: Timing, manifest: Manifest) -> Timing:
    """Return what is known of times, with what the bundle says where nobody else does."""
    pitch_um = manifest.sensor.known_extent.pixel_pitch_um
    values = {"pitch_um": pitch_um, **times_of_bundle(manifest)}
    unwanted: frozenset[str] = frozenset()
    if timing.irf.file is not None:  # it stands for gate and laser together
        unwanted = PULSE
    elif _drops_gate(timing, manifest):
        unwanted = GATE
    return timing.with_stated({n: value for n, value in values.items() if n not in unwanted})


def check_bins(file: CountsFile, timing: Timing, manifest: Manifest) -> None:
    """Refuse a histogram without times of its own that has other bins than its bundle.

    Raises:
        ContractError: Names both.
    """
    sensor, bin_ps = manifest.sensor, times_of_bundle(manifest).get("time_bin_ps")
    if not isinstance(sensor, SpadSensor) or file.kind != "histogram" or not bin_ps:
        return
    if sensor.time_bins in (0, file.bins) or _states_bins(timing):
        return
    raise ContractError(
        f"the capture has {file.bins} time bins and states no times; bundle {manifest.name} has "
        f"{sensor.time_bins} of {bin_ps:g} ps: state [timing] time_bin_ps in a file for "
        f"{option_text('timing')}"
    )


def notes_of_bundle(file: CountsFile, timing: Timing, manifest: Manifest) -> tuple[str, ...]:
    """Return notes on what a bundle makes of a capture that does not state it.

    Args:
        file: The capture.
        timing: What its timing file and the capture itself state.
        manifest: Of the bundle.
    """
    if file.kind == "counts" or not times_of_bundle(manifest):
        return ()
    return (
        *_surprise(file, timing, manifest),
        *_borrowed(timing, manifest),
        *_gateless(file, timing, manifest),
    )


def _surprise(file: CountsFile, timing: Timing, manifest: Manifest) -> tuple[str, ...]:
    """Return a note where a bundle makes something else of a capture than is usual."""
    usual, of_bundle = file.assumed.get("orientation"), times_of_bundle(manifest).get("orientation")
    if timing.timing.orientation is not None or None in (usual, of_bundle) or usual == of_bundle:
        return ()
    return (
        f"{file.path.name} is taken as {WHAT[str(of_bundle)]}, as bundle {manifest.name} "
        f"states, though such files usually hold {WHAT[str(usual)]}; state [timing] orientation in "
        f"a file for {option_text('timing')}, or in {timing_beside(file.path).name} beside it",
    )


def _borrowed(timing: Timing, manifest: Manifest) -> tuple[str, ...]:
    """Return a note where times or pulse are those of the bundle."""
    is_pulse_stated = timing.irf.file is not None or bool(
        PULSE & (timing.gate.model_fields_set | timing.laser.model_fields_set)
    )
    if _states_bins(timing):
        borrowed = "" if is_pulse_stated else "the pulse is that"
    else:
        borrowed = "times are those" if is_pulse_stated else "times and pulse are those"
    if not borrowed:
        return ()
    return (f"{borrowed} of bundle {manifest.name}; the capture states none",)


def _gateless(file: CountsFile, timing: Timing, manifest: Manifest) -> tuple[str, ...]:
    """Return a note where the gate of a bundle is left out."""
    if not _drops_gate(timing, manifest) or timing.irf.file is not None:
        return ()
    return (
        f"{file.path.name} is stated to be {WHAT['histogram']}: the gate of bundle "
        f"{manifest.name} is left out",
    )


def _drops_gate(timing: Timing, manifest: Manifest) -> bool:
    """Return whether a capture is a histogram without a gate, and its bundle has one."""
    usual = times_of_bundle(manifest)
    return (
        timing.timing.orientation == "histogram"
        and usual.get("orientation") == "gate"
        and "width_ps" in usual
        and timing.gate.width_ps is None
    )


def _states_bins(timing: Timing) -> bool:
    return timing.timing.time_bin_ps is not None or timing.timing.bin_edges_ps is not None
