"""A small array without training, and its examiner."""

import pytest

from camkit.bundle.reader import Bundle
from camkit.report.kinds.spad.stress.judge import SpadJudge, spad_judge_of
from camkit.report.kinds.spad.stress.spad_scene import SpadScene, spad_scenes
from tests.spad_bundle import write_spad_bundle


@pytest.fixture(scope="session")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_spad_bundle(tmp_path_factory.mktemp("stressed"))


@pytest.fixture(scope="session")
def judge(bundle: Bundle) -> SpadJudge:
    return spad_judge_of(bundle, ("S",), None)


@pytest.fixture(scope="session")
def scene(bundle: Bundle) -> SpadScene:
    return spad_scenes(bundle, 1)[0]
