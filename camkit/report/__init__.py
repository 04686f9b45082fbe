"""What is measured for people: the accuracy protocol, in the order of its work.

    fabricated_psf   lenses with fabrication errors, traced afresh and densely
    quality          where a picture is placed, how it is captured and scored
    peers            the classical methods that camkit is compared with
    tuning           their parameters, chosen on validation pictures
    measurement      the journal of single measurements, which may be resumed
    comparison       the rows of the comparison
    quality_table    means, gains and the page
    compact_json     results as they are kept
    bench/           speed against accuracy
    stress/          where methods fail
    lens/            one lens on one page
    plan_cells       what each lattice cell loses with less than the exact result
    plan_fit         the loss model fitted to them
    plan_scenes      scenes of the proof: night, bokeh, texture, sky, text
    plan_proof       what `--quality adaptive` saves and loses on them

Test pictures are only ever measured on.
"""
