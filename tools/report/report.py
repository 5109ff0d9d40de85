# SPDX-License-Identifier: GPL-2.0-or-later
"""Reports as Markdown and as one file of HTML, from JSON and one template for both.

report.py bench FOLDER   FOLDER/report.json as FOLDER/report.md and report.html, by bench.j2
report.py check          nothing: what it needs is there
report.py page FOLDER    JSON on standard input as HTML on standard output, by assess.j2; demo FOLDER, by demo.j2

Plots are FOLDER/*.svg, or below FOLDER/plots. A template makes blocks: `{% filter p %}` a paragraph,
`{% filter li %}` an item of a list, `{% filter note %}` a box, and table(), plot(), heading() and
command(). All text is shown as it is, whatever it is.
"""
import base64
import html
import json
import math
import os
import re
import sys

try:
    import jinja2
except ImportError:
    sys.exit("python3-jinja2 is not installed, which makes reports")

HERE = os.path.dirname(os.path.abspath(__file__))
ROWS_MAX = 500  # longer tables are for programs: the JSON has them
FAILED_MAX = 40  # rows of a benchmark that failed
RIGHT = ' style="text-align: right"'
LONG = 30  # text of a cell that takes several lines


def clean(text):
    """One line without control characters."""
    return " ".join(re.sub(r"[\x00-\x1f\x7f-\x9f]", " ", str(text)).split())


def anchor(title):
    """The end of a link to a section, as GitHub makes it of a title."""
    return re.sub(r"[^a-z0-9_-]", "", title.lower().replace(" ", "-"))


class Number(str):
    """A formatted number: its column is aligned to the right."""


class Strong(Number):
    """One that stands out."""


class Link(str):
    """A text that leads to a section, or to a file."""

    def __new__(cls, text, target):
        link = super().__new__(cls, text)
        link.target = target
        return link


