"""Torch checkpoint to bundle, in the order of the work.

    golden_cases    small captures of known scenes
    folding         its nodes in the form that costs least
    onnx_graph      a network becomes ONNX, held against torch
    network_facts   what is measured about it
    proving         golden members, activations on golden cases, the check before a name
    remeasured      a bundle that is there, with parts that were measured
    energy, card    the card and the preview for people
    assemble        everything packed, proved, written

Nothing is written when a proof fails.
"""
