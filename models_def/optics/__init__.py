"""Optics: from a prescription, or a PSF that was measured, to the frozen PSF of a camera.

In the order in which data flows:

- `glass`: catalogues, refractive indices by strict name
- `grooves`: what a surface may be cut into
- `shape/`: odd, extended and Q aspheres, phases, tilted elements as stated
- `configuration/`: focus positions and zoom states
- `prescription`: lenses as dataclasses, TOML files, fabrication errors
- `lens_file`: lenses from and to files, TOML or .zmx
- `tracing/`, `trace`: rays through surfaces, differentiable, with a fate for each ray
- `reverse`: rays from the sensor to the scene
- `paraxial`: focal lengths, pupils, images
- `scaling`: a lens larger or smaller, faster or slower
- `pupil`: which rays: samples of the stop, aiming
- `focus`: where the sensor should lie
- `spot`: where they land: chief rays, spots, relative illumination
- `distortion`: the radial polynomial of eq. (6.10)
- `psf`: rays splatted into kernels
- `asymmetric/`: the same for a lens that is not round
- `kernel_bank`: kernels per colour of the nominal lens and of fabricated copies, for training
- `freezable_optics`: what freezing knows of any optics
- `lens_optics`, `measured`, `optics_file`: a lens and a measured PSF as such, either by its file
- `frozen`: a `FrozenPsf` on a grid of fields, depths and wavelengths
- `sampling_loss`: what coarse samples and blocks cost, in dB
- `freeze`: the least samples within a stated loss
- `freezer`: any optics frozen, each by the way that suits it
- `analysis/`: spots, MTF, curves, third order and wavefronts for people
- `diffraction/`: plates that diffract, before a lens
- `dots/`: plates of dots, before an array of small pixels
- `thin/`: a thin plate for a large field
- `tolerance/`: errors of fabrication, decentres and tilts among them
- `search/`: how a lens is found and improved: free numbers, merits, damped least squares
- `render/`: pictures of a textured plane, by rays or by a map of PSFs
"""
