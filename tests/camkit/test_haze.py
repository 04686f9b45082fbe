"""A haze is a share of light beside the samples of a PSF, or it is refused."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.haze import Haze
from camkit.psf import FrozenPsf
from tests.bundle_factory import tiny_psf
from tests.haze_factory import tiny_haze, with_kernels


def _set(name: str, index: Any, value: float) -> Callable[[Haze], Haze]:
    def change(haze: Haze) -> Haze:
        array = getattr(haze, name).copy()
        array[index] = value
        return replace(haze, **{name: array})

    return change


REFUSED: dict[str, tuple[Callable[[Haze], Haze], str]] = {
    "NaN": (_set("kernels", (0, 0, 0, 1, 1), np.nan), "finite and >= 0"),
    "negative": (_set("kernels", (0, 0, 0, 1, 1), -1e-9), "finite and >= 0"),
    "more than all": (lambda h: with_kernels(h, 1.2), "more than all the light"),
    "no core": (_set("core_share", (1, 0, 2), 0.0), "a core holds"),
    "a core of no number": (_set("core_share", (1, 0, 2), np.nan), "a core holds"),
    "double precision": (lambda h: replace(h, kernels=h.kernels.astype("f8")), "float32"),
    "no square": (lambda h: replace(h, kernels=h.kernels[..., 1:].copy()), "must be float32"),
    "an even side": (lambda h: replace(h, kernels=h.kernels[..., 1:, 1:].copy()), "odd side"),
    "too wide": (
        lambda h: replace(h, kernels=np.zeros((2, 1, 3, 259, 259), np.float32)),
        "at most 257",
    ),
    "fields": (lambda h: replace(h, field_heights_mm=np.zeros(3)), "must be float32"),
    "odd cells": (lambda h: replace(h, cell_px=7), "even side"),
    "huge cells": (lambda h: replace(h, cell_px=128), "even side"),
    "pitch": (lambda h: replace(h, pixel_pitch_um=np.nan), "pixel_pitch_um"),
}


@pytest.mark.parametrize(("change", "said"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_haze_is_refused(change: Callable[[Haze], Haze], said: str) -> None:
    with pytest.raises(ContractError, match=said):
        change(tiny_haze())


def _moved(psf: FrozenPsf) -> FrozenPsf:
    return replace(
        psf,
        focus_um=np.array([-1.0, 1.0]),
        focus_kernels=np.stack([psf.kernels, psf.kernels]),
    )


FOREIGN: dict[str, tuple[Callable[[FrozenPsf], FrozenPsf], str]] = {
    "fields": (lambda p: replace(p, field_heights_mm=np.array([0, 0.3])), "field_heights_mm"),
    "depths": (lambda p: replace(p, depths_mm=np.array([500.0])), "depths_mm"),
    "wavelengths": (lambda p: replace(p, wavelengths_um=p.wavelengths_um + 0.01), "wavelengths_um"),
    "pixels": (lambda p: replace(p, pixel_pitch_um=5.0), "of pixels of 6.0 um"),
    "a moved sensor": (_moved, "focus_um"),
}


@pytest.mark.parametrize(("change", "said"), FOREIGN.values(), ids=FOREIGN.keys())
def test_a_psf_of_other_samples_is_refused(
    change: Callable[[FrozenPsf], FrozenPsf], said: str
) -> None:
    tiny_haze().check_beside(tiny_psf())
    with pytest.raises(ContractError, match=said):
        tiny_haze().check_beside(change(tiny_psf()))
