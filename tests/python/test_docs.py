"""Every Python snippet of the documents runs, in order, from the root of the repository."""

import os
import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
_SNIPPET = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


def snippets(path):
    """(line, code) of each snippet."""
    text = path.read_text(encoding="utf-8")
    return [(text.count("\n", 0, m.start(1)) + 1, m[1]) for m in _SNIPPET.finditer(text)]


@pytest.fixture
def copy_of_root(tmp_path, monkeypatch):
    """A folder that looks like the root to a reader of data, so that what is written lands here."""
    for entry in ROOT.iterdir():
        if entry.name not in (".git", ".venv", "out") and not entry.name.startswith("build"):
            (tmp_path / entry.name).symlink_to(entry)
    # Examples are read and written beside; a copy keeps the repository as it is.
    (tmp_path / "examples").unlink()
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("path", FILES, ids=[str(f.relative_to(ROOT)) for f in FILES])
@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
def test_snippets_run(path, copy_of_root, monkeypatch):
    found = snippets(path)
    if not found:
        pytest.skip(f"{path.name} has no Python snippet")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    namespace = {"__name__": "__main__"}
    try:
        for line, code in found:
            # Blank lines put the line of the document into a traceback.
            exec(compile("\n" * (line - 1) + code, str(path), "exec"), namespace)  # noqa: S102
    finally:
        pyplot.close("all")
        os.chdir(ROOT)


def test_links_to_files_lead_somewhere():
    for path in FILES:
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8")):
            if not target.startswith("docs/reference") and not target.startswith("reference"):
                assert (path.parent / target).exists(), f"{path.name} links to {target}"
