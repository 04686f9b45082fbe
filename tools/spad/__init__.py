"""What the sharpening of single photons is measured with.

synthetic   photons drawn behind a known pulse, for every level of light
accuracy    errors against the bound, sigma, false alarms and CPU seconds of every method
real_data   captures of real cameras against what is known of them
"""
