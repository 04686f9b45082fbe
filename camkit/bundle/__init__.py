"""The bundle: one file that is one camera, read in place and trusted in nothing.

    entry, sensor, optics, plane   the parts of which a manifest is made
    stages, facts                  what is done to a capture, and what was measured of the networks
    chain                          whether the stages join
    manifest                       what manifest.json may say, and its schema
    upgrade                        manifests of format 1.0
    frozen_optics                  kernels or streaks, as files hold them
    light_bound                    the bound on the light that a network may move
    psf_file, streak_file          the safetensors members: optics,
    haze_file                      the haze of these,
    states                         several states of a lens in one file,
    golden, haze_golden            cases that prove a bundle
    strict_json                    JSON that every reader understands alike
    local_headers, container       the zip: names, sizes, refusals
    reader                         container + manifest + hashes -> Bundle
    writer                         members -> one file, the same bytes for the same content

Refusals are `BundleError`. Graphs are refused in `camkit.runtime.network.graph`, which owns onnx.
"""
