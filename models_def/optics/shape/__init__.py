"""Shapes of surfaces beyond the even asphere, as a prescription states them.

- `q_polynomial`: Forbes' Q polynomials as powers
- `polynomial`: odd, extended and Q aspheres, as the tracer has them
- `phase`: a phase that a surface adds
- `stance`: an element that is tilted or decentred
"""
