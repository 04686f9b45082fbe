"""The bundle: one file that is one camera, read in place and trusted in nothing.

    stages, camera, facts -> manifest    what manifest.json may say, and its schema
    psf_file, golden                     the safetensors members
    container                            the zip: names, sizes, refusals
    reader                               container + manifest + hashes -> Bundle
    writer                               members -> one file, the same bytes for the same content

Refusals are `BundleError`. Graphs are refused in `camkit.runtime.network.graph`, which owns onnx.
"""
