#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""The viewer in Chromium: viewer.py CHECK… runs functions of this file, each in a tab of its own.

Pages with a document are files; a live page has a socket of the test's own instead of a server
(FAKE), and timers that the test sees and runs, so that nothing waits for a time.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time

from chromium import LIMIT_S, Chromium

HERE = pathlib.Path(__file__).resolve().parent

# A known pattern: force steps from 0 N to 1 N at 5 s and is missing from 7 s to 8 s; the model is
# 0.5 N with u = 0.1 N. Everything else a head may have is there once.
TIMES = [i / 20 for i in range(201)]
DOCUMENT = {
    "head": {
        "kind": "recording",
        "title": "</script><img src=x onerror=alert(1)>.rec",
        "version": "1",
        "axis": {"label": "time", "unit": "s"},
        "from": 0,
        "to": 10,
        "panels": [
            {"label": "force", "unit": "N", "tracks": [0]},
            {"label": "model", "unit": "N", "tracks": [1, 2]},
        ],
        "tracks": [{"label": "force"}, {"label": "predicted"}, {"label": "flat"}],
        "cuts": [[1, 2, "1"], [4, 6, "2"]],
        "events": [[3, "marker", "<b>tap</b>"]],
        "frames": None,
        "path": {"unit": "mm", "t": [0, 5, 10], "x": [0, 10, 10], "y": [0, 0, 10]},
        "table": {"head": ["criterion", "value"], "rows": [["<i>depth</i>", "1 mm"]]},
        "members": [{"label": "b", "from": 0, "to": 9, "text": "clock +1 ms"}],
        "facts": [["rig", "sim:"], ["scene", "/a" + "long" * 60 + ".scene"]],
        "export": "incise export 'a b.rec' --range {from}s..{to}s -o part.csv",
        "note": "reduced",
    },
    "part": {
        "from": 0,
        "to": 10,
        "done": 1,
        "tracks": [
            {"low": [None if 7 <= i / 100 < 8 else float(i >= 500) for i in range(1000)]}
            | {"high": [None if 7 <= i / 100 < 8 else float(i >= 500) for i in range(1000)]},
            {"x": TIMES, "y": [0.5] * 201, "u": [0.1] * 201},
            {"x": [0, 10], "y": [0.9, 0.9]},
        ],
    },
}
LIVE_HEAD = {
    "kind": "live",
    "title": "loop",
    "version": "1",
    "axis": {"label": "time", "unit": "s"},
    "from": 0,
    "to": 0,
    "panels": [{"label": "force", "unit": "N", "tracks": [0, 1, 2, 3]}],
    "tracks": [{"label": name} for name in "abcd"],
    "cuts": [],
    "events": [],
    "control": True,
    "tools": ["blade", "handle"],
}
FAKE = """
window.sockets = []; window.delays = [];
const later = window.setTimeout;
window.setTimeout = (does, ms) =>
	does.name == "connect" ? (delays.push(ms), later(does, 0)) : later(does, ms);
window.WebSocket = class {
	constructor(url) { Object.assign(this, {url, readyState: 0, sent: []}); sockets.push(this); }
	send(text) { this.sent.push(JSON.parse(text)); }
	open() { this.readyState = 1; this.onopen({}); }
	say(what) { this.onmessage({data: what instanceof ArrayBuffer ? what : JSON.stringify(what)}); }
	drop(code) { this.readyState = 3; this.onclose({code}); }
};
"""
# Heights from the panel's top, in CSS pixels, where a column of the canvas has a track's colour.
COLOURED = """
window.coloured = (panel, x, track) => {
	const canvas = document.querySelector("#stage canvas"), ratio = canvas.width / canvas.clientWidth;
	const row = rows.filter(row => row.kind == "panel")[panel], top = row.top + row.legend - 4;
	const probe = document.createElement("canvas").getContext("2d");
	probe.fillStyle = colours.tracks[track];
	probe.fillRect(0, 0, 1, 1);
	const want = probe.getImageData(0, 0, 1, 1).data;
	const data = canvas.getContext("2d").getImageData(Math.round(toPx(x) * ratio), top * ratio, 1,
		(row.plot + 8) * ratio).data;
	const found = [];
	for (let i = 0; i < data.length / 4; i++)
		if ([0, 1, 2].every(k => Math.abs(data[4 * i + k] - want[k]) < 70) && data[4 * i + 3] > 128)
			found.push(i / ratio - 4);
	return found;
};
"""


