"""The sensor of the laboratory."""

LAB_1 = {
    "width_px": 96,
    "height_px": 64,
    "pixel_pitch_um": 5.0,
    "cfa": "GBRG",
    "full_well_e": 9000.0,
    "read_noise_e": 2.0,
    "source": "measured in the laboratory",
}
