"""`camkit lens`: commands for one lens file; all of them read .toml and .zmx.

- `lens_app`: the commands joined
- `show`: a lens on one page
- `optimize`: a lens made better on spots
- `thin`: a thin plate, solved from a recipe
- `peak`: the light near the peak of a point
- `sag`: the profile of a surface, for the workshop
- `tolerance`: fabricated copies, their yield, what to tighten first
- `convert`: between .toml and .zmx
"""
