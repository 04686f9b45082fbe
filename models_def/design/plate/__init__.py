"""A plate's relief found by gradients: where its light should go, told by masks on the sensor.

- `goal`: the masks, and the regulariser of the thesis against the bare lens
- `reader_recipe`, `plate_recipe`: such a design as TOML
- `maps`: the free numbers that a design begins at
- `recording`: what a sensor makes of light, with gradients
- `nights`: patches of scenes at night
- `reader`: a network that is fitted along, and what it asks of the plate
- `plate_loop`: the steps
- `plate_run`: a loop with its files: checkpoint, log, the plate
"""
