"""What a calibration found, on one page.

page        sections of words, tables and pictures as one HTML file
noise_page  photon transfer of every ISO
flat_page   relative illumination, the display, what both leave
tone_page   luminance over level
"""
