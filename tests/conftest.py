"""Long files begin first, commands are built once, coverage watches what its gate counts."""

import os
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
import typer.main

COUNTED = (
    *("tests/runtime/", "tests/tools/", "tests/camkit/bundle/", "tests/camkit/cli/"),
    *("tests/camkit/scenes/", "tests/camkit/test_"),
)
"""The tests that the coverage gate counts, of runtime, core and tools."""
LONG = (
    *("tests/examples/test_readme", "tests/examples/test_node", "tests/examples/test_cpp"),
    *("tests/camkit/calibration/geometry/", "tests/camkit/cli/use/test_cluster"),
    *("tests/camkit/cli/test_chain", "tests/camkit/cli/design/test_toy_camera"),
    *("tests/camkit/report/making/test_camera_making", "tests/camkit/cli/judge/test_bench"),
    *("tests/runtime/kinds/spad/test_damaged_batch", "tests/runtime/network/test_activation"),
    *("tests/tools/methods/", "tests/tools/evidence/", "tests/tools/test_gpu_training"),
    *("tests/tools/test_memory", "tests/tools/test_portable_table"),
)
"""Files of few tests that take more than ten seconds."""
OF_CHILDREN = "COVERAGE_PROCESS_CONFIG"


@pytest.fixture(scope="session", autouse=True)
def _commands_built_once() -> Iterator[None]:
    """Build it once: it takes as long as a small command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", cache(typer.main.get_command))
        yield


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave short files for the end, where a long one would keep one core busy alone."""
    tests = Counter(item.path for item in items)
    items.sort(key=lambda item: (not item.nodeid.startswith(LONG), -tests[item.path]))


@cache
def _watch() -> tuple[Any, str]:
    """Return what has watched this process from its start, and how children are watched."""
    coverage = sys.modules.get("coverage")
    return coverage and coverage.Coverage.current(), os.environ.get(OF_CHILDREN, "")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> None:
    """Watch only what is counted: watching makes a test and its children a third slower."""
    watch, of_children = _watch()
    is_counted = item.nodeid.startswith(COUNTED)
    if watch is None or is_counted == (OF_CHILDREN in os.environ):
        return
    if is_counted:
        os.environ[OF_CHILDREN] = of_children
        watch.start()
    else:
        del os.environ[OF_CHILDREN]
        watch.stop()
