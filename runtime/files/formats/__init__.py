"""The formats of pictures, each decoded to samples as stored and what they mean.

jpeg_segments, png_chunks   the parts of a file, walked without decoding
color_space, icc_profile    what codes mean: curves and primaries, or tables through LittleCMS
stated_space                the colour space that a file states in any of the ways of its format
foreign                     formats that are not read, each by its name
decoded                     what every decoder gives
opencv_picture              PNG, JPEG, Radiance HDR and others through OpenCV
radiance                    the header of a Radiance HDR, checked before
tiff_page                   the page of a TIFF that is the picture
tiff_picture                its samples: tifffile, or OpenCV where tifffile lacks a codec
packed_bits                 samples of 1 to 15 bits, unpacked
tiff_meaning                palette, MinIsWhite, CIELab: samples to grey or RGB
mapped_tiff                 large plain TIFFs, read in place
exr_picture                 OpenEXR
"""
