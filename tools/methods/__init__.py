"""The front of methods: `python -m tools.methods train|judge|chart`, in the order of the work.

- `kernel_networks`: networks that know the blur
- `sample_store`: samples made once, with the kernels of their places
- `method_list`: what is trained, and how it is fed
- `equal_minutes`: every method trained for the same CPU-minutes
- `plane_methods`: methods as functions of a developed capture
- `separate_peer`, `deepinv_worker`: deepinv in an environment of its own
- `judging`: decibels and CPU-seconds of all rows, the record
- `front_page`, `front_chart`: the record as a page and as a chart
"""
