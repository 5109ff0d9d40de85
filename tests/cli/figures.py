# SPDX-License-Identifier: GPL-2.0-or-later
"""figures.py FILE.svg...: measures figures that gnuplot wrote, and prints a line for each text that
leaves the canvas, two texts that overlap, a text that data cross or fill, an axis that is not labelled
"quantity / unit", a number or unit in the form of a program, a legend entry without data, and discs of the paper's
colour, which hide error bars. Exit 1 if there is any.

Text is measured with the advance widths of DejaVu Sans, the font of the figures, so that no font
has to be installed. A box reaches from the top of ascenders to the baseline, or to the bottom of
descenders if the text has any.
"""

import math
import re
import sys
import xml.etree.ElementTree as tree

SVG = "{http://www.w3.org/2000/svg}"
HREF = "{http://www.w3.org/1999/xlink}href"

# Advance widths of space to ~, and of others, in 1/1000 of the font size; the widest for the rest.
WIDTHS = [
    318, 401, 460, 838, 636, 950, 780, 275, 390, 390, 500, 838, 318, 361, 318, 337, 636, 636, 636,
    636, 636, 636, 636, 636, 636, 636, 337, 337, 838, 838, 838, 531, 1000, 684, 686, 698, 770, 632,
    575, 775, 752, 295, 295, 656, 557, 863, 748, 787, 603, 787, 695, 635, 611, 732, 684, 989, 685,
    611, 685, 390, 337, 390, 838, 500, 500, 613, 635, 550, 635, 615, 352, 635, 634, 278, 278, 579,
    278, 974, 634, 612, 635, 635, 411, 521, 392, 634, 592, 818, 592, 592, 525, 636, 337, 636, 838]
OTHERS = {"µ": 636, "²": 401, "³": 401, "°": 500, "−": 838, "×": 838, "–": 500, "’": 318}
WIDEST = 1000
ASCENT, DESCENT = 0.76, 0.24  # of the font size: b and g
DESCENDS = set("gjpqy,;()[]{}|_Q/µ@$")

# The advance width of a text is at least a side bearing of 0.05 em, 0.6 px at 12 px, wider than
# its ink at either end; gnuplot rounds positions to 0.01 px.
TOLERANCE_PX = 0.5

UNITS = (r"µm|mm|px|mrad|s|ms|µs|ns|N|mN|mV|Hz|kHz|%|texel|SD|\(mm/s\)|\(N/m\)|\(N/mm\)|\(mV/N\)|"
         r"\(mm/s²\)|\(mN s/mm\)|\(N s/mm\)|\(mm/px\)|°|\(°/s\)|dB|\(1/mm\)")
COUNTS = "cut|degree of membership|number of the reading|share of the ticks"  # without a unit
LABEL = re.compile(r".*[^ ] / (%s)|%s|(device damping bT|wall stiffness KT²)/m" % (UNITS, COUNTS))
NUMBER = re.compile(r"[−-]?[\d.]+")
PROGRAM = re.compile(r"(?<![\w.])\d[\d.]*e[-+−]?\d|\d us\b|/ us\b|\bnan\b|\b[a-z]+_[a-z0-9]")


def width_of(text, size):
    return sum(WIDTHS[ord(c) - 32] if 32 <= ord(c) < 127 else OTHERS.get(c, WIDEST)
               for c in text) * size / 1000


def numbers(text):
    return [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text or "")]


class Text:
    """A text with its corners on the canvas."""

    def __init__(self, group, element):
        place = group.get("transform")
        self.x, self.y = numbers(re.search(r"translate\(([^)]*)\)", place)[1])
        turn = re.search(r"rotate\(([^)]*)\)", place)
        self.degrees = numbers(turn[1])[0] % 360 if turn else 0
        self.size = float(group.get("font-size"))
        self.anchor = group.get("text-anchor", "start")
        self.enhanced = element.find(SVG + "tspan") is not None
        # Superscripts and subscripts are smaller and moved.
        parts, lift, self.above, self.below, self.width = [], 0, 0, 0, 0
        for part in element.iter():
            size = float(part.get("font-size", self.size))
            lift += numbers(part.get("dy"))[0] if part.get("dy") else 0
            for text in (part.text, part.tail if part is not element else None):
                text = (text or "").strip("\n\t")
                if text:
                    parts.append(text)
                    self.width += width_of(text, size)
                    self.above = max(self.above, ASCENT * size - lift)
                    if DESCENDS & set(text):
                        self.below = max(self.below, DESCENT * size + lift)
        self.text = "".join(parts)

    def box(self):
        """Left, top, right and bottom of it, from its place, as if it was not turned."""
        left = {"start": 0, "middle": -self.width / 2, "end": -self.width}[self.anchor]
        return left, -self.above, left + self.width, self.below

    def turn(self, x, y, way=1):
        angle = way * math.radians(self.degrees)
        return (x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle))

    def corners(self):
        left, top, right, bottom = self.box()
        return [(self.x + x, self.y + y) for x, y in (
            self.turn(left, top), self.turn(right, top), self.turn(right, bottom), self.turn(left, bottom))]


