"""One file per scenario, found by its place in one of these folders; each defines `SCENARIO`.

lens          the lens or the light is another than the bundle thinks
scene         scenes that are known to the last pixel
sensor        light, noise and defects of the sensor
unseen        scenes and light as no training shows them
computation   sizes, tiles, half precision, invented detail
"""
