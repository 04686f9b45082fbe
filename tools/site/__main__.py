"""Build the site of the manuals into site/.

    python -m tools.site          `make docs` calls it

zensical renders the pages and refuses broken links. What it leaves is mended here: the script for
pages opened as files comes from this folder, not from another host, and pipes in code of tables
lose the backslash that git hosts need. Pages that load anything from another host are refused.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
SITE: Final = ROOT / "site"
WORKER: Final = "file_worker.js"
FOREIGN_WORKER: Final = re.compile(r'src="?https://unpkg\.com/iframe-worker/shim"?')
CODE_PIPE: Final = re.compile(r"(<code>[^<]*)\\\|")
LOADED: Final = re.compile(r'<(?:script|img|iframe|link)\b[^>]*(?:src|href)="?(https?://[^">\s]+)')


def main() -> int:
    """Build the site, then mend and check its pages; return the exit code."""
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    code = subprocess.run(command, cwd=ROOT, check=False).returncode
    if code:
        return code
    shutil.copy(Path(__file__).with_name(WORKER), SITE / "assets" / "javascripts")
    faults = []
    for path in sorted(SITE.rglob("*.html")):
        prefix = "../" * (len(path.relative_to(SITE).parts) - 1)
        text = mended_page(path.read_text(encoding="utf-8"), prefix)
        path.write_text(text, encoding="utf-8")
        faults += [f"{path.relative_to(SITE)} loads {url}" for url in LOADED.findall(text)]
    print(*faults, f"open {SITE / 'index.html'}", sep="\n")
    return int(bool(faults))


def mended_page(text: str, prefix: str) -> str:
    """Return a page with the worker of this folder and plain pipes in code.

    Args:
        text: The page.
        prefix: The way from its folder to the root of the site, such as "../".
    """
    text = FOREIGN_WORKER.sub(f'src="{prefix}assets/javascripts/{WORKER}"', text)
    count = 1
    while count:
        text, count = CODE_PIPE.subn(r"\1|", text)
    return text


if __name__ == "__main__":
    sys.exit(main())
