"""Torch checkpoint to bundle, in the order of the work.

    frozen_norms    norms that look at a picture become constants, before
    golden_cases    small captures of known scenes
    folding         its nodes in the form that costs least
    onnx_graph      a network becomes ONNX, held against torch
    network_facts   what is measured about it
    activations     its activations on golden cases, of a bundle that is there
    remeasured      a bundle that is there, with parts that were measured
    energy, card    the card and the preview for people
    assemble        everything packed, proved, written

Nothing is written when a proof fails.
"""
