"""`camkit psf`: PSFs that others measured or computed.

- `psf_app`: the commands joined
- `psf_import`: kernels in arrays, pictures or listings to a PSF
"""
