"""Writers, in the order in which a finished band passes through them.

Map:
    picture_writer: the format of a picture; bands from top to bottom, turned to stand upright.
    writer: opens the writer of a format.
    band_queue: a writer on a thread of its own.
    exr: OpenEXR, half, or float where half would overflow.
    tiff_writer, png: 16 bits with an ICC profile.
    jpeg: 8 bits with one.
    linear_dng, dng: LinearRaw in camera space; Bayer DNG for simulated captures.
    dng_preview: the small JPEG in every DNG.
    icc: ICC profiles from primaries, white and tone.
    origin: what travels beside the planes.
    exif, directory: the metadata of a photograph as EXIF; directories of TIFF files.
    preview_file, tone_mapping, pixels: the JPEG beside a picture, made in memory.
    claim: of several processes, one makes an output.
    part_file: files that appear complete or not at all.
    sidecar: what was done, and proof that it is whole.
"""
