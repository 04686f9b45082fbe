"""Clocks, memory, versions and folders are left out of JSON."""

from subprocess import CompletedProcess

from tools.evidence.scrubbed import printed_values, scrubbed


def test_clocks_memory_versions_and_folders_are_left_out() -> None:
    value = {
        "output": "/tmp/work/out/a.exr",
        "seconds": {"decode": 0.1},
        "seconds_median": 1.0,
        "peak_rss_mb": 200.0,
        "camkit": "0.1.0",
        "stages": {"wiener": {"way": "wiener", "expected_s": 0.1}},
        "exposure_time_s": 0.01,
        "rows": [{"stages": {"wiener": 0.25}, "psnr_db": 30.0}],
    }
    assert scrubbed(value, ("/tmp/work/",)) == {
        "output": "out/a.exr",
        "stages": {"wiener": {"way": "wiener"}},
        "exposure_time_s": 0.01,
        "rows": [{"psnr_db": 30.0}],
    }


def test_a_command_may_print_several_values_and_fail() -> None:
    told = CompletedProcess([], 1, stdout='{"a": 1}\n{\n"b": 2\n}\nno JSON\n', stderr="x\nwhy\n")
    found = printed_values(told, ())
    assert found == {"exit": 1, "json": [{"a": 1}, {"b": 2}, "no JSON"], "error": ["why"]}
