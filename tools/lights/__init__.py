"""Lights that clip.

- `clipped`: what explaining them gives
- `lamps`: how many lamps come out dark
"""
