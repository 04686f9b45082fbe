"""Check that the stages of a manifest join, plane by plane from the sensor to the products.

    sensor -> capture -> stage -> planes -> stage -> ... -> product

The contents of a plane follow from the sensor and the stages alone. The manifest states them as
well, so that a reader sees them, and a manifest that states anything else is refused. A stage is
refused if it takes a plane that no earlier stage gives, gives a plane that nobody takes, or cannot
take what it is given; the message names both ends.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from camkit.bundle.optics import Optics
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import Sensor
from camkit.bundle.stages import Dehaze, JoinError, Parts, Stage, Wiener

CAPTURE: Final = "capture"
"""The plane that the sensor gives."""


def capture_plane(sensor: Sensor) -> Plane:
    """Return the plane that a sensor gives: digital numbers, or photons."""
    return sensor.plane


def join_stages(stages: Sequence[Stage], parts: Parts) -> dict[str, Plane]:
    """Compute every plane by following the planes through the stages.

    Args:
        stages: In order.
        parts: Sensor, optics and networks.

    Returns:
        Every plane by name, without that of the sensor.

    Raises:
        JoinError: If a stage cannot take what it is given; names both ends.
    """
    planes = {CAPTURE: capture_plane(parts.sensor)}
    made_by = {CAPTURE: f"the sensor ({parts.sensor.type})"}
    for number, stage in enumerate(stages, start=1):
        name = f"stage {number} ({stage.type})"
        for source in stage.takes:
            if source not in planes:
                have = ", ".join(f"{plane!r} of {made_by[plane]}" for plane in planes)
                raise JoinError(
                    f"{name} takes {source!r}, which nothing before it gives; there are {have}"
                )
        try:
            outputs = stage.join([planes[source] for source in stage.takes], parts)
        except JoinError as error:
            ends = "; ".join(
                f"{source!r} of {made_by[source]} is {planes[source].describe()}"
                for source in stage.takes
            )
            raise JoinError(f"{name} does not join: {error}. {ends}") from error
        if len(outputs) != len(stage.gives):
            raise JoinError(f"{name} makes {len(outputs)} plane(s), it names {len(stage.gives)}")
        for plane_name, plane in zip(stage.gives, outputs, strict=True):
            if plane_name in planes:
                raise JoinError(f"{name} gives {plane_name!r}, as does {made_by[plane_name]}")
            planes[plane_name] = plane
            made_by[plane_name] = name
    return {name: plane for name, plane in planes.items() if name != CAPTURE}


def check_use(
    stages: Sequence[Stage], products: Mapping[str, str], planes: Mapping[str, Plane]
) -> None:
    """Refuse products that no stage gives, and stages whose planes nobody takes.

    Raises:
        JoinError: Naming the product or the stage.
    """
    if not products:
        raise JoinError("a bundle has at least one product")
    for product, plane in products.items():
        if plane not in planes:
            raise JoinError(f"the product {product!r} is the plane {plane!r}, which no stage gives")
    used_planes = {name for stage in stages for name in stage.takes} | set(products.values())
    for number, stage in enumerate(stages, start=1):
        if not used_planes & set(stage.gives):
            raise JoinError(
                f"stage {number} ({stage.type}) gives {', '.join(stage.gives)}, which no stage "
                "takes and no product names"
            )


def check_haze(stages: Sequence[Stage], optics: Optics | None) -> None:
    """Refuse a bank behind which the haze of the optics would stay.

    Raises:
        JoinError: If optics have a haze and a stage wiener takes light that no stage haze cleared.
    """
    if optics is None or optics.type != "hazy_psf":
        return
    clear: set[str] = set()
    for number, stage in enumerate(stages, start=1):
        if isinstance(stage, Dehaze) or stage.takes[0] in clear:
            clear |= set(stage.gives)
        elif isinstance(stage, Wiener):
            raise JoinError(
                f"stage {number} (wiener) deconvolves with core kernels, and no stage haze before "
                "it takes away what lies beside them"
            )


def rewired(stages: Sequence[Stage], usual: Sequence[Stage]) -> tuple[Stage, ...]:
    """Connect some of the usual stages of a kind as if the others did not exist.

    Args:
        stages: Some of the usual stages, in their order, with parameters of their own.
        usual: All of them, wired by their defaults.

    Returns:
        The same stages; what a missing one would have given is replaced by what stands in for it.
    """
    present = {(stage.type, getattr(stage, "role", None)) for stage in stages}
    stand_in: dict[str, str] = {}
    for stage in usual:
        if (stage.type, getattr(stage, "role", None)) not in present:
            source = stage.takes[stage.stands_in]
            first = stand_in.get(source, source)
            stand_in |= dict.fromkeys(stage.gives[:1], first)
            # a mask that is not passed on is that which was taken, if one was
            for mask, source in zip(stage.gives[1:], stage.takes[1:], strict=False):
                stand_in[mask] = stand_in.get(source, source)
    planes = {CAPTURE} | {name for stage in stages for name in stage.gives}
    result = []
    for stage in stages:
        takes = dict.fromkeys(stand_in.get(name, name) for name in stage.takes)
        result.append(stage.model_copy(update={"takes": tuple(n for n in takes if n in planes)}))
    return tuple(result)
