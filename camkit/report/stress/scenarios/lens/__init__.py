"""The lens, or the light that it refracts, is another than the bundle thinks.

psf_scale, psf_rotation, decentre   a lens copy: heat, refocusing, assembly
defocus                             objects nearer and farther than the focus
depth, known_depth                  one scene at each depth of the bundle
haze                                light lost from the core of the PSF
energy_split                        light between the peak and the haze of the bundle
lost_dark_frame                     black that stands in the haze of the bundle
illuminant                          the spectrum of the light
wrong_bundle                        another lens altogether
"""