def assembled(document=None):
    """The page's address."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="page-", dir="."))
    arguments = [folder / "page.html"]
    if document:
        (folder / "document.json").write_text(json.dumps(document))
        arguments.append(folder / "document.json")
    subprocess.run([sys.executable, HERE / "assemble.py", *arguments], check=True)
    return arguments[0].resolve().as_uri()


def drawn(page):
    """After the next picture."""
    page.wait_for("document.body.dataset.ready")
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def shown(browser, document=DOCUMENT, **size):
    page = browser.page()
    page.resize(**{"width": 1280, **size})
    page.open(assembled(document))
    drawn(page)
    return page


def near(page, what, *values):
    """Waits for numbers of a data attribute of the body: each within a millionth."""
    page.wait_for(
        f"document.body.dataset.{what}.split(' ').map(Number)"
        f".every((v, i) => Math.abs(v - {json.dumps(values)}[i]) < 1e-6)"
    )


def says(page):
    assert not page.says, page.says


def pixels(browser):
    """The colour is where the pattern has it, at one and at two device pixels a pixel."""
    for ratio in (1, 2):
        page = shown(browser, ratio=ratio)
        page.evaluate(COLOURED)
        plot = page.evaluate("rows.find(row => row.kind == 'panel').plot")
        low, high, gap = (page.evaluate(f"coloured(0, {x}, 0)") for x in (2.5, 6.5, 7.5))
        assert low and high and not gap, (low, high, gap)
        # 0 N and 1 N are the ends of the panel; a line is 1.6 pixels wide
        assert max(abs(y - plot) for y in low) <= 2.5, (low, plot)
        assert max(abs(y) for y in high) <= 2.5, high
        # the step is a line from one end to the other, within a column of the part and a pixel
        around = [page.evaluate(f"coloured(0, 5 + {i} * 10 / plotWidth, 0)") for i in range(-9, 10)]
        assert max(len(c) for c in around) / ratio > plot * 0.9, [len(c) for c in around]
        # 0.5 N and its band of 2 × 0.1 N, seen on the page's own scale
        middle = page.evaluate("coloured(1, 3.3, 0)")
        assert middle and max(middle) - min(middle) <= 3, middle
        band = page.evaluate(
            """(() => { const canvas = document.querySelector("#stage canvas");
            const g = canvas.getContext("2d"), ratio = canvas.width / canvas.clientWidth;
            const row = rows.filter(row => row.kind == "panel")[1];
            const at = v => String(
                g.getImageData(toPx(3.3) * ratio, row.toY(v) * ratio, 1, 1).data);
            return [0.33, 0.43, 0.57, 0.67].map(at).concat([at(0.73), at(0.27)]); })()"""
        )
        assert len(set(band[:4])) == 1 and len(set(band[4:])) == 1 and band[0] != band[4], band
        says(page)
        page.close()


def keys(browser):
    """Each key changes what the list of keys says, and the list has all of them."""
    page = shown(browser)
    near(page, "cursor", 1)
    for key, shift, cursor in (
        ("ArrowRight", False, 1.05),
        ("ArrowRight", True, 1.55),
        ("ArrowLeft", False, 1.5),
        ("ArrowLeft", True, 1.0),
        ("End", False, 10),
        (",", False, 3),
        ("Home", False, 0),
        (".", False, 3),
    ):
        page.key(key, shift)
        near(page, "cursor", cursor)
    page.key("Home")
    near(page, "cursor", 0)
    for key, view, cursor, command in (
        ("+", (0, 5), 0, "0.0000s..5.0000s"),
        ("n", (0.9, 2.1), 1, "1.0000s..2.0000s"),
        ("n", (3.8, 6.2), 4, "4.0000s..6.0000s"),
        ("p", (0.9, 2.1), 1, "1.0000s..2.0000s"),
        ("0", (0, 10), 1, "1.0000s..2.0000s"),
        ("z", (1, 2), 1, "1.0000s..2.0000s"),
        ("-", (1, 3), 1, "1.0000s..2.0000s"),
        ("Escape", (1, 3), 1, "1.0000s..3.0000s"),
        ("]", (1, 3), 1, "1.0000s..1.0000s"),
        ("Escape", (1, 3), 1, "1.0000s..3.0000s"),
        ("End", (8.2, 10), 10, None),
        ("[", (8, 10), 10, "10.0000s..10.0000s"),
        ("0", (0, 10), 10, "10.0000s..10.0000s"),
    ):
        page.key(key)
        near(page, "cursor", cursor)
        if key != "End":
            near(page, "view", *view)
        if command:
            wanted = f"incise export 'a b.rec' --range {command} -o part.csv"
            page.wait_for(f"command.textContent === {json.dumps(wanted)}")
    page.key("s")
    page.wait_for("""document.querySelector('[data-key="s"]').ariaPressed == "true" """)
    page.key("e")
    page.wait_for("said.textContent.includes('incise export')")
    page.key("Home")
    page.key(" ")
    page.wait_for("""+document.body.dataset.cursor > 0.1""")
    page.key(" ")
    page.wait_for("""document.querySelector('[data-key=" "]').ariaPressed == "false" """)
    page.key("?")
    page.wait_for("keys.open")
    listed = page.evaluate(
        """[...document.querySelectorAll("#keys td:first-child")]
        .flatMap(td => td.textContent.trim().split(" "))"""
    )
    names = {"←": "ArrowLeft", "→": "ArrowRight", "Space": " ", "−": "-", "Esc": "Escape"}
    actions = page.evaluate("Object.keys(actions)")
    assert sorted(names.get(k, k) for k in listed) == sorted(actions), (listed, actions)
    # the buttons do the same; the canvas is what a screen reader reads, with the cursor's values
    page.evaluate("""keys.close(); document.querySelector('[data-key="n"]').click()""")
    near(page, "cursor", 1)
    for text in ("at 1.000", "predicted 0.50"):
        page.wait_for(f"canvasIn('stage').ariaLabel.includes('{text}')")
    page.wait_for("""spoken.textContent.includes("force 0.00")""")
    says(page)


def pointers(browser):
    """Drag, wheel, select, scrub, and two fingers."""
    page = shown(browser)
    box = page.evaluate(
        """(() => { const {left, top} = canvasIn("stage").getBoundingClientRect();
        const row = rows.find(row => row.kind == "panel");
        return [left + LEFT, plotWidth, top + row.top + row.legend + 40, top + 10]; })()"""
    )
    left, width, y, axis = box
    at = lambda x: left + x / 10 * width  # noqa: E731
    page.mouse("mousePressed", at(4), axis)
    page.mouse("mouseReleased", at(4), axis)
    near(page, "cursor", page.evaluate(f"toX({at(4)} - {left} + LEFT)"))
    page.drag(at(2), y, at(4), y, modifiers=8)
    page.wait_for("command.textContent.includes('--range 2.0000s..4.0000s')")
    page.evaluate("setView(4, 6)")
    near(page, "view", 4, 6)
    page.drag(left + width / 2, y, left + width, y)
    near(page, "view", 3, 5)
    there = f"toX({round(at(3))} - {left} + LEFT)"
    before = page.evaluate(there)
    page.mouse("mouseWheel", round(at(3)), round(y), deltaX=0, deltaY=-200)
    page.wait_for("view.to - view.from < 2")
    assert abs(page.evaluate(there) - before) < 1e-9, there
    page.evaluate("setView(0, 10)")
    for kind, places in (
        ("touchStart", [(at(4), y)]),
        ("touchStart", [(at(4), y), (at(6), y)]),
        ("touchMove", [(at(3), y), (at(7), y)]),
        ("touchMove", [(at(1), y), (at(9), y)]),
        ("touchEnd", []),
    ):
        points = [{"x": x, "y": up, "id": i} for i, (x, up) in enumerate(places)]
        page.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    # what was under the fingers still is: 4 s at a tenth of the width, 6 s at nine
    page.wait_for("Math.abs(view.from - 3.75) < 0.02 && Math.abs(view.to - 6.25) < 0.02")
    says(page)


def looks(browser):
    """No sideways scroll, texts that can be read, colours that tell apart, nothing from outside."""
    backgrounds = []
    for scheme in ("light", "dark"):
        for width in (390, 1280):
            page = browser.page()
            page.media(prefers_color_scheme=scheme)
            page.resize(width)
            page.open(assembled(DOCUMENT))
            drawn(page)
            inner, scroll, small, font, resources, images = page.evaluate(
                """[innerWidth, document.documentElement.scrollWidth,
                [...document.querySelectorAll("body *")].filter(e => e.innerText?.trim() &&
                    parseFloat(getComputedStyle(e).fontSize) < 16).map(e => e.outerHTML),
                parseFloat(document.querySelector("#stage canvas").getContext("2d").font),
                performance.getEntriesByType("resource").map(e => e.name),
                document.images.length]"""
            )
            assert inner == width and scroll <= width, (width, inner, scroll)
            assert not small and font >= 12 and not images, (small, font, images)
            assert not resources, resources
            assert page.evaluate("document.title") == DOCUMENT["head"]["title"] + " · incise"
            assert page.evaluate("table.rows[1].cells[0].textContent") == "<i>depth</i>"
            contrasts = page.evaluate(
                """(() => { const g = document.createElement("canvas").getContext("2d");
                const light = colour => { g.fillStyle = colour; g.fillRect(0, 0, 1, 1);
                    return [...g.getImageData(0, 0, 1, 1).data].slice(0, 3).map(v => v / 255)
                    .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
                    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0); };
                const against = (a, b) => (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
                const page = light(colours.page);
                return {tracks: colours.tracks.map(c => against(light(c), page)),
                    texts: ["ink", "soft", "mark", "bad"]
                        .map(c => against(light(colours[c]), page))};
                })()"""
            )
            # WCAG 2: 3 for graphics, 4.5 for texts
            assert min(contrasts["tracks"]) >= 3 and min(contrasts["texts"]) >= 4.5, contrasts
            backgrounds.append(page.evaluate("getComputedStyle(document.body).backgroundColor"))
            says(page)
            page.close()
    assert len(set(backgrounds)) == 2, backgrounds


def bare(browser):
    """A head with nothing but what it must have; a part without numbers; a model's axis."""
    head = {"kind": "model", "title": "m.fis", "version": "1", "from": 0, "to": 4, "cuts": []}
    head |= {"axis": {"label": "depth", "unit": "mm"}, "tracks": [{"label": "force"}]}
    head |= {"panels": [{"label": "force", "tracks": [0]}], "frames": None}
    part = {"from": 0, "to": 4, "tracks": [{"x": [], "y": []}]}
    page = shown(browser, {"head": head, "part": part})
    page.key("ArrowRight")
    near(page, "cursor", 0.02)
    for key in ("n", "p", ",", ".", "+", "-", "0", "[", "]", "z", "Escape"):
        page.key(key)
    near(page, "cursor", 0.02)
    assert page.evaluate("document.getElementById('export').hidden")
    says(page)


