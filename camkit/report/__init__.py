"""What is measured for people: the accuracy protocol, in the order of its work.

    fabricated_optics  lenses with fabrication errors, traced afresh and densely
    quality          where a picture is placed, how it is captured and scored
    hdr_score        how well a picture of high dynamic range was recovered
    pu21, jod        what the eye sees of it, on a stated display
    edge_profile     the profile across an edge, finer than the pixels, and its spectrum
    edge_mtf         MTF by slanted edge, of a capture or a picture of any camera
    discovery        modules of a folder that register themselves
    kind, kind_finder   what reports ask of a kind of camera, and where they find it
    kinds/           the kinds that come with camkit
    journal          what a long run has finished, which may be resumed
    bench/           speed against accuracy
    stress/          where methods fail
    lens/            one lens on one page
    plate/           one plate on one page
    calibration/     what a calibration found, on one page
    figure           a chart as SVG and PNG, the same from run to run
    style            how the pages of lenses, plates and calibrations look

Test pictures are only ever measured on.
"""
