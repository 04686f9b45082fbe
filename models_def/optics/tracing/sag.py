"""Height and slope of the surface of a prescription, differentiable, without rays."""

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.profile import TINY, profile
from camkit.models_def.optics.tracing.series import Series, series_part


def sag(
    curvature: Tensor,
    conic: Tensor,
    even_asphere: Tensor,
    rho: Tensor,
    odd_asphere: Tensor | None = None,
    series: Series | None = None,
) -> Tensor:
    """Return the height h(rho) of a surface, rho = r^2 in mm^2 (eq. 2.2, plus an r^2 term).

    Where (1 + conic) c^2 rho > 1 there is no surface: the value is finite but meaningless.
    """
    return _profile(curvature, conic, even_asphere, rho, odd_asphere, series)[0]


def sag_slope(
    curvature: Tensor,
    conic: Tensor,
    even_asphere: Tensor,
    rho: Tensor,
    odd_asphere: Tensor | None = None,
    series: Series | None = None,
) -> Tensor:
    """Return dh/d rho (eq. 2.3, in the form c / (2 s), s the root, plus the polynomial)."""
    return _profile(curvature, conic, even_asphere, rho, odd_asphere, series)[1] / 2


def _profile(
    curvature: Tensor,
    conic: Tensor,
    even_asphere: Tensor,
    rho: Tensor,
    odd_asphere: Tensor | None,
    series: Series | None,
) -> tuple[Tensor, Tensor]:
    opening = (1 + conic) * curvature**2
    square = 1 - opening * rho
    root = torch.sqrt(torch.where(square > TINY, square, 1.0))
    terms = even_asphere.unbind(0)
    if series is not None:
        odd = () if odd_asphere is None else odd_asphere.unbind(0)
        height, slope = profile(curvature, root, (), (), rho)
        part = series_part(series, terms, odd, (opening, 1 / root), rho)
        return height + part.height, slope + part.lean
    slopes = [a * (2 * j) for j, a in enumerate(terms, start=1)]
    return profile(curvature, root, terms, slopes, rho)
