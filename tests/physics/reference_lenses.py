"""Published lenses that the optics tests are checked against."""

from camkit.models_def.optics.prescription import Lens, Surface


def cooke_triplet() -> Lens:
    """The 40 degree Cooke triplet that comes with OpticStudio (EPD 10 mm, stop at surface 3)."""
    radii = (22.01359, -435.76044, -22.21328, 20.29192, 79.68360, -18.39533)
    gaps = (3.25896, 6.00755, 0.99997, 4.75041, 2.95208, 42.20778)
    glasses = ("SK16-Hikari", "air", "F2-Schott", "air", "SK16-Hikari", "air")
    return Lens(
        name="Cooke triplet",
        surfaces=tuple(
            Surface(curvature_per_mm=1 / r, thickness_mm=t, glass=g)
            for r, t, g in zip(radii, gaps, glasses, strict=True)
        ),
        stop=3,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=10.0,
    )


def thorlabs_al2550() -> Lens:
    """Thorlabs AL2550-A, an aspheric singlet; its Zemax file states real ray heights."""
    return Lens(
        name="AL2550-A",
        surfaces=(
            Surface(
                curvature_per_mm=1 / 25.56,
                thickness_mm=6.0,
                glass="N-BK7-Schott",
                semi_diameter_mm=12.5,
                conic=-1.01,
                even_asphere=(0.0, 3.270395763922e-6, 7.72053347503e-10, 1.630472733467e-13),
            ),
            Surface(curvature_per_mm=0.0, thickness_mm=46.03123281323),
        ),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=23.0,
        reference_wavelength_um=0.78,
    )


def thorlabs_la1131() -> Lens:
    """Thorlabs LA1131-A, a plano-convex singlet."""
    return Lens(
        name="LA1131-A",
        surfaces=(
            Surface(curvature_per_mm=1 / 25.75, thickness_mm=5.34, glass="N-BK7-Schott"),
            Surface(curvature_per_mm=0.0, thickness_mm=44.20486329487),
        ),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=22.86,
        reference_wavelength_um=0.5875618,
    )


def thorlabs_aca254() -> Lens:
    """Thorlabs ACA254-050-A, an air-spaced doublet."""
    radii = (32.525, -32.525, -28.448, -78.019)
    gaps = (6.82, 1.247, 3.23, 42.731215)
    glasses = ("N-SSK2-Schott", "air", "N-SF57-Schott", "air")
    return Lens(
        name="ACA254-050-A",
        surfaces=tuple(
            Surface(curvature_per_mm=1 / r, thickness_mm=t, glass=g)
            for r, t, g in zip(radii, gaps, glasses, strict=True)
        ),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=12.5,
        reference_wavelength_um=0.55,
    )
