"""What is measured for people: the accuracy protocol, in the order of its work.

    fabricated_psf   lenses with fabrication errors, traced afresh and densely
    quality          where a picture is placed, how it is captured and scored
    journal          what a long run has finished, which may be resumed
    bench/           speed against accuracy
    stress/          where methods fail
    lens/            one lens on one page

Test pictures are only ever measured on.
"""
