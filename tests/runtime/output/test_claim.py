import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

from camkit.runtime.output.claim import claimed
from camkit.runtime.output.part_file import part_path

HOLDER = textwrap.dedent("""
    import sys
    from pathlib import Path
    from camkit.runtime.output.claim import claimed
    with claimed(Path(sys.argv[1])) as ours:
        print(ours, flush=True)
        sys.stdin.read()
""")


def hold(output: Path) -> subprocess.Popen[str]:
    """Start a process that claims an output and keeps it."""
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(output)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert holder.stdout is not None
    assert holder.stdout.readline() == "True\n"
    return holder


def test_a_claim_is_granted_once_and_leaves_nothing(tmp_path: Path) -> None:
    output = tmp_path / "a.exr"
    with claimed(output) as first, claimed(output) as second, claimed(tmp_path / "b.exr") as other:
        assert (first, second, other) == (True, False, True)
    with claimed(output) as again:
        assert again
    assert list(tmp_path.iterdir()) == []


def test_another_process_holds_a_claim_until_it_is_killed(tmp_path: Path) -> None:
    output = tmp_path / "a.exr"
    with hold(output) as holder:
        part_path(output).write_bytes(b"half")
        with claimed(output) as ours:
            assert not ours
        assert len(list(tmp_path.glob("*.part"))) == 1
        os.kill(holder.pid, signal.SIGKILL)
        holder.wait()
        with claimed(output) as ours:
            assert ours
            assert not list(tmp_path.glob("*.part"))
    assert list(tmp_path.iterdir()) == []
