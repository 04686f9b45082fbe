"""Lenses: from a prescription to the frozen PSF of a camera.

In the order in which data flows:

- `glass`: refractive indices by strict name
- `prescription`: lenses as dataclasses, TOML files, fabrication errors
- `paraxial`: focal lengths, pupils, focus
- `trace`: rays through surfaces, differentiable, with a fate for each ray
- `pupil`: which rays: samples of the stop, aiming
- `spot`: where they land: chief rays, spots, relative illumination
- `distortion`: the radial polynomial of eq. (6.10)
- `psf`: rays splatted into kernels
- `kernel_bank`: kernels per colour of the nominal lens and of fabricated copies, for training
- `frozen`: a `FrozenPsf` on a grid of fields, depths and wavelengths
- `sampling`: what coarse samples and blocks cost, in dB
- `freeze`: the least samples within a stated loss; the file and its report
- `recipe`, `optimize`: how a lens is found: damped least squares on spots
"""
