"""Results of a calibration, on one page.

geometry_page    residuals, covered area, distortion of a camera
psf_page         kernels, light by radius, the target blurred anew
psf_field_page   imported kernels: where they lie, which way they point
noise_page       photon transfer of every ISO
flat_page        relative illumination, the display, what both leave
tone_page        luminance over level
pairs_page       how well shown pictures lie on their captures
targets_page     what is shown to the camera, in its order
bundle_page      what was measured of a camera beside what its bundle said
lensfun_page     where a lens of lensfun's puts light, what a model misses of it
"""
