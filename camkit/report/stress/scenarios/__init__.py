"""The scenarios that serve every camera; each module holds a table of rows, `SCENARIOS`.

computation_rows   sizes, tiles, half precision, invented detail
lens_rows          the lens or the light is another than the bundle thinks
scene_rows         scenes that are known to the last pixel
sensor_rows        light, noise and defects of the sensor
unseen_rows        scenes and light as no training shows them

A new scenario is a row in one of them, or a module of its own here.
"""