def number(value, digits=6):
    """0.0123, 45678, 1.3×10⁻¹⁵; "–" where there is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return Number("–")
    # no rounding hides that a ratio is not 1, to as many digits as a reader can use
    while value != 1 and float(f"{value:.{digits - 1}e}") == 1 and digits < 9:
        digits += 1
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    if value == 0 or -4 <= int(power) < 7:
        text = f"{value:.{max(0, digits - 1 - int(power))}f}" if value else "0"
        return Number(text.rstrip("0").rstrip(".") if "." in text else text)
    return Number(f"{mantissa}×10{str(int(power)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}")


def at(row, key):
    """"a.b" leads inwards, "a/b" is a ratio, "a*1e3" is scaled."""
    scaled = re.fullmatch(r"(.+)([*/])(.+)", key)
    if scaled:
        left, right = at(row, scaled[1]), scaled[3]
        right = float(right) if re.match(r"\d", right) else at(row, right)
        if not all(isinstance(x, (int, float)) for x in (left, right)):
            return None
        return left * right if scaled[2] == "*" else left / right if right else None
    for part in key.split("."):
        row = row.get(part) if isinstance(row, dict) else None
    return row


def objects(rows):
    return [row for row in rows if isinstance(row, dict)] if isinstance(rows, list) else []


def first(rows, **where):
    """The first row with these values; {} where there is none."""
    return next((row for row in objects(rows) if all(row.get(k) == v for k, v in where.items())), {})


def values(rows, key):
    found = (at(row, key) for row in objects(rows))
    return [x for x in found if isinstance(x, (int, float)) and math.isfinite(x)]


def largest(rows, key):
    return max(values(rows, key), key=abs, default=None)


def least(rows, key):
    return min(values(rows, key), default=None)


def total(rows, key):
    return sum(values(rows, key)) if values(rows, key) else None


def span(rows, key, digits):
    """"0.5 to 0.9"."""
    low, high = (number(f(values(rows, key), default=None), digits) for f in (min, max))
    return Number(low if low == high else f"{low} to {high}")


def holding(rows, key):
    """"3 of 12": rows for which it is true, or a text; of yes and no, of those that were asked."""
    found = [row.get(key) for row in objects(rows)]
    asked = [x for x in found if isinstance(x, bool)]
    return Number(f"{sum(x is True or isinstance(x, str) for x in found)} of {len(asked or found)}")


def text(value):
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return str(number(value))
    return value if isinstance(value, str) else ""


def value_of(cell, key="value"):
    """Of {"value": "3.2", "bad": true}."""
    return (Strong if cell["bad"] else Number)(cell[key])


class Skin:
    """Blocks of a template in one of both forms, and the titles of sections."""

    def __init__(self, folder):
        self.folder = folder
        self.titles = []

    def table(self, caption, rows, columns):
        """Columns are [heading, key, digits, samples that a percentile needs], all but the first two
        optional. One without any value is left out."""
        rows = objects(rows)
        if not rows:
            return ""
        shown, needs = [], []
        for heading, key, *more in columns:
            digits, samples = (more + [0, 0])[:2]
            cells = []
            for row in rows[:ROWS_MAX]:
                value = at(row, key)
                if samples and value is None and not row.get("failed") and (
                        "." not in key or isinstance(at(row, key.rpartition(".")[0]), dict)):
                    if not needs or needs[-1][0] != heading:
                        needs.append((heading, samples))
                isready = isinstance(value, (Number, Link))
                cells.append(value if isready else number(value, digits) if digits else text(value))
            if samples or any(cell not in ("", "–") for cell in cells):
                shown.append((heading, cells))
        out = self.grid(caption, [h for h, _ in shown], list(zip(*(cells for _, cells in shown))))
        if needs:
            out += self.p("“–” means fewer samples than the percentile needs: " +
                          ", ".join(f"{h} takes {n}" for h, n in needs) + ".")
        for row in rows:
            if isinstance(row.get("failed"), str) and row["failed"]:
                name = ", ".join(f"{h} {number(at(row, k), 6)}" if m and m[0] else text(at(row, k))
                                 for h, k, *m in columns[:3] if at(row, k) not in (None, ""))
                out += self.p(f"Failed: {name}. Why: {row['failed']}")
        if len(rows) > ROWS_MAX:
            out += self.p(f"The first {ROWS_MAX} of {len(rows)} rows.")
        return out

    def facts(self, caption, rows):
        """Rows of (metric, value, details), those without a value left out."""
        rows = [(row[0], Number(row[1]), row[2]) for row in rows if row[1]]
        if not rows:
            return self.p("Nothing of this was measured.")
        return self.grid(caption, ["metric", "value", "details"], rows)

    def plot(self, name, instead, caption):
        """Nothing where the folder has no such plot."""
        path = os.path.join(self.folder, name + ".svg")
        return self.figure(name + ".svg", path, instead, clean(caption)) if os.path.isfile(path) else ""


class Markdown(Skin):
    def escape(self, cell):
        # an underscore in a word is none to Markdown, and names are full of them
        line = re.sub(r"[\\`*\[\]<>|&]|(?<![^\W_])_|_(?![^\W_])", r"\\\g<0>", clean(cell))
        line = re.sub(r"^(?=[#+\-=~])", r"\\", line)
        line = re.sub(r"^(\d+)(?=[.)]( |$))", r"\1\\", line)
        if isinstance(cell, Strong):
            return f"**{line}**"
        return f"[{line}]({cell.target})" if isinstance(cell, Link) else line

    def heading(self, level, title):
        if level == 2:
            self.titles.append(title)
        return f"\n{'#' * level} {self.escape(title)}\n"

    def p(self, block, link=""):
        return f"\n{self.escape(block)}{' ' if link else ''}{self.escape(link)}\n"

    def li(self, block):
        return f"\n- {self.escape(block)}\n"

    def note(self, block):
        return f"\n> {self.escape(block)}\n"

    def command(self, line):
        return f"\n```sh\n{clean(line).replace('`', chr(39))}\n```\n"

    def grid(self, caption, headings, rows):
        right = [any(isinstance(row[k], Number) for row in rows) for k in range(len(headings))]
        lines = [self.escape(caption), "", "| " + " | ".join(map(self.escape, headings)) + " |",
                 "| " + " | ".join("---:" if r else "---" for r in right) + " |"]
        return "\n" + "\n".join(lines + ["| " + " | ".join(map(self.escape, row)) + " |" for row in rows]) + "\n"

    def figure(self, url, path, instead, caption):
        return f"\n![{self.escape(instead)}]({url})\n\n*{self.escape(caption)}*\n"

    def contents(self):
        return "\n" + "".join(f"- {self.escape(Link(t, '#' + anchor(t)))}\n" for t in self.titles)

    def whole(self, title, *parts):
        body = re.sub(r"\n{3,}", "\n\n", "".join(parts)).strip() + "\n"
        return re.sub(r"(?m)^(- .*)\n\n(?=- )", r"\1\n", body)


class Page(Skin):
    def escape(self, cell):
        line = html.escape(clean(cell))
        if isinstance(cell, Strong):
            return f"<strong>{line}</strong>"
        return f'<a href="{html.escape(cell.target)}">{line}</a>' if isinstance(cell, Link) else line

    def heading(self, level, title):
        line = f"<h{level}>{self.escape(title)}</h{level}>\n"
        if level == 2:
            line = f'{"</section>" if self.titles else ""}\n<section id="{anchor(title)}">\n{line}'
            self.titles.append(title)
        return line

    def p(self, block, link=""):
        return f"<p>{self.escape(block)}{' ' if link else ''}{self.escape(link)}</p>\n"

    def li(self, block):
        return f"<li>{self.escape(block)}</li>\n"

    def note(self, block):
        return f"<blockquote>\n<p>{self.escape(block)}</p>\n</blockquote>\n"

    def command(self, line):
        return f"<pre><code>{html.escape(clean(line).replace('`', chr(39)))}</code></pre>\n"

    def cell(self, heading, cell):
        right = RIGHT if isinstance(cell, Number) else ""
        right += ' class="strong"' if isinstance(cell, Strong) else ""
        line = self.escape(cell)
        line = f'<span class="long">{line}</span>' if len(cell) > LONG else line
        return f'<td{right} data-label="{self.escape(heading)}">{line}</td>'

    def grid(self, caption, headings, rows, kind=""):
        right = [any(isinstance(row[k], Number) for row in rows) for k in range(len(headings))]
        kind = f' class="{kind}"' if kind else ""
        head = "".join(f"<th{RIGHT if r else ''}>{self.escape(h)}</th>" for r, h in zip(right, headings))
        body = "".join("<tr>" + "".join(map(self.cell, headings, row)) + "</tr>\n" for row in rows)
        return (f'<div class="scroll" role="region" tabindex="0" aria-label="{self.escape(caption)}">\n<table{kind}>\n'
                f"<caption><span>{self.escape(caption)}</span></caption>\n<thead>\n<tr>{head}</tr>\n</thead>\n"
                f"<tbody>\n{body}</tbody>\n</table>\n</div>\n")

    def figure(self, url, path, instead, caption):
        # as data of an <img>: in the page itself the names within one would meet those of others
        with open(path, "rb") as file:
            data = base64.b64encode(file.read()).decode()
        return (f'<figure>\n<div role="region" tabindex="0" aria-label="{html.escape(caption)}">'
                f'<img alt="{self.escape(instead)}" src="data:image/svg+xml;base64,{data}"></div>\n'
                f"<figcaption>{html.escape(caption)}</figcaption>\n</figure>\n")

    def contents(self):
        items = "".join(f"<li>{self.escape(Link(t, '#' + anchor(t)))}</li>\n" for t in self.titles)
        return f'<nav aria-label="Contents">\n<ul>\n{items}</ul>\n</nav>\n'

    def whole(self, title, before, contents, behind):
        behind = re.sub(r"(?m)((?:^<li>.*</li>\n\s*)+)", r"<ul>\n\1</ul>\n", behind)
        with open(os.path.join(HERE, "document.css"), encoding="utf-8") as file:
            style = file.read()
        return ('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
                '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
                f"<title>{html.escape(title)}</title>\n"
                f'<link rel="icon" href="data:,">\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n'
                f"{before}{contents}{behind}</section>\n</main>\n</body>\n</html>\n")


def render(template, skin, title, data):
    """The template in the skin's form; contents are known when all else is done."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE), trim_blocks=True, lstrip_blocks=True, extensions=["jinja2.ext.do"])
    environment.filters.update(p=skin.p, li=skin.li, note=skin.note, value_of=value_of)
    mark = "\0contents\0"
    body = environment.get_template(template).render(
        data, table=skin.table, facts=skin.facts, plot=skin.plot, heading=skin.heading, command=skin.command,
        grid=skin.grid, n=number, at=at, first=first, objects=objects, largest=largest, least=least, total=total,
        span=span, holding=holding, link=Link, anchor=anchor, number=Number, contents=lambda: mark)
    before, _, behind = body.partition(mark)
    return skin.whole(title, before, skin.contents(), behind)


