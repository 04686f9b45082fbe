"""Pictures of a textured plane through a lens, by rays or by a map of PSFs.

- `texture`: a picture on a plane in front of the camera, looked up with gradients
- `window`: the part of a sensor that is rendered
- `lens_view`: the lens as the renderers see it: tensors at any wavelength, stop, object distance
- `beam`: which directions pass the stop, and how much light they bring
- `strata`: stratified numbers for sub-pixel shifts, pupil points and wavelengths
- `monte_carlo`: (a) rays from pixels to the texture, averaged over passes
- `texture_alignment`: the texture warped to the render, pixel to pixel
- `psf_map`: (b) the aligned texture spread by PSFs over fields, colours and depths
- `illumination`: light of an even scene on the sensor, by rays traced back from it
- `pair_transfer`: the blur between two stops of a lens, block by block of a picture
"""
