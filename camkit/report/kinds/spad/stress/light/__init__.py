"""Light and pixels that are other than the bundle takes for granted; modules define `SCENARIO`.

photons, sbr                few photons, much background
dark_map, dark_unknown      dark counts that differ from pixel to pixel
hot_pixels, hot_counts      pixels that count far more, stated or not
wrong_photons               networks are told a wrong level of light
"""
