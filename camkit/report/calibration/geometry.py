"""The sections of the page of a camera's geometry."""

from camkit.calibration.geometry.adjustment import rms
from camkit.calibration.geometry.geometry import Geometry
from camkit.report.calibration.geometry_charts import (
    draw_coverage,
    draw_distortion,
    draw_radii,
    draw_residuals,
    enlargement,
)
from camkit.report.calibration.page import Section, Table, sentences


def geometry_sections(found: Geometry) -> list[Section]:
    """Return the sections of the page, pictures drawn."""
    coverage, radial = found.coverage, found.radial
    beyond = (
        "The board reached the corners of the picture."
        if coverage.is_whole
        else f"Nothing was seen beyond {coverage.radius_px:.0f} px from the optical centre (the "
        f"circle), while the picture reaches to {coverage.corner_px:.0f} px. The distortion there "
        "is a guess: do not use it."
    )
    factor = enlargement(found.chosen.held_out, found.size)
    return [
        Section(title="Result", paragraph=sentences(*found.notes), table=_result(found)),
        Section(
            title="Residuals",
            paragraph=f"Every picture left out once: the camera is that of the others, the pose "
            f"its own. Arrows are {factor} times enlarged; the circle marks what was covered, the "
            "cross the optical centre.",
            pictures={"Residuals over the picture": draw_residuals(found)},
        ),
        Section(title="Residuals over the radius", pictures={"Held-out error": draw_radii(found)}),
        Section(
            title="What was seen",
            paragraph=beyond,
            pictures={"Covered area": draw_coverage(found)},
        ),
        Section(
            title="Distortion",
            paragraph=f"The polynomial of undistort misses the model by up to "
            f"{radial.residual_px:.3f} px within what was seen. Red: not seen.",
            pictures={"Distortion along the radius": draw_distortion(found)},
        ),
        Section(
            title="Models",
            paragraph="The simplest is taken whose held-out error is not meaningfully worse than "
            "the least, and whose distortion does not fold inside the picture.",
            table=_models(found),
        ),
        Section(title="Pictures", table=_pictures(found)),
    ]


def _result(found: Geometry) -> Table:
    camera, chosen, radial = found.camera, found.chosen, found.radial
    rows = [
        ("pictures with the board", f"{len(found.corners)} of {len(found.views)}"),
        ("board, inner corners", str(found.board)),
        ("picture, px", f"{found.size[0]} x {found.size[1]}"),
        ("model", camera.model.name),
        ("focal length, px", f"{camera.focal_px:.3f}"),
        ("optical centre x, y, px", "{:.3f}, {:.3f}".format(*camera.centre_px)),
        ("coefficients", ", ".join(f"{k:.6g}" for k in camera.coefficients)),
        ("error, px rms", f"{chosen.fit.rms_px:.4f}"),
        ("held-out error, px rms", f"{chosen.rms_px:.4f}"),
        ("worst picture, px rms", f"{chosen.worst_px:.4f}"),
        ("covered radius, px", f"{found.coverage.radius_px:.1f}"),
        ("radial coefficients (eq. 6.10)", ", ".join(f"{k:.6g}" for k in radial.coefficients)),
        ("in units of, px", f"{radial.radius_px:.3f}"),
    ]
    return Table(rows=tuple(rows))


def _models(found: Geometry) -> Table:
    rows = tuple(
        (
            one.fit.camera.model.name + (" (taken)" if one is found.chosen else ""),
            str(len(one.fit.camera.model.free)),
            f"{one.fit.rms_px:.4f}",
            f"{one.rms_px:.4f}",
            f"{one.worst_px:.4f}",
        )
        for one in found.tried
    )
    return Table(header=("model", "coefficients", "rms, px", "held out", "worst"), rows=rows)


def _pictures(found: Geometry) -> Table:
    rows: list[tuple[str, ...]] = []
    seen = 0
    for view in found.views:
        if view.corners is None:
            rows.append((view.path.name, "no board", ""))
            continue
        errors = (found.chosen.fit.residuals[seen], found.chosen.held_out[seen])
        rows.append((view.path.name, *(f"{rms(error):.4f}" for error in errors)))
        seen += 1
    return Table(header=("picture", "rms, px", "held out"), rows=tuple(rows))
