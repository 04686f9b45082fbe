"""Pages for people: one HTML file each, no other needed.

page          the one writer: a title, what is said first, sections of words, tables and figures
lens/         one lens
plate/        one plate
calibration/  what a calibration found

Pages of bench, stress and analysis lie beside what they show, and are written by `page` too.
"""
