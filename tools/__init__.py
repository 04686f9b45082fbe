"""What only a developer runs: `python -m tools.NAME` in the root of a checkout. Not in the wheel.

A file here is a command; a folder holds what commands are made of.

    demo                the main job, end to end
    quality             a bundle beside classical methods, by a fixed protocol
    edge_contrast       contrast of a bundle's pictures on slanted edges
    plan_report         what `--quality adaptive` may skip, calibrated and proved
    design_start        a start lens by random search
    design_stability    how far off a start may be
    design_check        a design against pictures rendered by rays
    joint_report        a joint design against lenses found on spots alone
    lens_table          lenses compared after recovery
    render_chart        pictures by rays and by maps of PSFs compared
    psf_model_error     rays against waves
    trace_speed         speed of the tracer
    stage_profile       where the time of a photograph goes
    measure             time, tiling and RAW files of docs/results/measurements.md
    build_glass         the glass catalogues, from their sources
    evidence            two checkouts compared: hashes of all they compute, seconds
    weight              refuses bundles that change under one version, checkpoints, big pictures
    coverage_gate       refuses a test run that covers too little
    rooms               modules that know one camera only, and lines of code

    capture/            simulated captures, for the tools that judge pictures
    pictures/           captions of the demo's pictures
    comparison/         parts of `quality`
    plan/               parts of `plan_report`
    design/             parts of the tools around a design
    start/              parts of `design_start`
"""
