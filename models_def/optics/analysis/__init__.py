"""The numbers and curves of lens design.

In the order in which data flows (every result states its pupil, see `camkit...optics.pupil`):

- `sampling`: samplings of the pupil by name; which pupil an analysis uses
- `first_order`: paraxial marginal and chief ray, invariant, ideal image height, Airy radius
- `spots`: spot diagrams, their RMS and maximum, and how these converge with the sampling
- `image_circle`: how far from the axis a lens images, and what its rims leave of its stop
- `curves`: distortion, field curvature, axial and lateral colour
- `seidel`: third-order and chromatic sums by surface
- `wavefront`: optical path differences at the exit pupil
- `wave_psf`: the diffraction PSF summed from them
- `pupil_fit`: few rays over the pupil, as polynomials
- `wave_kernels`: the light of waves in the tents of pixels
- `lens_waves`: the wave PSF of a lens, as `psf` is that of its rays
- `point_image`: the diffraction image of a field: its light, Strehl ratio, encircled energy
- `fans`: transverse aberrations and OPD along two lines through the pupil
- `mtf`: contrast from rays or from a PSF, and its diffraction limit
- `focus_note`: a line if the sensor is far out of focus
- `state_facts`: the configurations of a lens beside each other
- `psf_model`: the one rule by which a lens takes rays or waves
- `model_psf`: the PSF of a lens by the model that it takes
"""
