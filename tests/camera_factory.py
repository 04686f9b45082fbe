"""A small Bayer camera with an analytic PSF, for the tests of simulation and geometry."""

import numpy as np

from camkit.bundle.sensor import BayerSensor, ChannelResponse, IsoNoise, LightSensor, nested_sensor
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.sensor_window import SensorWindow

PITCH_UM = 5.96
COLOR_MATRIX = ((0.6, -0.1, -0.05), (-0.4, 1.2, 0.2), (-0.1, 0.2, 0.7))


def make_sensor(width: int = 96, height: int = 64, **changes: object) -> BayerSensor:
    """Give a Bayer sensor; changes are keys of a flat table, as recipes hold it."""
    fields: dict[str, object] = {
        "width_px": width,
        "height_px": height,
        "pixel_pitch_um": PITCH_UM,
        "cfa": "RGGB",
        "black_level": 256.0,
        "white_level": 4095.0,
        "full_well_e": 45000.0,
        "noise": tuple(
            IsoNoise(iso=100 * 2**i, gain_e_per_dn=11.72 / 2**i, read_noise_e=3.0) for i in range(7)
        ),
        "channel_response": ChannelResponse(
            wavelengths_um=(0.45, 0.55, 0.62),
            response=((0.0, 0.1, 1.0), (0.1, 1.0, 0.1), (1.0, 0.1, 0.0)),
            source="made up for the tests",
        ),
        "color_matrix": COLOR_MATRIX,
    }
    return BayerSensor.model_validate(nested_sensor(fields | changes))


def half_diagonal_mm(sensor: LightSensor) -> float:
    return float(np.hypot(sensor.width_px, sensor.height_px)) / 2 * sensor.pixel_pitch_um / 1000


def make_psf(
    sensor: LightSensor,
    *,
    side: int = 9,
    fields: int = 5,
    distortion: tuple[float, float, float, float] = (1.0, -0.05, -0.008, 0.001),
    corner_light: float = 0.6,
    spread_px: float = 1.0,
) -> FrozenPsf:
    """Gaussians that grow with the field, longer along the radius, shifted with wavelength."""
    radius_mm = half_diagonal_mm(sensor)
    heights = np.linspace(0, radius_mm, fields)
    offset = np.arange(side) - side // 2
    y, x = np.meshgrid(offset, offset, indexing="ij")
    kernels = np.zeros((fields, 1, 3, side, side), dtype=np.float32)
    for field in range(fields):
        share = field / (fields - 1)
        for color in range(3):
            sigma = spread_px * (0.4 + 0.6 * share)
            shift = (color - 1) * 0.6 * share
            values = np.exp(-0.5 * ((x / sigma) ** 2 + ((y - shift) / (1.4 * sigma)) ** 2))
            kernels[field, 0, color] = values / values.sum()
    return FrozenPsf(
        kernels=kernels,
        field_heights_mm=heights,
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array([0.45, 0.55, 0.62]),
        pixel_pitch_um=sensor.pixel_pitch_um,
        distortion=RadialDistortion(
            coefficients=np.tile(np.array(distortion), (3, 1)), radius_mm=radius_mm
        ),
        relative_illumination=1 - (1 - corner_light) * (heights / radius_mm) ** 2,
    )


def delta_psf(sensor: LightSensor, **changes: object) -> FrozenPsf:
    """A perfect lens: one pixel, no distortion, no vignetting."""
    psf = make_psf(sensor, side=3, distortion=(1.0, 0.0, 0.0, 0.0), corner_light=1.0)
    kernels = np.zeros_like(psf.kernels)
    kernels[..., 1, 1] = 1
    fields = {name: getattr(psf, name) for name in FrozenPsf.__dataclass_fields__}
    return FrozenPsf(**(fields | {"kernels": kernels} | changes))  # type: ignore[arg-type]


def whole_window(sensor: LightSensor) -> SensorWindow:
    size = (sensor.width_px, sensor.height_px)
    return SensorWindow(
        size_px=size, origin_px=(0, 0), sensor_size_px=size, pitch_um=sensor.pixel_pitch_um
    )