# --- incise bench all ---

TITLES = {
    "precision": "Force evaluation: error against run time",
    "training": "Training: error on unseen cuts against training time",
    "realism": "Realism: texture of rendered cuts next to recorded ones",
    "stability": "Stability: how stiff a wall may be",
    "loop": "Haptic loop: run time and wake-up latency",
    "view": "View: error of the image against run time",
    "scenes": "Scenes: what each leaves out",
}
# Keys with which a row tells itself from its neighbours, besides its texts.
SETTINGS = ("rate_hz", "K_N_m", "step_s", "stiffness_N_mm")


def failed_rows(benchmark, value, key=""):
    """Rows with a reason why they failed, wherever they are; diverging integrators are counted in their table."""
    if isinstance(value, dict) and isinstance(value.get("failed"), str) and value["failed"]:
        name = ", ".join(v if isinstance(v, str) else f"{k} {number(v, 4)}" for k, v in value.items()
                         if k != "failed" and (isinstance(v, str) or k in SETTINGS))
        yield {"benchmark": benchmark, "row": name, "why": value["failed"]}
    members = value.items() if isinstance(value, dict) else [("", v) for v in value] if isinstance(value, list) else []
    for inner, member in members:
        if inner != "integrators":
            yield from failed_rows(benchmark, member, inner)