def opened(browser, fragment="#t0ken.c0ntrol", fakes="", **media):
    """A live page whose socket is the test's."""
    page = browser.page()
    page.resize(1280)
    if media:
        page.media(**media)
    page.before(FAKE + fakes)
    page.open(assembled() + fragment)
    return page


LIVE = """
window.pour = (from, n, step) => { // n messages of ten samples
	for (let i = 0; i < n; i++) {
		const t = Array.from({length: 10}, (_, k) => from + (10 * i + k) * step);
		sockets.at(-1).say({live: {t, tracks: [0, 1, 2, 3].map(p => t.map(x => Math.sin(x + p)))}});
	}
};
"""


def start_live(page):
    page.wait_for("sockets.length")
    page.evaluate(LIVE)
    page.evaluate("sockets.at(-1).open()")
    page.evaluate(f"sockets.at(-1).say({{head: {json.dumps(LIVE_HEAD)}}})")


def token(browser):
    """The token goes from the address into the session, and out of it when it is refused."""
    page = opened(browser)
    page.wait_for("sockets.length")
    assert page.evaluate("location.href").endswith("page.html")
    assert "t0ken" not in page.evaluate("document.documentElement.outerHTML")
    page.evaluate("sockets[0].open()")
    assert page.evaluate("sockets[0].sent") == [{"token": "t0ken", "control": "c0ntrol"}]
    page.call("Page.reload")
    page.wait_for("sockets.length == 1 && !sockets[0].sent.length")
    page.evaluate("sockets[0].open()")
    assert page.evaluate("sockets[0].sent")[0]["token"] == "t0ken"
    page.evaluate("""sockets[0].say({error: "wrong token"}); sockets[0].drop(1008)""")
    assert page.evaluate("[said.textContent, state.textContent]") == ["wrong token", "▲ refused"]
    assert page.evaluate("[delays.length, sessionStorage.length]") == [0, 0]
    page.call("Page.reload")
    page.wait_for("state.textContent.includes('no token')")
    assert page.evaluate("sockets.length") == 0
    says(page)


