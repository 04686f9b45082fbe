"""A kind of camera whose captures are no photographs: lists of counts that become sums.

It stands for cameras of somebody else that bring stages and products; no file of camkit knows it.
"""

from typing import Final

from camkit.kinds import Kind, KindOption

KIND: Final = Kind(
    name="counting",
    title="counts of a scaler, for tests",
    sensor="planes",
    stages=(),
    metrics=(),
    home="tests.counting_camera",
    file_types=(".counts",),
    shared_types=(".tif",),
    options=(
        KindOption(name="weights", text="A file with one factor.", is_file=True),
        KindOption(name="sign", text="Which counts.", choices=("plus", "minus")),
    ),
)
