"""Commands that only a developer runs: `python -m tools.NAME` in the root of a checkout.

They are not in the wheel. A file here is a command; a folder holds what commands are made of.

    demo                the main job, end to end
    quality             a bundle beside classical methods, by a fixed protocol
    plan_report         what `--quality adaptive` may skip, calibrated and proved
    evidence            products, plans and seconds of two checkouts compared
    methods             modern methods beside camkit's: dB against CPU-seconds
    tables              tables of the thesis, their networks trained for equal times
    reference           pages of docs/reference that are generated from the code
    design_start        a start lens by random search
    stage_profile       where the time of a photograph goes
    gpu_networks        networks rebuilt in torch, checked and timed where a GPU is lent
    gpu_training        a training packed for such a machine, and gone on with there
    measure, memory     time, tiling, RAW files; peak memory against its cap
    build_glass         the glass catalogues, from their sources
    weight              refuses bundles that change under one version, checkpoints, big pictures
    repack              bundles in the newest format
    coverage_gate       refuses a test run that covers too little

    capture/            simulated captures, for the tools that judge pictures
    pictures/           pictures of README, gallery, guides; `hdr/` those of nights, and `deglare`
    comparison/         parts of `quality`
    plan/               parts of `plan_report`
    start/              parts of `design_start`

A study that made one result once leaves the tree; docs/results/README.md names the commit that has
its command.
"""
