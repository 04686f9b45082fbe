"""A wide tiny bundle with its rig and one scene, made once."""

import pytest

from camkit.bundle.reader import Bundle
from camkit.report.stress.rig import Rig
from camkit.report.stress.scene import Scene, stress_scenes
from camkit.report.stress.score import Judge
from tests.wide_bundle import write_wide_bundle


@pytest.fixture(scope="session")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("stress"))


@pytest.fixture(scope="session")
def scene(bundle: Bundle) -> Scene:
    return stress_scenes(bundle, 1)[0]


@pytest.fixture(scope="session")
def judge(bundle: Bundle) -> Judge:
    return Judge(Rig(bundle, ("M",)))
