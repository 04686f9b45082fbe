"""What the sharpening of single photons is measured with.

synthetic   photons drawn behind a known pulse, for every level of light
limits      where sharpening breaks, one condition after the other
accuracy    errors against the bound, sigma, false alarms and CPU seconds of every method
plate_check a plate simulated again: aperture, pixels, focus, etching
edge_mtf    MTF of the array and of the pictures made of it, figure 4.9
real_data   captures of real cameras against what is known of them
"""