def reconnect(browser):
    """0.5, 1, 2, 4, 4 s, from the start again after a head; cursor and samples stay, with a gap."""
    page = opened(browser)
    start_live(page)
    page.evaluate("pour(1000, 100, 0.001)")
    drawn(page)
    for tries in range(1, 6):
        page.evaluate("sockets.at(-1).drop(1006)")
        page.wait_for(f"sockets.length == {tries + 1}")
        page.wait_for("state.textContent.includes('no connection')")
    assert page.evaluate("delays") == [500, 1000, 2000, 4000, 4000]
    start_live(page)
    page.wait_for("state.textContent.includes('live')")
    page.evaluate("pour(1002, 100, 0.001)")
    assert page.evaluate("series[0].count") == 2005
    gap = page.evaluate("[...series[0].low.slice(1000, 1005)].filter(v => v === v).length")
    assert gap == 0, gap
    page.evaluate("sockets.at(-1).drop(1006)")
    assert page.evaluate("delays.at(-1)") == 500
    says(page)


def stream(browser):
    """A live page rolls, freezes, shows pictures and states, and sends what its controls say."""
    page = opened(browser)
    start_live(page)
    now = page.evaluate("Date.now() / 1000")
    page.evaluate(f"pour({now} - 1, 100, 0.001)")
    drawn(page)
    last = now - 1 + 0.999
    near(page, "view", last - 10, last)
    assert page.evaluate("document.body.dataset.mode") == "live"
    assert 0 <= float(page.evaluate("document.body.dataset.behind")) < 600_000
    page.evaluate(f"pour({now}, 10, 0.001)")
    near(page, "view", now + 0.099 - 10, now + 0.099)
    page.key(" ")
    near(page, "cursor", now + 0.099)
    page.evaluate(f"pour({now} + 0.1, 10, 0.001)")
    drawn(page)
    near(page, "view", now + 0.099 - 10, now + 0.099)
    page.key(" ")
    near(page, "view", now + 0.199 - 10, now + 0.199)
    # whatever moves the cursor freezes as well
    page.key("ArrowLeft")
    near(page, "cursor", now + 0.199 - 10 / 200)
    page.evaluate(f"pour({now} + 0.2, 10, 0.001)")
    drawn(page)
    near(page, "view", now + 0.199 - 10, now + 0.199)
    page.key(" ")
    near(page, "view", now + 0.299 - 10, now + 0.299)
    # a track that a message leaves out stays as it was; events come with their marks
    counts = page.evaluate(
        f"""sockets.at(-1).say({{live: {{t: [{now} + 1], tracks: [[1], null, [], [null]]}}}}),
        sockets.at(-1).say({{event: [{now}, "marker", "here"]}}), series.map(s => s.count)"""
    )
    assert counts == [1301, 1300, 1300, 1301], counts
    assert page.evaluate("head.events.length") == 1
    page.evaluate(
        """(() => { const frame = new ArrayBuffer(24 + 6), view = new DataView(frame);
        [0, 2, 1, 3].forEach((v, i) => view.setUint32(4 * i, v, true));
        view.setFloat64(16, 5, true);
        new Uint8Array(frame, 24).set([255, 0, 0, 0, 0, 255]);
        sockets.at(-1).say(frame);
        const short = frame.slice(0, 29); // one byte is missing: not shown
        sockets.at(-1).say(short); })()"""
    )
    page.wait_for("!camera.hidden")
    seen = page.evaluate(
        """[...canvasIn("camera").getContext("2d").getImageData(0, 0, 2, 1).data]"""
    )
    assert seen == [255, 0, 0, 255, 0, 0, 255, 255], seen
    page.evaluate(
        """sockets.at(-1).say({state: {word: "stopped", well: false, text: "a limit",
        tool: "handle", warnings: ["<b>late</b>"], lost: 3, rate_hz: 1000, capture: "trial3",
        late: {edges_us: [1, 10, 100, 1000], counts: [5, 4, 3, 1]},
        pose: {position_mm: [1, 2, 3], quaternion: [1, 0, 0, 0]}}})"""
    )
    assert page.evaluate("state.textContent + state.className") == "▲ stoppedill"
    shown_facts = page.evaluate(
        "facts.innerText + warnings.innerText + late.innerText + tool.value"
    )
    for text in ("handle", "trial3", "1.00 2.00 3.00 mm", "<b>late</b>", "13 ticks, 1 over"):
        assert text in " ".join(shown_facts.split()), (text, shown_facts)
    page.evaluate(
        """(() => { const find = what => document.querySelector(`#control ${what}`);
        find("[name=text]").value = "tap"; find("[data-do=mark]").click();
        find("[name=name]").value = "trial4"; find("[data-do=capture]").click();
        find("[data-do=stop]").click();
        tool.value = "blade"; tool.dispatchEvent(new Event("change")); })()"""
    )
    assert page.evaluate("sockets.at(-1).sent.slice(1).map(({id, ...order}) => order)") == [
        {"do": "mark", "text": "tap"},
        {"do": "capture", "name": "trial4"},
        {"do": "stop"},
        {"do": "tool", "tool": "blade"},
    ]
    page.evaluate("""sockets.at(-1).say({id: 9, error: "no such tool"})""")
    assert page.evaluate("said.textContent + said.className") == "no such toolill"
    says(page)


