"""A bracket of exposures to one linear picture with their whole range.

times       the exposure times, as people or files state them
brackets    which files are one
survey      every frame looked at once: size, levels, times, noise, a sample of codes
response    what light a code stands for: linear, sRGB
response_estimate    the same from the bracket itself
known_curves    curves of few numbers that may explain it as well
exposures   exposures that differ from the stated times
average     the weighted mean over frames, each sample as long as it did not clip
merge       frames one after the other into that mean
agreement   what all frames state alike
result      the mean as an EXR, developed where it is RAW
"""
