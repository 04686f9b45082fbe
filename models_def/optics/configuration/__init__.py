"""Configurations of a lens: focus positions and zoom states that share its surfaces.

In the order in which data flows:

- `exact_text`: numbers as text that comes back to the last bit
- `configuration`: what one state changes of a lens
- `configuration_table`: its TOML table
"""
