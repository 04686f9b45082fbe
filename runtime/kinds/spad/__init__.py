"""What counts of single photons tell: pulses, banks of them, fits and their bounds.

pulse        the time of one photon, in closed form
time_axis    bins of a histogram or delays of a gate: what each sees of a pulse
pile_up      counts as a detector that is never blind would have given them
bank         templates at many times of flight, scored against counts
bound        the Cramer-Rao bound of a time of flight
fit          time, amplitude, background and sigma of every pixel
two_returns  two surfaces in one pixel, fitted together
pooling      photons shared with neighbours where a pixel alone has too few
hot_pixels   pixels that count without light: found and painted over
evidence     from when on a return is believed
"""
