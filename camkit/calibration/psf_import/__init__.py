"""Kernels that others measured or computed, from their files to a frozen PSF.

psf_source          FILE, FOLDER or PATTERN -> a stack of kernels
array_files         npy, npz, mat
array_axes          any order of axes -> row, column, colour, h, w
kernel_pictures     PNG, TIFF, EXR
zemax_listing       the text of a Huygens or FFT PSF
kernel_stack        the stack, and the caller's options
kernel_places       where the kernels lie over the field
clean_kernels       background, negative values, middle, pitch, sum -> a frozen PSF
kernel_resampling   another pitch
psf_facts           the result for people: places, span, colours, widths
own_colours         the response of a sensor whose own colours the kernels are
kernel_uncertainty  how far the kernels may be off: estimated, and copies within it
"""
