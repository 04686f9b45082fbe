"""Parts of `plan_report`: what `--quality adaptive` may skip, in the order of the work.

- `cells`: what each lattice cell loses with less than the exact result
- `fit`: the loss model fitted to them
- `scenes`: scenes of the proof: night, bokeh, texture, sky, text
- `proof`: what is saved and lost on them
"""
