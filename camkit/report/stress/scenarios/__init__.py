"""One file per scenario, found by its place in one of these folders; each defines `SCENARIO`.

lens          the lens or the light is another than the bundle thinks
sensor        light, noise and defects of the sensor
computation   sizes, tiles, half precision, invented detail
"""
