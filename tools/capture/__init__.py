"""Simulated captures, for tools that judge pictures in colour.

- `simulated`: a simulation as a capture of its camera, and the truth beside it in Rec.709
"""
