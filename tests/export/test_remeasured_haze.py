"""A measured PSF is not put beside a haze that was frozen with another."""

from pathlib import Path

import pytest

from camkit.errors import DecodeError
from camkit.export.remeasured import Measured, remeasured
from tests.bundle_factory import tiny_psf
from tests.haze_bundle import write_hazy_bundle


def test_kernels_of_another_lens_are_refused_beside_a_haze(tmp_path: Path) -> None:
    bundle, out = write_hazy_bundle(tmp_path), tmp_path / "new.camkit"
    with pytest.raises(DecodeError, match="have a haze; only --noise can be put into it"):
        remeasured(bundle, Measured(psf=tiny_psf()), out)
    assert not out.exists()
