#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""The viewer as one file, as incise assembles it: assemble.py PAGE [DOCUMENT.json]"""

import pathlib
import sys

folder = pathlib.Path(__file__).resolve().parents[2] / "tools/web"
document = pathlib.Path(sys.argv[2]).read_text().replace("<", "\\u003c") if sys.argv[2:] else ""
page = (folder / "viewer.html").read_text()
for mark, text in (
    ("STYLE", (folder / "viewer.css").read_text()),
    ("DOCUMENT", document),
    ("SCRIPT", (folder / "viewer.js").read_text()),
):
    assert page.count(f"/*{mark}*/") == 1, mark
    page = page.replace(f"/*{mark}*/", text)
pathlib.Path(sys.argv[1]).write_text(page)
