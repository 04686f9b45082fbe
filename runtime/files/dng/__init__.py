"""DNG files: what their tags state that LibRaw does not apply, or reads wrongly.

picture_tags   the directory of the sensor picture, its size, area and pattern
dng_checks     a DNG against itself and against LibRaw
dng_levels     black of every row, column and plane, and white
masked_areas   black measured where the sensor sees no light
opcodes        opcode lists: which are there, which are applied
field_gain     GainMap and FixVignetteRadial as a gain of each pixel
corrections    black and gain applied to samples
applied_tags   all of it for decoded samples, and notes
white_point    gains of AsShotNeutral and AsShotWhiteXY
predictors     bytes of a decompressed strip or tile as numbers
jpeg_frames    the size that a JPEG in a strip or tile states of itself
readable       kinds that LibRaw reads, that are read without it, and names of all others
plain_samples  samples that are read without LibRaw
"""
