"""One HTML file that needs no network, no server and no script, and prints on A4.

What every page shares: its look, its shell, figures inside of it as SVG, tables and lists.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from datetime import datetime, timezone
from html import escape
from typing import Any

import numpy as np

CSS = """
:root { --ink: #1c1c1c; --soft: #5b5b5b; --line: #d9d9d9; --paper: #fff; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2.2rem 1.4rem 3rem; max-width: 53rem; background: var(--paper);
  color: var(--ink); font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
h1 { font-size: 1.55rem; line-height: 1.25; margin: 0 0 .2rem; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .6rem; }
p { margin: .5rem 0; }
.source { color: var(--soft); margin: 0 0 1.2rem; }
.verdict { border-left: 6px solid var(--c); background: var(--b); padding: .9rem 1.2rem; }
.verdict p { margin: .25rem 0; }
.verdict .word { font-size: 1.35rem; font-weight: 700; }
.good { --c: #009E73; --b: #edf8f4; } .bad { --c: #D55E00; --b: #fdf1e9; }
.open { --c: #E69F00; --b: #fdf7e8; }
.warn { border-left: 6px solid #E69F00; background: #fdf7e8; padding: .6rem 1.2rem;
  margin: 1rem 0; }
.warn p { margin: .3rem 0; }
table { border-collapse: collapse; width: 100%; font-size: .93em;
  font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .28rem .6rem; border-bottom: 1px solid var(--line);
  white-space: nowrap; }
thead th { border-bottom: 2px solid var(--ink); font-weight: 600; }
.dense { font-size: .85em; } .dense th, .dense td { padding: .28rem .4rem; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
td.words, th.words { text-align: left; white-space: normal; }
tbody tr.first th, tbody tr.first td { border-top: 2px solid var(--line); }
tbody th { font-weight: 400; }
.scroll { overflow-x: auto; }
.soft { color: var(--soft); }
i.q { font-family: Georgia, "DejaVu Serif", serif; }
figure { margin: 1.6rem 0; }
figure h3 { font-size: 1rem; margin: 0 0 .4rem; }
figure img { display: block; width: 100%; height: auto; }
figcaption { color: var(--soft); font-size: .9rem; margin-top: .4rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .25rem 1.4rem; margin: .5rem 0; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
ol { padding-left: 1.3rem; margin: .4rem 0; }
footer { margin-top: 2.4rem; border-top: 1px solid var(--line); padding-top: .6rem;
  color: var(--soft); font-size: .85rem; }
@media (max-width: 34rem) { dl { grid-template-columns: 1fr; } dd { margin-bottom: .4rem; } }
@page { size: A4; margin: 16mm 15mm; }
@media print {
  body { max-width: none; padding: 0; font-size: 10.5pt; }
  figure, .verdict, .warn, tr, dl { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
  .verdict, .warn { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
  .scroll { overflow: visible; }
}
"""


def document(title: str, parts: Iterable[str]) -> str:
    """A whole page; empty parts are left out, what made it stands at its end."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n"
        f"<style>{CSS}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(part for part in [*parts, footer()] if part)
        + "\n</main>\n</body>\n</html>\n"
    )


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    dense: bool = False,
    words: Sequence[int] = (),
) -> str:
    """A table of HTML cells; the first of every row names it. Columns `words` hold text."""

    def cells(row: Sequence[str]) -> str:
        kinds = [' class="words"' if i in words else "" for i in range(len(row))]
        told = [f"<td{kind}>{cell}</td>" for kind, cell in zip(kinds, row, strict=True)]
        return f"<tr><th scope=row>{row[0]}</th>{''.join(told[1:])}</tr>"

    top = "".join(
        f"<th scope=col{' class=words' if i in words else ''}>{cell}</th>"
        for i, cell in enumerate(head)
    )
    kind = ' class="dense"' if dense else ""
    return (
        f'<div class="scroll"><table{kind}><thead><tr>{top}</tr></thead>'
        f"<tbody>{''.join(cells(row) for row in rows)}</tbody></table></div>"
    )


def definitions(pairs: list[tuple[str, str]]) -> str:
    """Names with what is said of them; pairs without words are left out."""
    return "<dl>" + "".join(f"<dt>{a}</dt><dd>{b}</dd>" for a, b in pairs if b) + "</dl>"


def ordered(sentences: Any) -> str:
    """A numbered list of sentences."""
    items = "".join(f"<li>{escape(str(sentence))}</li>" for sentence in sentences)
    return f"<ol>{items}</ol>" if items else ""


def figure(picture: Any) -> str:
    """A picture (ulna.plot.Picture) with its title and caption."""
    data = base64.b64encode(picture.svg).decode("ascii")
    text = escape(picture.title + ". " + picture.caption, quote=True)
    return (
        f'<figure id="{escape(picture.name)}"><h3>{escape(picture.title)}</h3>'
        f'<img alt="{text}" src="data:image/svg+xml;base64,{data}">'
        f"<figcaption>{escape(picture.caption)}</figcaption></figure>"
    )


def footer() -> str:
    """What made the page, and when."""
    from . import __version__, build_information

    build = build_information()
    now = datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
    return (
        f"<footer>ulna {escape(__version__)} · {escape(build.get('build', ''))} · "
        f"NumPy {escape(np.__version__)} · written {now}</footer>"
    )
