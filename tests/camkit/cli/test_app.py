"""The command line as a whole: quick to start, one line per error, meaningful exit codes."""

import subprocess
import sys

import pytest

import camkit
from camkit.cli import app as app_module
from camkit.cli.app import app, run
from camkit.cli.exit_code import ExitCode, exit_code_of
from camkit.errors import BundleError, ContractError, DecodeError, ParityError, UnsupportedError

HEAVY = {"numpy", "cv2", "onnxruntime", "onnx", "torch", "scipy", "pydantic", "rawpy", "OpenEXR"}
OPTIONS = {
    "process": "--bundle --size --quality --max-seconds --max-error-db --out-dir --format --color "
    "--wb --exposure --demosaic --linear "
    "--no-vignetting --no-undistort --mosaic --black-level --white-level --method --mode "
    "--provider --dtype --origin-px --assume "
    "--max-mem --threads --jobs --resume --overwrite --json --dry-run --debug",
    "plan": "--bundle --size --quality --max-seconds --max-error-db --out-dir --method --mode "
    "--assume --max-mem --threads --json --debug",
    "view": "-o --before --crop --overwrite --json --debug",
    "portable": "--out --size --depth-m --json --debug",
    "info": "--schema --json --debug",
    "check": "--level --json --debug",
    "simulate": "--bundle --iso --seed --origin-px -o --debug",
    "merge": "-o --times --response --reference --mosaic --black-level --white-level --overwrite "
    "--json --debug",
    "make": "-o --sensor --from --pitch-um --f-number --stop-radius-mm --focus-m --object-m "
    "--glass --distance-from --minutes --size --data --valid --start --work-dir --overwrite --json "
    "--debug",
    "recipe": "-o --sensor --from --f-number --focus-m --object-m --name --overwrite --debug",
    "freeze": "-o --stress-out --report --quick --debug",
    "bench": "--all --data --images --out-dir --sizes --methods --modes --dtypes --providers "
    "--threads --tile --reference --capture --width --height --repeat --quick --work-dir --json "
    "--debug",
    "stress": "--scenarios --quick --data --sizes --scenes --compare --out-dir --write --list "
    "--json --debug",
    "train": "--size --data --steps --max-minutes --resume --fine-tune --vgg --pairs --debug",
    "prepare": "--psf --haze --data --valid --out-dir --seed --overwrite --json --debug",
    "fit-bank": "-o --data --samples --steps --seed --cache-dir --overwrite --json --debug",
    "freeze-norms": "-o --data --valid --samples --cache-dir --overwrite --json --debug",
    "design": "--data --out-dir --steps --lens-rate --prescription --seed --pictures --threads "
    "--resume --overwrite --json --debug",
    "export": "-o --psf --haze --stress-psf --prescription --debug",
    "doctor": "--json --debug",
}


def test_help_starts_without_any_heavy_library() -> None:
    code = (
        "import sys\nfrom camkit.cli.app import run\ncode = run(['--help'])\n"
        "print('LOADED', *sorted(m for m in sys.modules if '.' not in m))\nsys.exit(code)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.rpartition("LOADED")[2].split())
    assert "typer" in loaded
    assert not loaded & HEAVY
    assert "process" in done.stdout


@pytest.mark.parametrize("command", sorted(OPTIONS))
def test_each_command_has_its_documented_options(command: str, camkit_command, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    outcome = camkit_command(command, "--help")
    assert outcome.code == 0
    missing = {o for o in OPTIONS[command].split() if o not in outcome.out.split()}
    missing = {o for o in missing if f"{o}," not in outcome.out and f",{o}" not in outcome.out}
    assert not missing


def test_the_version_is_that_of_the_package(camkit_command) -> None:
    assert camkit_command("--version").out == f"camkit {camkit.__version__}\n"


def test_an_unknown_command_is_a_usage_error(camkit_command) -> None:
    assert camkit_command("develop").code == ExitCode.USAGE


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ContractError("x"), 2),
        (BundleError("x"), 3),
        (DecodeError("x"), 1),
        (UnsupportedError("x"), 1),
        (ParityError("x"), 1),
        (PermissionError("x"), 1),
    ],
)
def test_each_error_has_its_exit_code(error: Exception, code: int) -> None:
    assert exit_code_of(error) == code


def _failing(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def broken(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(app_module, "app", broken)


def test_an_error_is_one_line_and_debug_adds_the_traceback(monkeypatch, capsys) -> None:
    _failing(monkeypatch, BundleError("refused\n  for two lines of reasons"))
    assert run(["check", "x"]) == ExitCode.BUNDLE_REFUSED
    assert capsys.readouterr().err == "camkit: refused for two lines of reasons\n"
    assert run(["check", "x", "--debug"]) == ExitCode.BUNDLE_REFUSED
    assert "Traceback" in capsys.readouterr().err


def test_a_system_error_is_one_line_too(monkeypatch, capsys) -> None:
    _failing(monkeypatch, PermissionError(13, "Permission denied", "out"))
    assert run(["process", "x"]) == ExitCode.INPUT_FAILED
    assert capsys.readouterr().err == "camkit: out: Permission denied\n"


def test_an_interrupt_ends_with_130_and_says_so(monkeypatch, camkit_command) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("camkit.bundle.manifest.manifest_schema", interrupted)
    outcome = camkit_command("info", "--schema")
    assert (outcome.code, outcome.err) == (130, "camkit: interrupted\n")


def test_a_closed_pipe_ends_the_run_without_a_traceback() -> None:
    code = (
        "import sys\nfrom camkit.cli.app import main\nsys.argv = ['camkit', 'info', '--schema']\n"
        "sys.stdin.readline()\nmain()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as child:
        assert child.stdout is not None
        child.stdout.close()
        child.stdout = None
        _, err = child.communicate(b"go\n", timeout=60)
    assert child.returncode == 1
    assert err == b""


def test_every_command_can_be_called_with_help() -> None:
    names = {c.callback.__name__.replace("_", "-") for c in app.registered_commands}
    assert names == set(OPTIONS)
