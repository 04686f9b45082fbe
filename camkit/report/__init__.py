"""Measurements for people: the accuracy protocol, in the order of its work.

    fabricated_optics   lenses with fabrication errors, traced afresh and densely
    quality             where a picture is placed, how it is captured and scored
    sensor_geometry     pictures that lie where their captures lie
    hdr_score           how well a picture of high dynamic range was recovered
    limb, satellites    what of a light's rim and of what stands around it came back
    pu21, jod           what the eye sees of it, on a stated display
    edge_profile        the profile across an edge, finer than the pixels, and its spectrum
    edge_mtf            MTF by slanted edge, of a capture or a picture of any camera
    discovery           modules of a folder that register themselves
    kind, kind_finder   what reports ask of a kind of camera, and where they find it
    kinds/              the kinds that are more than photographs
    journal             what a long run has finished, which may be resumed
    bench/              speed against accuracy
    stress/             where methods fail
    analysis/           what a camera can tell of a scene, and what it only seems to tell
    figure              charts: their style, and how they become SVG and PNG
    pages/              the one writer of pages; those of lenses, plates and calibrations
    view/               results of `camkit process` to look at

Test pictures are only ever measured on.
"""
