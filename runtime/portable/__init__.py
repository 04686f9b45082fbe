"""A camera as graphs that other programs run: builder, spectra, place, block, tile, warp, package."""
