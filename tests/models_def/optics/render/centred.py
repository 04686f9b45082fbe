"""A window about the axis, which tests of the renderers look through."""

from camkit.models_def.optics.render.window import Window
from camkit.units import UM_PER_MM


def centred_window(height_px: int, width_px: int, pitch_um: float) -> Window:
    """Return a window whose middle lies on the axis."""
    pitch_mm = pitch_um / UM_PER_MM
    return Window(
        height_px=height_px,
        width_px=width_px,
        pitch_um=pitch_um,
        top_mm=-(height_px - 1) / 2 * pitch_mm,
        left_mm=-(width_px - 1) / 2 * pitch_mm,
    )