def still(browser):
    """Where motion is to be reduced, the live window stands while it fills."""
    page = opened(browser, prefers_reduced_motion="reduce")
    start_live(page)
    page.evaluate("pour(1001, 100, 0.001)")
    drawn(page)
    near(page, "view", 1000, 1010)
    page.evaluate("pour(1002, 800, 0.001)")
    page.wait_for("newest() > 1009.9")
    drawn(page)
    near(page, "view", 1000, 1010)
    page.evaluate("pour(1010.5, 1, 0.001)")
    near(page, "view", 1010, 1020)
    says(page)


def requests(browser):
    """One request for data is on the way; the newest wish follows; progress asks again."""
    page = opened(browser)
    page.wait_for("sockets.length")
    page.evaluate("sockets[0].open()")
    head = {**DOCUMENT["head"], "frames": {"shown": True}}
    page.evaluate(f"sockets[0].say({{head: {json.dumps(head)}}})")
    page.evaluate("window.gets = () => sockets[0].sent.filter(m => m.get)")
    page.evaluate("window.frameAsks = () => sockets[0].sent.filter(m => m.frame !== undefined)")
    page.wait_for("gets().length == 1")
    first = page.evaluate("gets()[0].get")
    assert first["from"] == 0 and first["to"] == 10 and 1 <= first["columns"] <= 4000, first
    for view in ("4, 6", "5, 6", "5.2, 5.6"):
        page.evaluate(f"setView({view})")
    assert page.evaluate("gets().length") == 1
    answer = f"part: {json.dumps(DOCUMENT['part'])}"
    page.evaluate(f"sockets[0].say({{id: gets().at(-1).id, {answer}}})")
    page.wait_for("gets().length == 2")
    wish = page.evaluate("gets()[1].get")
    assert abs(wish["from"] - 5) < 1e-9 and abs(wish["to"] - 5.8) < 1e-9, wish
    page.evaluate("""sockets[0].say({id: gets().at(-1).id, error: "gone"})""")
    assert page.evaluate("gets().length") == 2
    page.evaluate("sockets[0].say({progress: 0.5})")
    page.wait_for("gets().length == 3")
    assert page.evaluate("[progress.hidden, progress.value]") == [False, 0.5]
    # frames likewise: the first place, then the last one that was wanted
    assert page.evaluate("frameAsks().map(m => m.frame)") == [1]
    for x in (5.3, 5.4, 5.5):
        page.evaluate(f"moveCursor({x})")
    page.evaluate(
        """(() => { const frame = new ArrayBuffer(25), view = new DataView(frame);
        [frameAsks()[0].id, 1, 1, 1].forEach((v, i) => view.setUint32(4 * i, v, true));
        view.setFloat64(16, 1.02, true); sockets[0].say(frame); })()"""
    )
    page.wait_for("frameAsks().length == 2")
    assert page.evaluate("frameAsks()[1].frame") == 5.5
    page.wait_for("camera.innerText.includes('1.02')")
    says(page)


