"""Use time: a capture and a bundle make a picture. Never torch.

    capture, raw, raw_worker, files/   a file becomes linear samples with metadata
    array_capture, metadata            so does an array; what a photograph says of itself
    binning                            squares of a mosaic that are averaged: weights, noise, detail
    signal/                            repair, white balance, demosaic; the stabilising transform
    bank/                              frozen PSF, blocks, Wiener filter, classical methods
    network/                           graphs read, run and tiled exactly
    geometry/                          place on the sensor, illumination, distortion
    color, output/                     camera colour to files and sidecars

    rows, clock, cancel                how stages pull rows, what each costs, the wish to stop
    machine/                           limits, memory, threads
    content, plan/                     what a capture holds; no more work than it needs
    envelope                           is a capture inside the bundle's measured ranges?
    options, unit                      what a caller chooses, and states of one camera body
    job/, stages/, stage_finder        one capture: what is decided, then the stages joined
    pipeline, development, batch       one capture in memory, its files, many captures
    capture_result, write_options      what became of a capture; how its files are written
    merging/                           brackets to one picture
    proof/                             a bundle proves itself
    twin/                              the digital twin: a scene becomes a RAW file
    portable/                          a camera as graphs for programs without camkit
    face/                              parts of the public face
    kind, kinds/, kind_parts/          what a kind of camera brings: readers, stages, products

Design time may call the runtime; the runtime never imports what lies above it.
"""
