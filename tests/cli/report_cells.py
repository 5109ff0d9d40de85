# SPDX-License-Identifier: GPL-2.0-or-later
"""What report.html and report.md say, in one form: report_cells.py FILE prints each heading,
paragraph, cell and caption as a line, without what is only form."""

import html.parser
import re
import sys

ROOMS = {"h1", "h2", "h3", "p", "li", "pre", "th", "td", "caption", "figcaption"}


class Page(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.lines = []
        self.room = None

    def handle_starttag(self, tag, attributes):
        if tag in ROOMS:
            self.room = [tag, ""]
        if tag == "img":
            self.lines.append("picture " + dict(attributes)["alt"])

    def handle_data(self, data):
        if self.room:
            self.room[1] += data

    def handle_endtag(self, tag):
        if self.room and tag == self.room[0]:
            self.lines.append(self.room[1])
            self.room = None


def plain(text):
    """Markdown's text: links are their text, a character after a backslash is itself."""
    text = re.sub(r"(?<!\\)\[((?:[^\]\\]|\\.)*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"\\(.)", r"\1", text)


def markdown(text):
    lines = []
    for block in text.split("\n"):
        if not block or block.startswith("```") or re.fullmatch(r"[|: -]+", block):
            continue
        if block.startswith("!["):
            lines.append("picture " + plain(re.match(r"!\[(.*)\]\(", block)[1]))
        elif block.startswith("| "):
            lines += [plain(cell) for cell in re.findall(r"\| ((?:[^|\\]|\\.)*?) (?=\|)", block)]
        else:
            lines.append(plain(re.sub(r"^(#+ |> |- |\*(?=.*\*$))", "", block).rstrip("*")))
    return lines


with open(sys.argv[1], encoding="utf-8") as file:
    content = file.read()
if sys.argv[1].endswith(".html"):
    page = Page()
    page.feed(content)
    result = page.lines
else:
    result = markdown(content)
for line in result:
    line = " ".join(line.split())
    if line:
        print(line)