def memory(browser):
    """100 000 live messages leave the heap as it was after 20 000."""
    page = opened(browser)
    start_live(page)
    heaps = []
    for part in range(10):
        page.evaluate(f"pour(1000 + {part} * 100, 10000, 0.001)")
        page.evaluate(
            """for (let i = 0; i < 200; i++) sockets.at(-1).say({
            event: [newest(), "marker", "m" + i], state: {word: "running", lost: i,
            pose: {position_mm: [i, i, i], quaternion: [1, 0, 0, 0]}}})"""
        )
        drawn(page)
        heaps.append(page.heap())
    assert page.evaluate("series[0].count") == page.evaluate("RING_SLOTS")
    assert page.evaluate("head.events.length") == page.evaluate("EVENTS_KEPT")
    # events, which are kept up to a number, are full after the fifth part
    print("heap in kB:", *(heap // 1000 for heap in heaps))
    assert max(heaps[6:]) - min(heaps[5:7]) < 500_000, heaps
    says(page)


class Server:
    """incise serve with a page at a free port; the address with its tokens is in self.url. One in
    the folder of one before has the same tokens and port."""

    def __init__(self, *arguments, folder=None):
        self.folder = folder = folder or pathlib.Path(tempfile.mkdtemp(prefix="serve-", dir="."))
        self.log = folder / "log"
        self.process = subprocess.Popen(
            ["incise", "serve", *arguments, "--http", "0", "--url", folder / "url", "--overwrite"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self.log.open("w"),
        )
        end = time.monotonic() + LIMIT_S
        while not (folder / "url").exists() or not (folder / "url").read_text().endswith("\n"):
            assert self.process.poll() is None, self.log.read_text()
            assert time.monotonic() < end, "no address"
            time.sleep(0.02)
        self.url = (folder / "url").read_text().strip()
        self.port = int(self.url.split("/")[2].split(":")[1])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(LIMIT_S)


def visiting(browser, url):
    page = browser.page()
    page.resize(1280)
    page.call("Page.bringToFront")  # a tab behind others draws nothing
    page.open(url)
    drawn(page)
    return page


def mailed(browser):
    """incise plot c.rec -o page.html: a picture, frames and the command, without a network."""
    page = browser.page()
    page.resize(1280)
    page.open(pathlib.Path("page.html").resolve().as_uri())
    drawn(page)
    page.evaluate(COLOURED)
    assert page.evaluate("document.body.dataset.mode") == "recording"
    assert page.evaluate("performance.getEntriesByType('resource').length") == 0
    assert page.evaluate("link.socket") is None
    middle = "(view.from + view.to) / 2"
    assert page.evaluate(f"coloured(0, {middle}, 0).length")
    page.wait_for("frames.length > 1 && !camera.hidden")
    page.evaluate("setView(view.from, view.to / 2)")
    page.wait_for("command.textContent.includes(` --range ${view.from.toFixed(4)}s..`)")
    says(page)


def served(browser):
    """A served recording: the whole, a part of its own for a view, frames at the cursor."""
    with Server("c.rec") as server:
        page = visiting(browser, server.url)
        assert page.evaluate("location.href") == f"http://127.0.0.1:{server.port}/"
        page.evaluate(COLOURED)
        assert page.evaluate("document.body.dataset.mode") == "recording"
        page.wait_for("progress.hidden && part.from == head.from && part.to == head.to")
        assert page.evaluate("coloured(0, (view.from + view.to) / 2, 0).length")
        page.wait_for("!camera.hidden")
        first = page.evaluate("camera.innerText")
        page.key("End")
        page.wait_for(f"camera.innerText != {json.dumps(first)}")
        page.evaluate("setView(1, 1.5)")
        page.wait_for("part.from > 0.5 && part.to < 2 && series === part.series")
        page.wait_for("coloured(0, 1.25, 0).length")
        says(page)
        stranger = browser.page()
        stranger.open(server.url.split("#")[0] + "#" + "0" * 32)
        stranger.wait_for("state.textContent.includes('refused')")
        assert stranger.evaluate("sessionStorage.length") == 0


def tabs(browser):
    """Two tabs of a live rig, one with control, which marks an event; both outlive the server."""
    # a force channel whose zero is known records from the first sample on, wherever the blade is
    pathlib.Path("zero.conf").write_text("force_zero_mV = 180.0;\n")
    rig = ("--rig", "sim:", "--calibration", "zero.conf", "--control")
    with Server(*rig) as server:
        seer = re.sub(r"(#[0-9a-f]+).*", r"\1", server.url)  # without the second token
        both = [visiting(browser, server.url), visiting(browser, seer)]
        for page in both:
            page.call("Page.bringToFront")
            drawn(page)
            page.wait_for("state.textContent.includes('running') && document.body.dataset.behind")
            seen = page.evaluate("newest()")
            page.wait_for(f"newest() > {seen} + 0.2")
        assert both[0].evaluate("control.hidden") is False
        assert both[1].evaluate("control.hidden") is True
        order = """(does, name, value) => {
            const find = what => document.querySelector(`#control ${what}`);
            if (name) find(`[name=${name}]`).value = value;
            find(`[data-do=${does}]`).click(); }"""
        both[0].evaluate(f"({order})('mark', 'text', 'early')")
        both[0].wait_for("said.className == 'ill'")  # nothing is recorded yet
        both[0].evaluate(f"({order})('capture', 'name', 'trial')")
        for page in both:
            page.wait_for("facts.innerText.includes('trial')")
        both[0].evaluate(f"({order})('mark', 'text', 'tap')")
        both[0].wait_for("said.className == '' && said.textContent.includes('tap')")
        started = both[0].evaluate("newest()")
        both[0].wait_for(f"newest() > {started} + 1")
        both[0].evaluate(f"({order})('stop')")
        both[0].wait_for("said.textContent.includes('wrote trial.rec')")
        assert pathlib.Path("trial.rec").is_dir()
        for page in both:
            page.wait_for("!facts.innerText.includes('trial')")
    last = [page.evaluate("newest()") for page in both]
    for page in both:
        page.wait_for("state.textContent.includes('no connection')")
    with Server(*rig, folder=server.folder) as again:
        assert again.url == server.url
        for page, seen in zip(both, last):
            page.call("Page.bringToFront")
            page.wait_for("state.textContent.includes('running')")
            page.wait_for(f"newest() > {seen} + 0.2")
    for page in both:
        says(page)


if __name__ == "__main__":
    with Chromium() as chromium:
        for name in sys.argv[1:]:
            try:
                globals()[name](chromium)
            except BaseException:
                print(f"{name}:", file=sys.stderr)
                raise
