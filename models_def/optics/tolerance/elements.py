"""Elements of a lens: the surfaces that are one piece of glass; cemented ones move as one."""

from camkit.models_def.optics.prescription import Lens


def glass_elements(lens: Lens) -> tuple[range, ...]:
    """Return the surfaces of each piece; a stop or a dummy in air belongs to none."""
    elements: list[range] = []
    start: int | None = None
    for i, surface in enumerate(lens.surfaces):
        if start is None and surface.glass != "air":
            start = i
        elif start is not None and surface.glass == "air":
            elements.append(range(start, i + 1))
            start = None
    if start is not None:
        # the sensor lies in the glass
        elements.append(range(start, len(lens.surfaces)))
    return tuple(elements)