def overlap(a, b):
    """How far two rectangles that may be turned reach into each other, px; 0: they do not."""
    least = math.inf
    for one in (a, b):
        for i in (0, 1):
            dx, dy = one[i + 1][0] - one[i][0], one[i + 1][1] - one[i][1]
            length = math.hypot(dx, dy)
            if not length:
                return 0
            p = [(x * dx + y * dy) / length for x, y in a]
            q = [(x * dx + y * dy) / length for x, y in b]
            least = min(least, min(max(p), max(q)) - max(min(p), min(q)))
    return max(0, least)


def crosses(a, b, low, high):
    """Whether the line from a to b is within a rectangle anywhere (Liang and Barsky)."""
    enter, leave = 0.0, 1.0
    for k in (0, 1):
        way = b[k] - a[k]
        if abs(way) < 1e-9:
            if not low[k] <= a[k] <= high[k]:
                return False
            continue
        first, last = sorted(((low[k] - a[k]) / way, (high[k] - a[k]) / way))
        enter, leave = max(enter, first), min(leave, last)
    return enter <= leave


def holds(band, x, y):
    """Whether a polygon has a place within it."""
    within = False
    for (ax, ay), (bx, by) in zip(band, band[1:] + band[:1]):
        within ^= (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax)
    return within


def data_cross(text, lines):
    """Whether a line, a marker or a filled band is in what surely is ink of a text."""
    left, top, right, bottom = text.box()
    ink = 0.1 * text.size
    low, high = (left + ink, top + ink), (right - ink, min(bottom, 0) - ink)
    xs, ys = zip(*text.corners())
    for least, most, line, filled in lines:
        if least[0] > max(xs) or most[0] < min(xs) or least[1] > max(ys) or most[1] < min(ys):
            continue
        own = [text.turn(x - text.x, y - text.y, -1) for x, y in line]
        if any(crosses(a, b, low, high) for a, b in zip(own, own[1:] or own)):
            return True
        if filled and holds(own, (left + right) / 2, (low[1] + high[1]) / 2):
            return True
    return False


class Figure:
    def __init__(self, path):
        self.root = tree.parse(path).getroot()
        self.width, self.height = float(self.root.get("width")), float(self.root.get("height"))
        self.texts = []
        self.segments = []  # of each plot: texts before its first series, and after
        self.shapes = []  # place, colour
        self.lines = []  # of series: least and largest place, points, filled
        self.entries = []  # of legends: title, text, colours of its sample
        self.walk(self.root.find("./%sg[@id='gnuplot_canvas']" % SVG), "black", None)
        # gnuplot 6 writes the labels of axes behind the series, where 5 has the next plot's title only:
        # before the first tic there is what belongs to the plot before.
        last = [t for t in self.texts if not getattr(t, "seen", False)]
        for segment, behind in zip(self.segments, self.segments[1:] + [last]):
            while behind and not behind[0].enhanced:
                segment.append(behind.pop(0))
        # A map has all of its axes behind its series.
        if self.segments and not any(t.enhanced for t in self.segments[-1]):
            self.segments[-1] += last

    def walk(self, element, colour, series):
        colour = colour_of(element, colour)
        name = element.get("id", "")
        if name.startswith("gnuplot_plot_"):
            series = {"title": element.find(SVG + "title").text, "texts": [], "shapes": []}
            if re.fullmatch("gnuplot_plot_1[a-z]*", name):
                self.segments.append([t for t in self.texts if not getattr(t, "seen", False)])
                for text in self.texts:
                    text.seen = True
        if element.tag == SVG + "text" and "".join(element.itertext()).strip():
            text = Text(self.parent, element)
            # gnuplot writes a text in a box twice: box and text.
            if not any(t.text == text.text and t.corners() == text.corners() for t in self.texts):
                self.texts.append(text)
            if series:
                series["texts"].append(text)
        if element.tag in (SVG + "path", SVG + "use", SVG + "polygon", SVG + "rect", SVG + "image"):
            if series and element.tag != SVG + "image":
                data = element.get("d") or element.get("points") or element.get("transform") or ""
                flat = map(numbers, re.sub(r"scale\(.*", "", data).split("M"))
                for line in (list(zip(at[::2], at[1::2])) for at in flat if len(at) > 1):
                    xs, ys = zip(*line)
                    self.lines.append(((min(xs), min(ys)), (max(xs), max(ys)), line,
                                       element.tag == SVG + "polygon"))
            # Where each line of a path begins, and where a marker is.
            for part in places_of(element):
                self.shapes.append((*part, colour, series))
                if series:
                    series["shapes"].append((*part, colour))
        for child in element:
            if child.tag != SVG + "defs":
                before = getattr(self, "parent", None)
                self.parent = element
                self.walk(child, colour, series)
                self.parent = before
        if name.startswith("gnuplot_plot_") and not series["title"].startswith("gnuplot_plot_"):
            for text in series["texts"]:
                if text.text == series["title"]:
                    self.entries.append((series, text))


