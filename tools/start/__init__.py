"""A start lens from nothing.

- `recipe`: a search within ranges, as TOML
- `search`: the best of many random starts within the ranges of a recipe
- `success`: how often such a search and one from the library of lenses succeed
"""
