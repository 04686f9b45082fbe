"""A plate's relief found by gradients: where its light should go, told by masks on the sensor.

- `goal`: the masks, and the regulariser of the thesis against the bare lens
- `recipe`: such a design as TOML
- `maps`: the free numbers that a design begins at
- `loop`: the steps
- `run`: a loop with its files: checkpoint, log, the plate
"""