def failures(report):
    runs = {k: v for k, v in report["runs"].items() if isinstance(v, dict)}
    lines = []
    for benchmark, run in runs.items():
        if run.get("state") != "measured":
            lines.append(f"{benchmark}: {text(run.get('state'))}: {text(run.get('why'))}")
        lines += [f"{benchmark}: {line}" for line in run.get("warnings") or [] if isinstance(line, str)]
    rows = []
    for benchmark, output in report["benchmarks"].items():
        found = list(failed_rows(benchmark, output))
        rows += found[:FAILED_MAX]
        if len(found) > FAILED_MAX:
            rows.append({"benchmark": benchmark, "row": f"{len(found) - FAILED_MAX} more", "why": "see its JSON"})
    return {"lines": lines, "rows": rows}


def grouped(rows, *keys):
    """Rows that are equal in these keys, as {"rows": …} with the keys."""
    groups = {}
    for row in objects(rows):
        groups.setdefault(tuple(row.get(k) for k in keys), []).append(row)
    return [dict(zip(keys, values_), rows=members) for values_, members in groups.items()]


def bench(folder):
    with open(os.path.join(folder, "report.json"), encoding="utf-8") as file:
        report = json.load(file)
    for key in ("benchmarks", "runs", "machine"):
        report[key] = report[key] if isinstance(report.get(key), dict) else {}
    measured = {k: v for k, v in report["benchmarks"].items() if k in TITLES and isinstance(v, dict)}
    data = dict(report, failures=failures(report), titles=TITLES, grouped=grouped,
                loop_report=measured.get("loop"), command_line=text(report.get("command")),
                to=lambda name: Link(name, "#" + anchor(TITLES[name])) if name in measured else name,
                **{name: measured.get(name) for name in TITLES if name != "loop"})
    title = "incise: error against run time, stability, and what each scene leaves out"
    for name, skin in (("report.md", Markdown(folder)), ("report.html", Page(folder))):
        whole = render("bench.j2", skin, title, dict(data, title=title))
        path = os.path.join(folder, name)
        with open(path + ".part", "w", encoding="utf-8") as file:
            file.write(whole)
        os.replace(path + ".part", path)


def main():
    if sys.argv[1:] == ["check"]:
        return  # what it imports is there
    command, folder = sys.argv[1:]
    if command == "bench":
        bench(folder)
    else:
        data = json.load(sys.stdin)
        template = {"page": "assess.j2", "demo": "demo.j2"}[command]
        sys.stdout.write(render(template, Page(folder), data["title"], data))


if __name__ == "__main__":
    main()
