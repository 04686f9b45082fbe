"""Batches on a cluster.

- `cluster`: what one costs beside `--jobs`, measured
- `archive`: what an archive costs by that, simulated
"""
