"""What counts of single photons tell: pulses, banks of them, fits and their bounds.

pulse      the time of one photon, in closed form
time_axis  bins of a histogram or delays of a gate: what each sees of a pulse
bank       templates at many times of flight, scored against counts
bound      the Cramer-Rao bound of a time of flight
fit        time, amplitude, background and sigma of every pixel
evidence   from when on a return is believed
"""
