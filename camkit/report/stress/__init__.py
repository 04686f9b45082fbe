"""Where methods fail: scenarios with a knob, swept until the network no longer helps.

In the order of the work:

    scene         sharp pictures that no training has seen, and their places on the sensor
    twin          the digital twin with a changed lens, light, exposure, noise or sensor
    rig           every method on one capture, the Wiener bank computed once
    consistency   chi^2 per pixel of a restoration, blurred again, against the capture
    score         PSNR in sensor geometry, and everything else that is judged
    scenario      what a scenario is, and how `scenarios/` is discovered
    scenarios/    one file per scenario
    sweep, curve  values x scenes, journalled so that a run may be resumed
    break_point   where a method stops helping, with its confidence
    measured_ranges   what the runtime may rely on: the `envelope` of the bundle
    report        JSON
    chart, patch, page   curves, and one HTML page with the worst patches
    run           all of it

Torch is not needed.
"""
