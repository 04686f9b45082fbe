"""Limits of methods: scenarios with a knob, swept until the network no longer helps.

In the order of the work:

    scene         sharp pictures that no training has seen, and their places on the sensor
    shot, taking  a capture beside the truth, and how scenarios take one
    lamps         lights by their spectra
    kernel_change  kernels enlarged and turned
    rig           light through a lens, and every method on one capture, by the pipeline itself
    consistency   chi^2 per pixel of a restoration, blurred again, against the capture
    verdict       what a sweep asks of any kind of camera
    score         the judge of cameras that photograph: PSNR in sensor geometry, and all else
    scenario      what a scenario is, a row that makes one, and how `scenarios/` is discovered
    scenarios/    tables of scenarios, a module for each family
    stress_part   what a kind of camera brings: scenes, examiner, scenarios
    sweep, curve  values x scenes, journalled so that a run may be resumed
    break_point   where a method stops helping, with its confidence
    measured_ranges   what the runtime may rely on: the `envelope` of the bundle
    report        JSON
    stress_chart, stress_page   curves, and one HTML page with the worst patches
    stress_run    all of it

The digital twin is that of the runtime (`camkit.runtime.twin`). Torch is not needed.
"""
