"""Contents of capture files, and checks whether they can be believed.

tiff_tags     tags of TIFF-based files, read within bounds
exif_tags     what a photograph says of itself, from EXIF anywhere
exr_attributes  the same as attributes of an OpenEXR file
raw_metadata  the same of a RAW file, with LibRaw's help
raw_tags      noise and place of a RAW file from its tags
in_memory     bytes and open files, stored while they are read
capture_header  a capture without samples as JSON, as the decoding child sends it
decoder       the child that decodes RAW files, also started ahead
libraw        a RAW file as LibRaw decodes it
dng/          what a DNG asks for that LibRaw leaves out
plain_dng     a DNG of float or deflated samples as planes or mosaic with its levels
raw_decode    a decode, judged, as a capture
raw_checks    refuses unbelievable decodes
lone_pixels   hot or damaged pixels counted
doubts        what of a decode is not likely, as notes
order/        rows and tiles that broke off, from the samples
white_level   white where the data contradict the file
formats       EXR, TIFF, PNG, JPEG and Radiance HDR decoded, and their colour spaces
picture       pictures as captures or scenes
"""
