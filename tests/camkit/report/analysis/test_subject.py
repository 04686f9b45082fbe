"""What is analysed is found by its name."""

from pathlib import Path

import pytest

from camkit.bundle.haze_file import haze_to_bytes
from camkit.bundle.psf_file import write_psf
from camkit.errors import ContractError
from camkit.report.analysis.subject import find_subject
from tests.bundle_factory import tiny_sensor
from tests.haze_bundle import hazy_optics


def test_frozen_optics_are_found_in_a_folder_with_a_plus(tmp_path: Path) -> None:
    folder = tmp_path / "c++"
    folder.mkdir()
    optics = hazy_optics()
    assert optics.haze is not None
    psf, haze = folder / "a+b.safetensors", folder / "haze.safetensors"
    write_psf(psf, optics.psf)
    haze.write_bytes(haze_to_bytes(optics.haze))
    both = find_subject(f"{psf}+{haze}", tiny_sensor())
    assert (both.kind, both.camera(tmp_path).manifest.has_haze) == ("frozen", True)
    bare = find_subject(str(psf), tiny_sensor())
    assert (bare.kind, bare.camera(tmp_path).manifest.has_haze) == ("frozen", False)
    with pytest.raises(ContractError, match=r"PSF\.safetensors"):
        find_subject(f"{psf}+{haze}+{haze}", tiny_sensor())
