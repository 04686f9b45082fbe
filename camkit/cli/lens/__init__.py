"""`camkit lens`: commands for one lens file; all of them read .toml and .zmx.

- `app`: the commands joined
- `show`: a lens on one page
- `optimize`: a lens made better on spots
- `convert`: between .toml and .zmx
"""
