"""The exposure at which a share of a scene saturates the sensor of a camera."""

from camkit.arrays import FloatArray
from camkit.bundle.sensor import ColorSensor
from camkit.runtime.twin.light import camera_space
from camkit.scenes.saturation import CEILING, Saturation, saturating_exposure, saturation_at


def exposure_for_share(
    scene: FloatArray, sensor: ColorSensor, share: float, *, ceiling: float = CEILING
) -> Saturation:
    """Return the least exposure at which a share of a scene exceeds what a sensor holds.

    Args:
        scene: (3, h, w) float32 linear Rec.709, 1.0 = white.
        sensor: Its colours and their white balance decide what clips.
        share: Of the pixels, in any colour.
        ceiling: The most light of the exposed scene, in times white.

    Raises:
        ContractError: As `saturating_exposure`: a flat or black scene saturates as a whole.
    """
    return saturating_exposure(scene, *camera_space(sensor), share, ceiling=ceiling)


def saturation_of(
    scene: FloatArray, sensor: ColorSensor, exposure: float, *, ceiling: float | None = None
) -> Saturation:
    """Return the shares of a scene that an exposure saturates.

    Args:
        scene: (3, h, w) float32 linear Rec.709, 1.0 = white.
        sensor: Its colours and their white balance decide what clips.
        exposure: Factor on the scene.
        ceiling: The most light of the exposed scene, in times white; None for no limit.
    """
    return saturation_at(exposure, scene, *camera_space(sensor), ceiling=ceiling)
