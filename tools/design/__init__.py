"""What the tools around a design share.

- `rest`: any lens file in the place of a free lens, set to work and traced once
- `edge`: slanted edges and their contrast
- `score`: a lens and its network judged on fresh pictures and edges
- `table`: lenses compared after recovery
- `stability_chart`: success of designs against how far off their starts were
"""
