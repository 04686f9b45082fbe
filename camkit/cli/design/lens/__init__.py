"""`camkit lens`: commands for one lens file; all of them read .toml, .zmx and .json.

- `lens_app`: the commands joined
- `show`: a lens on one page
- `optimize`: a lens made better on spots
- `thin`: a thin plate, solved from a recipe
- `peak`: the light near the peak of a point
- `sag`: the profile of a surface, for the workshop
- `tolerance`: Monte-Carlo samples, their yield, what to tighten first
- `convert`: between .toml, .zmx and .json (optiland), and to a sag table
"""