def colour_of(element, inherited):
    for key in ("stroke", "fill", "color"):
        value = (element.get(key) or "").replace(" ", "")
        if value and value not in ("none", "currentColor", "currentcolor"):
            return value
    return inherited


def places_of(element):
    if element.get("class") == "gridline":
        return []
    lines = (element.get("d") or element.get("points") or element.get("transform") or "").split("M")
    return [tuple(at[:2]) for at in map(numbers, lines) if len(at) > 1] or (
        [(0, 0)] if element.tag == SVG + "image" else [])


def is_sample(x, y, text):
    """Whether a shape is next to the text of a legend entry: its sample."""
    return abs(y - (text.y - text.size * 0.33)) < text.size and -70 < x - text.x < text.width + 70


def check(path):
    figure = Figure(path)
    boxes = [text.corners() for text in figure.texts]
    if not figure.texts:
        yield "there is no text"
    for text, box in zip(figure.texts, boxes):
        out = max(max(-x, -y, x - figure.width, y - figure.height) for x, y in box)
        if out > TOLERANCE_PX:
            yield "'%s' leaves the canvas by %.1f px" % (text.text, out)
        if PROGRAM.search(text.text):
            yield "'%s' is in the form of a program" % text.text
    discs = sum(element.get(HREF) == "#gpPt6" and element.get("color") == "#FFFFFF" and
                numbers(re.search(r"scale\(([^)]*)\)", element.get("transform"))[1])[0] > 1
                for element in figure.root.iter(SVG + "use"))
    if discs:
        yield "%d white discs hide data" % discs
    for text in figure.texts:
        if data_cross(text, figure.lines):
            yield "data cross '%s'" % text.text
    for i, a in enumerate(boxes):
        for k in range(i):
            over = overlap(a, boxes[k])
            if over > TOLERANCE_PX:
                yield "'%s' and '%s' overlap by %.1f px" % (
                    figure.texts[k].text, figure.texts[i].text, over)
    # Turned texts are labels of axes; and so is the text below the tics of a plot's x axis.
    labels = [t for t in figure.texts if t.degrees]
    for segment in figure.segments:
        tics = [t.y for t in segment if t.enhanced and not t.degrees]
        labels += [t for t in segment if not t.degrees and not t.enhanced and tics and
                   t.y > max(tics) and t.anchor == "middle"]
    # gnuplot leaves out a label that has no place on the canvas. Numbers below an axis are
    # centred, those next to one end at it; the axes of a surface are all turned.
    for anchor, has in (("middle", any(t.degrees != 270 for t in labels)),
                        ("end", any(t.degrees for t in labels))):
        tics = [t for t in figure.texts if t.anchor == anchor and NUMBER.fullmatch(t.text)]
        if len(tics) > 1 and not has:
            yield "the label of an axis is missing"
    for text in labels:
        if not LABEL.fullmatch(text.text):
            yield "the label '%s' is no 'quantity / unit'" % text.text
    samples = [text for _, text in figure.entries]
    for series, text in figure.entries:
        colours = {c for x, y, c in series["shapes"] if is_sample(x, y, text)}
        if not any(c in colours and not any(is_sample(x, y, s) for s in samples)
                   for x, y, c, of in figure.shapes if of):
            yield "the legend's '%s' has no data" % text.text


if __name__ == "__main__":
    found = 0
    for name in sys.argv[1:]:
        for finding in check(name):
            print("%s: %s" % (name, finding))
            found = 1
    sys.exit(found)
