"""Where sharpening of histograms breaks, one condition after the other.

judged   what became of drawn pixels, and when that counts as broken
light    few photons, much background
pile_up  a detector that is blind after a photon, with and without correction
pixels   dark counts that differ from pixel to pixel, hot pixels
stated   a gate that is not what the timing file says; a second surface close by
"""
