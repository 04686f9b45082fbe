"""A sensor of red and blue, for optics whose colours differ."""

from camkit.bundle.sensor import ChannelResponse, Extent, IsoNoise, PlanesSensor


def red_and_blue_sensor() -> PlanesSensor:
    """Give a small one with pixels of 6 um."""
    return PlanesSensor(
        extent=Extent(width_px=400, height_px=300, pixel_pitch_um=6.0),
        channels=("R", "B"),
        black_level=64,
        white_level=4095,
        full_well_e=9000,
        noise=(IsoNoise(iso=100, gain_e_per_dn=2.2, read_noise_e=2.0),),
        channel_response=ChannelResponse(
            wavelengths_um=(0.45, 0.5, 0.55, 0.6, 0.65),
            response=((0.0, 0.0, 0.3, 1.0, 0.5), (1.0, 0.5, 0.1, 0.0, 0.0)),
            source="made up",
        ),
    )
