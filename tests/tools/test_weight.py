"""Other bytes under one version, checkpoints and large pictures are refused."""

from pathlib import Path

import pytest

from tests.bundle_factory import write_tiny_bundle
from tools import weight


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Make a checkout with one bundle and its line."""
    folder = tmp_path / weight.BUNDLES
    folder.mkdir(parents=True)
    write_tiny_bundle(tmp_path).rename(folder / "tiny.camkit")
    weight.update_lines(tmp_path, ["tiny"])
    return tmp_path


def test_this_checkout_is_light() -> None:
    assert weight.main([]) == 0


def test_other_bytes_under_one_version_are_refused_and_get_no_line(root: Path) -> None:
    assert not list(weight.bundle_faults(root))
    before = weight.read_lines(root)["tiny"]
    path = root / weight.LIST
    path.write_text(path.read_text().replace(before["sha256"], "0" * 64))
    (fault,) = weight.bundle_faults(root)
    assert fault.startswith(f"tiny {before['version']} has other bytes than its line")
    with pytest.raises(SystemExit, match="give the bundle a new version"):
        weight.update_lines(root, ["tiny"])
    path.write_text(path.read_text().replace(before["version"], "0.0.1"))
    (fault,) = weight.bundle_faults(root)
    assert "--update tiny" in fault
    weight.update_lines(root, ["tiny"])
    assert weight.read_lines(root)["tiny"] == before


def test_bundles_and_lines_belong_together(root: Path) -> None:
    path = root / weight.LIST
    path.write_text(path.read_text().replace("tiny", "other"))
    assert len(list(weight.bundle_faults(root))) == 2
    with pytest.raises(SystemExit, match="there is no bundle other; there are tiny"):
        weight.update_lines(root, ["other"])


@pytest.mark.parametrize(
    ("name", "size", "is_refused"),
    [
        ("runs/M.pt", 10, True),
        ("tests/data/M.ckpt", 10, True),
        ("models_def/plates/a.safetensors", 100_000, False),
        ("models_def/plates/a.safetensors", 100_001, True),
        ("tests/data/a.safetensors", 100_001, False),
        ("docs/images/a.PNG", 300_001, True),
        ("docs/images/a.jpg", 300_000, False),
        ("tools/scenes/coffee.png", 400_000, False),
        ("docs/results/a.json", 400_000, False),
    ],
)
def test_checkpoints_and_large_pictures_are_refused(
    tmp_path: Path, name: str, size: int, *, is_refused: bool
) -> None:
    path = tmp_path / name
    path.parent.mkdir(parents=True)
    path.write_bytes(bytes(size))
    assert len(list(weight.file_faults(tmp_path, [name, "docs/gone.png"]))) == is_refused
