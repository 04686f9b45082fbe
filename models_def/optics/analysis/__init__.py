"""The numbers and curves of lens design.

In the order in which data flows (every result states its pupil, see `camkit...optics.pupil`):

- `sampling`: samplings of the pupil by name; which pupil an analysis uses
- `first_order`: paraxial marginal and chief ray, invariant, ideal image height, Airy radius
- `spots`: spot diagrams, their RMS and maximum, and how these converge with the sampling
- `image_circle`: how far from the axis a lens images, and what its rims leave of its stop
- `curves`: distortion, field curvature, axial and lateral colour
- `illumination`: light of an even scene on the sensor, by rays traced back from it
- `seidel`: third-order and chromatic sums by surface
- `wavefront`: optical path differences at the exit pupil
- `wave_psf`: the diffraction PSF summed from them
- `mtf`: contrast from rays or from a PSF, and its diffraction limit
- `pair_transfer`: the blur between two stops of a lens, block by block of a picture
- `psf_model`: whether a lens needs waves, and why
"""
