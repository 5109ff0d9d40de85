// SPDX-License-Identifier: GPL-2.0-or-later
// The viewer: panels over one x axis. A document in the page is shown without a network; without
// one, incise serve answers by WebSocket: parts of a recording, or a rig or loop live.
//
//	document or part ──► series ──┐
//	live message ──► ring ────────┴─► reduce: min and max a pixel ──► drawData (canvas "data")
//	pointer, keys, buttons ──► view, cursor, span ──────────────────► drawOver (canvas "over")
//
// A series is x, low, high and, where known, u (standard uncertainty) in typed arrays of which
// `count` from `start` on hold something; NaN is a gap. A ring is a series that wraps around.
// x is in the head's unit: seconds, or UTC seconds when live.
"use strict";

const $ = id => document.getElementById(id);
const RING_SLOTS = 1 << 17;
const WINDOWS_S = [5, 10, 30, 60];
const NEAR_S = 60 / (0.9 * RING_SLOTS); // samples closer than this share a slot: no rate overflows
const RETRY_MS = [500, 1000, 2000, 4000];
const TRAIL = 512; // places of the live pose from above
const EVENTS_KEPT = 1000;
const LISTED = 200; // cuts and events in the list
const LEFT = 62, RIGHT = 12; // of the plots, CSS pixels
const STEPS = 200; // of the cursor across the view

let head = null;
let live = false;
let series = []; // one a track: the newest part, or rings
let part = null, whole = null; // parts: the newest, and one of the whole axis
let frames = []; // of a document: [t, image]
const view = {from: 0, to: 1};
let cursor = null, hover = null, span = null;
let playing = false; // the cursor runs, or the live window rolls
let selecting = false;
let windowS = 10;
let trail = null;
let status = {};
let rows = [], height = 0, colours = {}, pixels = 1;
let dirty = {data: true, over: true}, asleep = true, playedAt = 0;
const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");
const clamp = (v, low, high) => Math.max(low, Math.min(high, v));

// ---- series -------------------------------------------------------------------------------

const numbers = list => Float64Array.from(list, v => v ?? NaN);

function readPart(message) {
	const centres = new Map(); // of columns, shared by the tracks that have as many
	const {from, to} = message;
	return {from, to, series: message.tracks.map(track => {
		const low = numbers(track.low ?? track.y);
		const count = low.length;
		if (!track.x && !centres.has(count))
			centres.set(count, low.map((_, i) => from + (to - from) * (i + 0.5) / count));
		return {x: track.x ? numbers(track.x) : centres.get(count), low, start: 0, count, mask: -1,
			high: track.high ? numbers(track.high) : low, u: track.u ? numbers(track.u) : null,
			columns: !track.x};
	})};
}

function newRing(slots) {
	return {x: new Float64Array(slots), low: new Float32Array(slots), high: new Float32Array(slots),
		u: null, start: 0, count: 0, mask: slots - 1};
}

function push(ring, x, v) {
	const last = ring.start + ring.count - 1 & ring.mask;
	if (ring.count) {
		const since = x - ring.x[last];
		if (since < -1) // the clock was set back
			ring.start = ring.count = 0;
		else if (since < 0)
			return;
		else if (since < NEAR_S && v === v && ring.low[last] === ring.low[last]) {
			ring.low[last] = Math.min(ring.low[last], v);
			ring.high[last] = Math.max(ring.high[last], v);
			return;
		}
	}
	if (ring.count === ring.mask + 1)
		ring.start = ring.start + 1 & ring.mask;
	else
		ring.count++;
	const k = ring.start + ring.count - 1 & ring.mask;
	ring.x[k] = x;
	ring.low[k] = ring.high[k] = v;
}

// The number of samples before x.
function countBefore(s, x) {
	let a = 0, b = s.count;
	while (a < b) {
		const i = a + b >> 1;
		if (s.x[s.start + i & s.mask] < x)
			a = i + 1;
		else
			b = i;
	}
	return a;
}

function newestX(s) {
	return s.count ? s.x[s.start + s.count - 1 & s.mask] : -Infinity;
}

// The place of the sample nearest to x, or -1 outside the series.
function nearest(s, x) {
	if (!s.count)
		return -1;
	const first = s.x[s.start & s.mask], last = newestX(s);
	const spacing = s.count > 1 ? (last - first) / (s.count - 1) : 0;
	if (!(x >= first - spacing && x <= last + spacing))
		return -1;
	const i = clamp(countBefore(s, x), 1, s.count - 1 || 1);
	const a = s.start + i - 1 & s.mask, b = s.start + Math.min(i, s.count - 1) & s.mask;
	return x - s.x[a] <= s.x[b] - x ? a : b;
}

// The visible samples as at most one entry a device pixel, in s.seen; one more on either side
// leads the line out of the picture.
function reduce(s, columns) {
	if (!s.seen || s.seen.px.length < columns + 4) {
		const entries = () => new Float64Array(columns + 4);
		s.seen = {px: entries(), low: entries(), high: entries(), u: entries(), n: 0, samples: 0};
	}
	const {px, low, high, u} = s.seen;
	const scale = columns / (view.to - view.from);
	let n = 0, column = -2, i = Math.max(0, countBefore(s, view.from) - 1);
	const first = i;
	for (; i < s.count; i++) {
		const k = s.start + i & s.mask;
		const at = (s.x[k] - view.from) * scale;
		const here = at < 0 ? -1 : Math.min(columns, Math.floor(at));
		if (here !== column) {
			column = here;
			px[n] = at;
			low[n] = high[n] = u[n] = NaN;
			n++;
		}
		const e = n - 1;
		if (s.low[k] < low[e] || low[e] !== low[e])
			low[e] = s.low[k];
		if (s.high[k] > high[e] || high[e] !== high[e])
			high[e] = s.high[k];
		if (s.u && (s.u[k] > u[e] || u[e] !== u[e]))
			u[e] = s.u[k];
		if (here === columns)
			break;
	}
	s.seen.n = n;
	s.seen.samples = i - first;
	return s.seen;
}

// ---- numbers as text ----------------------------------------------------------------------

// A step of 1, 2 or 5 times a power of ten that is not below `least`.
function niceStep(least) {
	const power = 10 ** Math.floor(Math.log10(least));
	return power * ([1, 2, 5].find(m => m * power >= least * (1 - 1e-9)) ?? 10);
}

const decimalsOf = step => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));

function fixed(v, decimals) {
	if (v !== v || v === null || v === undefined)
		return "–";
	const text = Math.abs(v) >= 1e6 || decimals > 6 ? v.toExponential(3) : v.toFixed(decimals);
	return text.replace(/^-(?=0\.?0*$)/, "").replace("-", "−");
}

const clock = x => new Date(1000 * x).toTimeString().slice(0, 8) +
	"." + String(Math.floor(1000 * x) % 1000).padStart(3, "0");

// A place on the x axis for people: to a pixel, and as hours where seconds are many.
function place(x) {
	if (live)
		return clock(x);
	const decimals = clamp(decimalsOf(niceStep((view.to - view.from) / 1500)), 0, 6);
	const pad = v => String(Math.floor(v)).padStart(2, "0");
	const text = `${fixed(x, decimals)} ${head.axis.unit ?? ""}`.trim();
	return head.axis.unit === "s" && head.to > 600 ?
		`${text} (${Math.floor(x / 3600)}:${pad(x / 60 % 60)}:${pad(x % 60)})` : text;
}

function valueText(s, x, decimals) {
	const k = nearest(s, x);
	if (k < 0 || s.low[k] !== s.low[k])
		return "–";
	const low = fixed(s.low[k], decimals), high = fixed(s.high[k], decimals);
	const u = s.u && s.u[k] === s.u[k] ? ` ± ${fixed(2 * s.u[k], decimals)}` : "";
	return (low === high ? low : `${low} … ${high}`) + u;
}

// ---- the picture --------------------------------------------------------------------------

function readColours() {
	const style = getComputedStyle(document.documentElement);
	for (const name of ["ink", "soft", "page", "line", "band", "mark", "cut", "good", "bad"])
		colours[name] = style.getPropertyValue("--" + name).trim();
	colours.tracks = style.getPropertyValue("--tracks").trim().split(/\s+/);
	colours.font = style.getPropertyValue("font-family") || "sans-serif";
}

function fitCanvas(canvas, cssWidth, cssHeight) {
	const scale = Math.min(devicePixelRatio || 1, 16000 / Math.max(cssWidth, cssHeight, 1));
	const w = Math.round(cssWidth * scale), h = Math.round(cssHeight * scale);
	if (canvas.width !== w || canvas.height !== h) {
		canvas.width = w;
		canvas.height = h;
		canvas.style.height = cssHeight + "px";
	}
	const g = canvas.getContext("2d");
	g.setTransform(scale, 0, 0, scale, 0, 0);
	g.clearRect(0, 0, cssWidth, cssHeight);
	g.font = `13px ${colours.font}`;
	g.textBaseline = "middle";
	g.lineJoin = g.lineCap = "round";
	return g;
}

// Rows from the top: axis, cuts, events, a lane a member, frames, panels. A panel's legend has a cell
// a track as wide as its longest value, so that nothing moves while values change.
function arrange() {
	const width = $("stage").clientWidth;
	const g = $("over").getContext("2d");
	g.font = `13px ${colours.font}`;
	rows = [];
	height = 0;
	const add = row => {
		rows.push({top: height, ...row});
		height += row.height;
	};
	add({kind: "axis", height: 30});
	if (head.cuts.length)
		add({kind: "cuts", height: 24});
	if (head.events.length || live)
		add({kind: "events", height: 24});
	for (const member of head.members ?? [])
		add({kind: "member", height: 40, member});
	if (frames.length > 1)
		add({kind: "frames", height: 64});
	const panels = head.panels.map(panel => {
		let x = LEFT, lines = 1;
		const title = panel.tracks.length > 1 || !panel.label ? panel.label ?? "" : "";
		const name = title && panel.unit ? `${title} (${panel.unit})` : title;
		if (name)
			x += g.measureText(name).width + 18;
		const cells = panel.tracks.map(track => {
			const label = head.tracks[track].label || panel.label || "";
			const own = name || !panel.unit ? label : `${label} (${panel.unit})`;
			const cell = 22 + g.measureText(own + "  −000.000").width +
				(panel.u || series[track]?.u ? g.measureText(" ± 00.000").width : 0);
			if (x + cell > width - RIGHT && x > LEFT) {
				x = LEFT;
				lines++;
			}
			x += cell;
			return {track, text: own, x: x - cell, line: lines - 1};
		});
		return {kind: "panel", panel, name, cells, legend: 6 + 20 * lines};
	});
	const used = height + panels.reduce((sum, p) => sum + p.legend, 0) + 40;
	const most = live || panels.length < 3 ? 260 : 190;
	const plot = clamp((innerHeight - $("stage").offsetTop - used) / (panels.length || 1) - 14, 110, most);
	for (const panel of panels)
		add({...panel, height: panel.legend + plot + 14, plot});
	height += 4;
	$("stage").style.height = height + "px";
	const w = Math.max(50, width - LEFT - RIGHT);
	pixels = Math.round(w * Math.min(devicePixelRatio || 1, 16000 / height));
	rows.width = w;
	document.body.dataset.columns = pixels;
	dirty.data = dirty.over = true;
}

const toPx = x => LEFT + (x - view.from) / (view.to - view.from) * rows.width;
const toX = px => view.from + (px - LEFT) / rows.width * (view.to - view.from);

function clipPlots(g) {
	g.save();
	g.beginPath();
	g.rect(LEFT, 0, rows.width, height);
	g.clip();
}

function drawAxis(g, row) {
	const step = niceStep((view.to - view.from) * 95 / rows.width);
	const decimals = decimalsOf(step);
	const zero = live ? newest() : 0;
	const ticks = [];
	for (let i = Math.ceil((view.from - zero) / step); i * step + zero <= view.to; i++)
		ticks.push([toPx(i * step + zero), fixed(i * step, decimals)]);
	g.fillStyle = colours.band;
	g.fillRect(LEFT, row.top, rows.width, row.height - 6);
	const {from, to} = limits();
	if (to - from > view.to - view.from) { // the place of the view in the whole
		const scale = rows.width / (to - from);
		g.fillStyle = colours.line;
		g.fillRect(LEFT, row.top + 24, rows.width, 4);
		g.fillStyle = colours.mark;
		g.fillRect(LEFT + (view.from - from) * scale, row.top + 24,
			Math.max(4, (view.to - view.from) * scale), 4);
	}
	g.fillStyle = colours.soft;
	g.textAlign = "right";
	g.fillText(live ? "s ago" : head.axis.unit || head.axis.label, LEFT - 8, row.top + 12);
	for (const [px, text] of ticks) {
		const half = g.measureText(text).width / 2;
		g.textAlign = "center";
		g.fillText(text, clamp(px, LEFT + half + 2, LEFT + rows.width - half - 2), row.top + 12);
		g.fillRect(px - 0.5, row.top, 1, 4);
	}
	return ticks;
}

// Cuts and events that would stand closer than a label leave their labels out.
function drawMarks(g, row) {
	let free = -Infinity;
	g.textAlign = "center";
	if (row.kind === "cuts")
		for (const [from, to, label] of head.cuts) {
			if (to < view.from || from > view.to)
				continue;
			const a = Math.max(LEFT, toPx(from)), b = Math.min(LEFT + rows.width, toPx(to));
			g.fillStyle = colours.mark;
			g.fillRect(a, row.top + 18, Math.max(1, b - a), 3);
			const half = g.measureText(label).width / 2 + 3, middle = (a + b) / 2;
			if (middle - half > free) {
				g.fillText(label, middle, row.top + 9);
				free = middle + half;
			}
		}
	else
		for (const [x] of head.events)
			if (x >= view.from && x <= view.to && toPx(x) > free + 1) {
				g.fillStyle = colours.bad;
				g.beginPath();
				g.moveTo(toPx(x) - 6, row.top + 4);
				g.lineTo(toPx(x) + 6, row.top + 4);
				g.lineTo(toPx(x), row.top + 17);
				g.fill();
				free = toPx(x);
			}
}

function drawMember(g, row) {
	const {label, from, to, text} = row.member;
	const a = Math.max(LEFT, toPx(from)), b = Math.min(LEFT + rows.width, toPx(to));
	g.fillStyle = colours.line;
	if (b > a)
		g.fillRect(a, row.top + 24, b - a, 8);
	g.fillStyle = colours.ink;
	g.textAlign = "left";
	g.fillText(text ? `${label}: ${text}` : label, LEFT + 4, row.top + 11, rows.width - 8);
}

function drawFrames(g, row) {
	let right = LEFT - 1;
	for (const [t, image] of frames) {
		if (!image.complete || !image.naturalWidth || t < view.from || t > view.to)
			continue;
		const h = row.height - 8, w = h * image.naturalWidth / image.naturalHeight;
		const x = clamp(toPx(t) - w / 2, LEFT, LEFT + rows.width - w);
		if (x <= right)
			continue;
		g.drawImage(image, x, row.top + 4, w, h);
		right = x + w + 2;
	}
}

// The panel's range: what is seen with its band, out to whole steps.
function scalePanel(row, seen) {
	let low = Infinity, high = -Infinity;
	for (const e of seen)
		for (let i = 0; i < e.n; i++) {
			const band = e.u[i] === e.u[i] ? 2 * e.u[i] : 0;
			if (e.low[i] - band < low)
				low = e.low[i] - band;
			if (e.high[i] + band > high)
				high = e.high[i] + band;
		}
	row.empty = low > high;
	if (row.empty)
		[low, high] = [0, 1];
	if (!(high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high))))
		[low, high] = [low - (Math.abs(low) / 10 || 1), high + (Math.abs(high) / 10 || 1)];
	const step = niceStep((high - low) / Math.max(2, row.plot / 45));
	const y0 = Math.floor(low / step * 2 + 1e-6) / 2 * step;
	const y1 = Math.ceil(high / step * 2 - 1e-6) / 2 * step;
	const base = row.top + row.legend, scale = row.plot / (y1 - y0);
	Object.assign(row, {step, y0, y1, decimals: decimalsOf(step) + 2,
		toY: v => base + (y1 - v) * scale});
}

function drawBand(g, e, left, scale, toY) {
	for (let i = 0; i < e.n;) {
		const from = i;
		while (i < e.n && e.u[i] === e.u[i] && e.low[i] === e.low[i])
			i++;
		if (i > from) {
			g.beginPath();
			for (let k = from; k < i; k++)
				g.lineTo(left + e.px[k] * scale, toY(e.high[k] + 2 * e.u[k]));
			for (let k = i - 1; k >= from; k--)
				g.lineTo(left + e.px[k] * scale, toY(e.low[k] - 2 * e.u[k]));
			g.fill();
		}
		i++;
	}
}

function drawTrace(g, e, left, scale, toY, dots) {
	let down = false;
	g.beginPath();
	for (let i = 0; i < e.n; i++) {
		if (e.low[i] !== e.low[i]) {
			down = false;
			continue;
		}
		const x = left + e.px[i] * scale, y = toY(e.low[i]);
		if (!down)
			g.moveTo(x, y);
		g.lineTo(x, y);
		g.lineTo(x, toY(e.high[i]));
		down = true;
	}
	g.stroke();
	if (dots)
		for (let i = 0; i < e.n; i++)
			if (e.low[i] === e.low[i]) {
				g.beginPath();
				g.arc(left + e.px[i] * scale, toY(e.low[i]), 2.5, 0, 7);
				g.fill();
			}
}

function drawPanel(g, row) {
	const shown = row.cells.map(cell => series[cell.track]).filter(Boolean);
	const seen = shown.map(s => reduce(s, pixels));
	scalePanel(row, seen);
	g.strokeStyle = colours.line;
	g.lineWidth = 1;
	g.fillStyle = colours.soft;
	g.textAlign = "right";
	const labels = row.decimals - 2;
	for (let i = Math.ceil(row.y0 / row.step); i * row.step <= row.y1 * (1 + 1e-9) + 1e-12; i++) {
		const y = row.toY(i * row.step);
		g.beginPath();
		g.moveTo(LEFT, Math.round(y) + 0.5);
		g.lineTo(LEFT + rows.width, Math.round(y) + 0.5);
		g.stroke();
		g.fillText(fixed(i * row.step, labels), LEFT - 8, y);
	}
	g.save();
	g.beginPath();
	g.rect(LEFT, row.top + row.legend - 3, rows.width, row.plot + 6);
	g.clip();
	const scale = rows.width / pixels;
	seen.forEach((e, i) => {
		g.strokeStyle = g.fillStyle = colours.tracks[i % colours.tracks.length];
		if (shown[i].u) {
			g.globalAlpha = 0.22;
			drawBand(g, e, LEFT, scale, row.toY);
			g.globalAlpha = 1;
		}
		g.lineWidth = 1.6;
		drawTrace(g, e, LEFT, scale, row.toY, e.samples < rows.width / 12);
	});
	g.restore();
	if (row.empty) {
		g.fillStyle = colours.soft;
		g.textAlign = "center";
		g.fillText("no data here", LEFT + rows.width / 2, row.top + row.legend + row.plot / 2);
	}
}

function drawData() {
	const g = fitCanvas($("data"), LEFT + rows.width + RIGHT, height);
	const ticks = drawAxis(g, rows[0]);
	const body = rows.find(row => row.kind === "panel");
	if (body) {
		clipPlots(g);
		g.fillStyle = colours.line;
		for (const [px] of ticks)
			g.fillRect(Math.round(px), body.top + body.legend, 1, height - body.top - body.legend - 16);
		g.fillStyle = colours.cut;
		for (const [from, to] of head.cuts)
			if (to >= view.from && from <= view.to)
				g.fillRect(toPx(from), body.top, Math.max(1, toPx(to) - toPx(from)), height - body.top - 4);
		g.restore();
	}
	for (const row of rows)
		if (row.kind === "panel")
			drawPanel(g, row);
		else if (row.kind === "member")
			drawMember(g, row);
		else if (row.kind === "frames")
			drawFrames(g, row);
		else if (row.kind !== "axis")
			drawMarks(g, row);
}

const isFollowing = () => live && playing;
const shownX = () => hover ?? (isFollowing() ? newest() : cursor);

function eventNear(x, px) {
	const reach = px * (view.to - view.from) / rows.width;
	let best = null;
	for (const event of head.events)
		if (Math.abs(event[0] - x) <= reach && (!best || Math.abs(event[0] - x) < Math.abs(best[0] - x)))
			best = event;
	return best;
}

function drawOver() {
	const g = fitCanvas($("over"), LEFT + rows.width + RIGHT, height);
	const x = shownX();
	clipPlots(g);
	if (span) {
		const a = toPx(span[0]), b = toPx(span[1]);
		g.fillStyle = colours.mark;
		g.globalAlpha = 0.16;
		g.fillRect(a, 0, b - a, height);
		g.globalAlpha = 1;
		g.fillRect(a - 1, 0, 2, height);
		g.fillRect(b - 1, 0, 2, height);
	}
	g.fillStyle = colours.ink;
	if (cursor !== null && !isFollowing())
		g.fillRect(toPx(cursor) - 0.75, 0, 1.5, height);
	if (hover !== null) {
		g.globalAlpha = 0.45;
		g.fillRect(toPx(hover) - 0.5, 0, 1, height);
		g.globalAlpha = 1;
	}
	g.restore();
	for (const row of rows)
		if (row.kind === "panel")
			drawLegend(g, row, x);
	if (x === null)
		return;
	const event = eventNear(x, 8), at = rows.find(row => row.kind === "events");
	if (!isFollowing() || hover !== null)
		drawLabel(g, place(x), toPx(x), 12);
	if (event && at && (!isFollowing() || hover !== null))
		drawLabel(g, event[2] ? `${event[1]}: ${event[2]}` : event[1], toPx(event[0]), at.top + 12);
}

function drawLegend(g, row, x) {
	g.textAlign = "left";
	g.fillStyle = colours.ink;
	g.font = `600 13px ${colours.font}`;
	g.fillText(row.name, LEFT, row.top + 12);
	g.font = `13px ${colours.font}`;
	row.cells.forEach((cell, i) => {
		const y = row.top + 12 + 20 * cell.line;
		g.fillStyle = colours.tracks[i % colours.tracks.length];
		g.fillRect(cell.x, y - 2, 14, 4);
		g.fillStyle = colours.ink;
		const s = series[cell.track];
		const value = s && x !== null && row.decimals ? valueText(s, x, row.decimals) : "";
		g.fillText(`${cell.text}  ${value}`, cell.x + 19, y);
	});
}

function drawLabel(g, text, px, y) {
	const w = Math.min(g.measureText(text).width + 12, rows.width);
	const x = clamp(px - w / 2, LEFT, LEFT + rows.width - w);
	g.fillStyle = colours.ink;
	g.fillRect(x, y - 11, w, 22);
	g.fillStyle = colours.page;
	g.textAlign = "center";
	g.fillText(text, x + w / 2, y + 0.5, w - 8);
}

// ---- beside the plots ---------------------------------------------------------------------

// The path from above, x to the right and y up, both to one scale, which a bar shows.
function drawAbove() {
	const p = trail ?? head.path;
	if (!p || !p.count)
		return;
	const canvas = $("above").querySelector("canvas");
	$("above").hidden = false;
	const size = canvas.clientWidth, high = Math.round(size * 0.7);
	const g = fitCanvas(canvas, size, high);
	let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
	for (let i = 0; i < p.count; i++) {
		const k = p.start + i & p.mask;
		[x0, x1] = [Math.min(x0, p.low[k]), Math.max(x1, p.low[k])];
		[y0, y1] = [Math.min(y0, p.high[k]), Math.max(y1, p.high[k])];
	}
	const scale = Math.min((size - 40) / (x1 - x0 || 1e-6), (high - 56) / (y1 - y0 || 1e-6), size / 2);
	const at = k => [size / 2 + (p.low[k] - (x0 + x1) / 2) * scale,
		(high - 24) / 2 - (p.high[k] - (y0 + y1) / 2) * scale];
	const line = (from, to, colour, width) => {
		g.strokeStyle = colour;
		g.lineWidth = width;
		g.beginPath();
		for (let i = from; i < to; i++)
			g.lineTo(...at(p.start + i & p.mask));
		g.stroke();
	};
	line(0, p.count, trail ? colours.tracks[0] : colours.soft, 1.2);
	if (!trail)
		line(countBefore(p, view.from), countBefore(p, view.to), colours.tracks[0], 2);
	const x = trail ? newestX(p) : cursor, k = x === null ? -1 : nearest(p, x);
	g.fillStyle = colours.tracks[1];
	if (k >= 0 && p.low[k] === p.low[k]) {
		g.beginPath();
		g.arc(...at(k), 6, 0, 7);
		g.fill();
	}
	const bar = niceStep(60 / scale);
	g.fillStyle = colours.ink;
	g.fillRect(12, high - 12, bar * scale, 2);
	g.fillText(`${fixed(bar, decimalsOf(bar))} ${head.path?.unit ?? "mm"}`, 18 + bar * scale, high - 12);
	if (!trail)
		$("above").querySelector("figcaption").textContent = "path from above; the dot is at the cursor";
}

// Lateness on a logarithmic axis from 1 µs on, counts logarithmic; the line is the period.
function drawLate({edges_us: edges, counts}) {
	const canvas = $("late").querySelector("canvas");
	$("late").hidden = false;
	const w = canvas.clientWidth, h = 130, deadline = 1e6 / (status.rate_hz || 1000);
	const g = fitCanvas(canvas, w, h);
	const last = Math.max(deadline * 2, edges[edges.length - 1] || 1);
	const px = us => 8 + (w - 16) * Math.log(Math.max(1, us)) / Math.log(last);
	const most = Math.log(1 + Math.max(1, ...counts));
	g.fillStyle = colours.tracks[0];
	counts.forEach((count, i) => {
		const a = px(edges[i] ?? last), b = px(edges[i + 1] ?? last), bar = (h - 46) * Math.log(1 + count) / most;
		if (count)
			g.fillRect(a, h - 24 - bar, Math.max(2, b - a - 1), bar);
	});
	g.fillStyle = colours.soft;
	g.fillRect(8, h - 24, w - 16, 1);
	g.textAlign = "center";
	for (let us = 1; us <= last; us *= 10)
		g.fillText(us < 1000 ? us + " µs" : us / 1000 + " ms", clamp(px(us), 18, w - 22), h - 11);
	g.fillStyle = colours.bad;
	g.fillRect(px(deadline) - 1, 20, 2, h - 44);
	g.textAlign = "right";
	g.fillText("deadline", px(deadline) - 5, 12);
	const total = counts.reduce((sum, count) => sum + count, 0);
	const over = counts.reduce((sum, count, i) => sum + (edges[i] >= deadline ? count : 0), 0);
	canvas.ariaLabel = $("late").querySelector("figcaption").textContent =
		`lateness of ${total} ticks, ${over} at or over the period; both axes logarithmic`;
}

function showFacts(facts) {
	const dl = $("facts");
	while (dl.children.length > 2 * facts.length)
		dl.lastChild.remove();
	facts.forEach(([name, value], i) => { // texts in place: live, nothing is made anew
		if (!dl.children[2 * i])
			dl.append(document.createElement("dt"), document.createElement("dd"));
		setText(dl.children[2 * i], name);
		setText(dl.children[2 * i + 1], value);
	});
}

function setText(element, text) {
	if (element.textContent !== String(text))
		element.textContent = text;
}

function showState(word, well, text) {
	$("state").hidden = false;
	$("state").className = well ? "well" : "ill";
	setText($("symbol"), well ? "●" : "▲");
	setText($("word"), word);
	setText($("text"), text ?? "");
}

function say(text, ill) {
	$("said").className = ill ? "ill" : "";
	setText($("said"), text);
}

function takeStatus(s) {
	Object.assign(status, s);
	showState(status.word ?? "running", status.well ?? true, status.text);
	const facts = [...head.facts ?? []];
	if (status.tool)
		facts.push(["tool", status.tool]);
	if (status.rate_hz)
		facts.push(["rate", `${fixed(status.rate_hz, 0)} Hz`]);
	if (status.lost !== undefined)
		facts.push(["lost", String(status.lost)]);
	if (status.capture)
		facts.push(["capture", status.capture]);
	if (document.body.dataset.behind)
		facts.push(["behind", `${document.body.dataset.behind} ms`]);
	const {position_mm: p, quaternion: q} = status.pose ?? {};
	if (p) {
		facts.push(["position", `${p.map(v => fixed(v, 2)).join("  ")} mm`]);
		if (s.pose) {
			trail ??= newRing(TRAIL);
			push(trail, newest(), p[0]);
			trail.high[trail.start + trail.count - 1 & trail.mask] = p[1];
			setText($("above").querySelector("figcaption"), `tip from above; height ${fixed(p[2], 2)} mm`);
			drawAbove();
		}
	}
	if (q)
		facts.push(["quaternion", q.map(v => fixed(v, 3)).join("  ")]);
	showFacts(facts);
	const warnings = status.warnings ?? [];
	$("warnings").hidden = !warnings.length;
	if ($("warnings").dataset.shown !== warnings.join("\n")) {
		$("warnings").dataset.shown = warnings.join("\n");
		$("warnings").replaceChildren(...warnings.map(text => make("li", text)));
	}
	if (status.tool && document.activeElement !== $("tool"))
		$("tool").value = status.tool;
	if (s.late)
		drawLate(s.late);
	widen();
}

function make(tag, text, more) {
	return Object.assign(document.createElement(tag), {textContent: text ?? "", ...more});
}

function fillTable(table, names, lines) {
	const row = (tag, cells) => {
		const tr = make("tr");
		tr.append(...cells.map(text => make(tag, text)));
		return tr;
	};
	table.replaceChildren(...names ? [row("th", names)] : [], ...lines.map(cells => row("td", cells)));
}

function widen() {
	const beside = ["facts", "camera", "above", "late", "table", "list", "control"];
	const two = beside.some(id => !$(id).hidden && $(id).childElementCount);
	if ($("facts").parentElement.parentElement.classList.toggle("two", two) !== widen.two) {
		widen.two = two;
		arrange();
	}
}

function listPlaces() {
	const lines = [...head.cuts.map(([from, to, label]) => [from, `cut ${label}`, to]),
		...head.events.map(([x, kind, text]) => [x, text ? `${kind}: ${text}` : kind])]
		.sort((a, b) => a[0] - b[0]);
	$("list").hidden = !lines.length;
	$("list").querySelector("summary").textContent = `cuts and events (${lines.length})`;
	$("list").querySelector("ol").replaceChildren(...lines.slice(0, LISTED).map(([x, text, to]) => {
		const li = make("li"), button = make("button", `${place(x)}  ${text}`, {type: "button"});
		button.addEventListener("click", () => to === undefined ? moveCursor(x) : showCut([x, to]));
		li.append(button);
		return li;
	}), ...lines.length > LISTED ? [make("li", `and ${lines.length - LISTED} more`)] : []);
}

// ---- the view -----------------------------------------------------------------------------

const newest = () => series.reduce((x, s) => Math.max(x, newestX(s)), -Infinity);

function limits() {
	if (!live)
		return {from: head.from, to: head.to};
	const to = newest();
	return {from: to - WINDOWS_S[WINDOWS_S.length - 1], to};
}

// The served parts are asked for a view and half of one on either side, so that a pan has data.
function setView(from, to) {
	const all = limits();
	const least = Math.max(1e-6, (all.to - all.from) * 1e-7);
	const width = clamp(to - from, least, all.to - all.from || 1);
	const start = clamp(from + (to - from - width) / 2, all.from, all.to - width);
	view.from = start;
	view.to = start + width;
	dirty.data = dirty.over = true;
	if (!live && link.socket)
		askPart();
	pickPart();
	showExport();
	wake();
}

function zoom(factor, at) {
	if (isFollowing()) {
		const i = WINDOWS_S.indexOf(windowS) + (factor < 1 ? -1 : 1);
		windowS = WINDOWS_S[clamp(i, 0, WINDOWS_S.length - 1)];
		$("window").value = windowS;
		return;
	}
	const centre = at ?? (cursor >= view.from && cursor <= view.to && cursor !== null ?
		cursor : (view.from + view.to) / 2);
	setView(centre - (centre - view.from) * factor, centre + (view.to - centre) * factor);
}

function moveCursor(x) {
	const all = limits();
	freeze();
	hover = null;
	cursor = clamp(x, all.from, all.to);
	const width = view.to - view.from;
	if (cursor < view.from || cursor > view.to)
		setView(cursor - width * (cursor > view.to ? 0.1 : 0.9), cursor + width * (cursor > view.to ? 0.9 : 0.1));
	cursorMoved();
}

function cursorMoved() {
	dirty.over = true;
	speak();
	if (frames.length || head.frames)
		showFrame();
	wake();
}

function freeze() {
	if (live && playing)
		setPlaying(false);
}

function setPlaying(on) {
	playing = on;
	playedAt = performance.now();
	if (live && on)
		cursor = span = null;
	else if (live)
		cursor ??= newest();
	document.querySelector('[data-key=" "]').ariaPressed = String(live ? !on : on);
	dirty.data = dirty.over = true;
	showExport();
	wake();
}

function setSpan(a, b) {
	span = a === null ? null : [Math.min(a, b), Math.max(a, b)];
	dirty.over = true;
	showExport();
	wake();
}

function showCut([from, to]) {
	freeze();
	hover = null;
	setView(from - (to - from) * 0.1, to + (to - from) * 0.1);
	setSpan(from, to);
	cursor = from;
	cursorMoved();
}

function stepCut(way) {
	const at = cursor ?? view.from, {cuts} = head;
	const cut = way > 0 ? cuts.find(c => c[0] > at + 1e-9) : cuts.findLast(c => c[0] < at - 1e-9);
	if (cut)
		showCut(cut);
}

function stepEvent(way) {
	const at = cursor ?? view.from, {events} = head;
	const event = way > 0 ? events.find(e => e[0] > at + 1e-9) : events.findLast(e => e[0] < at - 1e-9);
	if (event)
		moveCursor(event[0]);
}

function showExport() {
	if (!head?.export)
		return;
	const [from, to] = span ?? [view.from, view.to];
	$("export").hidden = false;
	setText($("span"), `${span ? "selected" : "visible"}: ${place(from)} to ${place(to)}`);
	setText($("command"), head.export.replaceAll("{from}", from.toFixed(4)).replaceAll("{to}", to.toFixed(4)));
}

// A page that is not on https or this machine has no clipboard but the selection's.
async function copyCommand() {
	if (!head?.export)
		return;
	try {
		await navigator.clipboard.writeText($("command").textContent);
	} catch {
		getSelection().selectAllChildren($("command"));
		document.execCommand("copy");
	}
	say("copied: " + $("command").textContent);
}

// A screen reader gets the values at most once a second.
function speak() {
	if (speak.timer)
		return;
	speak.timer = setTimeout(() => {
		speak.timer = 0;
		const x = shownX();
		if (x === null || !head)
			return;
		const values = rows.filter(row => row.kind === "panel").flatMap(row => row.cells.map(cell =>
			`${head.tracks[cell.track].label || row.panel.label} ` +
			(series[cell.track] ? valueText(series[cell.track], x, row.decimals ?? 3) : "–") +
			` ${row.panel.unit ?? ""}`));
		const event = eventNear(x, 8);
		$("over").ariaLabel = `${head.title}, ${head.axis.label} ${place(view.from)} to ${place(view.to)}; ` +
			`at ${place(x)}: ${values.join(", ")}${event ? "; " + event[1] + " " + event[2] : ""}`;
		if (!isFollowing())
			setText($("spoken"), `${place(x)}: ${values.join(", ")}`);
	}, speak.said ? 1000 : 0);
	speak.said = true;
}

// ---- frames -------------------------------------------------------------------------------

function showFrame() {
	if (!frames.length) {
		link.frameWanted = cursor;
		askFrame();
		return;
	}
	const best = frames.reduce((a, b) => Math.abs(b[0] - cursor) < Math.abs(a[0] - cursor) ? b : a);
	const img = $("camera").querySelector("img");
	$("camera").hidden = img.hidden = false;
	$("camera").querySelector("canvas").hidden = true;
	if (img.src !== best[1].src)
		img.src = best[1].src;
	setText($("camera").querySelector("figcaption"), `frame at ${place(best[0])}`);
}

function drawFrame({width, height: lines, channels, t, bytes}) {
	const canvas = $("camera").querySelector("canvas");
	$("camera").hidden = canvas.hidden = false;
	if (canvas.width !== width || canvas.height !== lines || !drawFrame.image) {
		canvas.width = width;
		canvas.height = lines;
		drawFrame.image = new ImageData(width, lines);
		drawFrame.image.data.fill(255);
	}
	const out = drawFrame.image.data, green = channels === 3 ? 1 : 0, blue = 2 * green;
	for (let i = 0, k = 0; k < out.length; i += channels, k += 4) {
		out[k] = bytes[i];
		out[k + 1] = bytes[i + green];
		out[k + 2] = bytes[i + blue];
	}
	canvas.getContext("2d").putImageData(drawFrame.image, 0, 0);
	setText($("camera").querySelector("figcaption"), `frame at ${place(t)}`);
	widen();
}

// ---- the server ---------------------------------------------------------------------------

const link = {socket: null, tries: 0, id: 0, asked: 0, again: false, frameAsked: 0, frameWanted: null,
	picture: null, ages: new Float64Array(100), aged: 0, drawnTo: -Infinity};

function send(message) {
	if (link.socket?.readyState === 1)
		link.socket.send(JSON.stringify(message));
	return message.id;
}

// One request for data is on the way, and one for a frame; the newest wish goes out when it is answered.
function askPart() {
	link.again = true;
	if (link.asked || !head)
		return;
	link.again = false;
	const width = view.to - view.from;
	const from = Math.max(head.from, view.from - width / 2), to = Math.min(head.to, view.to + width / 2);
	const columns = clamp(Math.ceil(pixels * (to - from) / width), 1, 4000);
	link.asked = send({id: ++link.id, get: {from, to, columns}});
}

function askFrame() {
	if (link.frameAsked || link.frameWanted === null)
		return;
	link.frameAsked = send({id: ++link.id, frame: link.frameWanted});
	link.frameWanted = null;
}

function pickPart() {
	if (live || !part)
		return;
	const covers = part.from <= view.from + 1e-9 && part.to >= view.to - 1e-9;
	series = (covers || !whole ? part : whole).series;
}

function takePart(message) {
	part = readPart(message);
	if (!whole || part.from <= head.from && part.to >= head.to)
		whole = part;
	$("progress").hidden = (message.done ?? 1) >= 1;
	$("progress").value = message.done ?? 1;
	const banded = part.series.some(s => s.u);
	pickPart();
	if (banded !== takePart.banded) { // the legend needs space for what is ±
		takePart.banded = banded;
		arrange();
	}
	dirty.data = dirty.over = true;
	speak();
	wake();
}

function takeLive({t, tracks}) {
	tracks.forEach((values, i) => {
		if (values && series[i])
			for (let k = 0; k < values.length; k++)
				push(series[i], t[k], values[k] ?? NaN);
	});
	dirty.data = dirty.over = true;
	wake();
}

// little-endian: u32 id, width, height, channels, f64 t, then bytes
function takePicture(buffer) {
	const at = new DataView(buffer), u32 = i => at.getUint32(4 * i, true);
	const [id, width, lines, channels] = [u32(0), u32(1), u32(2), u32(3)];
	const bytes = new Uint8Array(buffer, 24);
	if (width * lines * channels !== bytes.length || !bytes.length)
		return;
	if (id && id === link.frameAsked)
		link.frameAsked = 0;
	link.picture = {width, height: lines, channels, t: at.getFloat64(16, true), bytes};
	askFrame();
	wake();
}

function receive({data}) {
	if (typeof data !== "string")
		return takePicture(data);
	const m = JSON.parse(data);
	if (m.id && m.id === link.asked)
		link.asked = 0;
	if (m.id && m.id === link.frameAsked)
		link.frameAsked = 0;
	if (m.head)
		takeHead(m.head);
	if (m.part)
		takePart(m.part);
	if (m.live)
		takeLive(m.live);
	if (m.state)
		takeStatus(m.state);
	if (m.event) {
		head.events.push(m.event);
		if (head.events.length > EVENTS_KEPT)
			head.events.shift();
		dirty.data = true;
		wake();
	}
	if (m.progress !== undefined) {
		$("progress").hidden = m.progress >= 1;
		$("progress").value = m.progress;
		askPart();
	} else if (link.again && head && !live)
		askPart();
	if (m.ok)
		say(m.ok);
	if (m.error)
		say(m.error, true);
}

function connect() {
	const [token, control] = (sessionStorage.getItem("incise") ?? "").split(".");
	if (!token) {
		showState("no token", false);
		say("open the address that incise serve printed, with all that follows #", true);
		return;
	}
	const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`);
	socket.binaryType = "arraybuffer";
	socket.onopen = () => socket.send(JSON.stringify(control ? {token, control} : {token}));
	socket.onmessage = receive;
	socket.onclose = ({code}) => {
		link.socket = null;
		link.asked = link.frameAsked = 0;
		if (code === 1008) {
			sessionStorage.removeItem("incise");
			showState("refused", false);
			if (!$("said").textContent)
				say("the server refuses the token; open the address that incise serve printed", true);
			return;
		}
		showState("no connection", false, "trying again");
		if (live) // a line across the outage would be a lie
			for (const ring of series)
				push(ring, newest() + 1e-6, NaN);
		setTimeout(connect, RETRY_MS[Math.min(link.tries++, RETRY_MS.length - 1)]);
	};
	link.socket = socket;
}

// ---- heads --------------------------------------------------------------------------------

// A head that comes again, after a change or a new connection, keeps view, cursor and rings.
function takeHead(h) {
	const tracks = h.tracks.map(track => track.label).join("\n");
	const same = head && head.kind === h.kind && head.tracks.map(track => track.label).join("\n") === tracks;
	const wasWhole = !same || view.from <= head.from && view.to >= head.to;
	const events = same && h.kind === "live" ? head.events : [];
	head = {cuts: [], panels: [], ...h, events: h.events?.length ? h.events : events};
	head.axis ??= {label: "time", unit: "s"};
	live = head.kind === "live";
	if (head.path?.t)
		head.path = {...head.path, x: numbers(head.path.t), low: numbers(head.path.x), high: numbers(head.path.y),
			start: 0, count: head.path.t.length, mask: -1};
	document.title = `${head.title} · incise`;
	setText($("title"), head.title);
	$("note").hidden = !head.note;
	setText($("note"), head.note ?? "");
	$("control").hidden = !head.control;
	$("tool-label").hidden = !head.tools?.length;
	$("tool").replaceChildren(...(head.tools ?? []).map(name => make("option", name)));
	$("table").hidden = !head.table;
	if (head.table)
		fillTable($("table"), head.table.head, head.table.rows);
	document.body.dataset.mode = live ? "live" : head.kind;
	if (!same) {
		part = whole = trail = cursor = hover = span = null;
		series = live ? head.tracks.map(() => newRing(RING_SLOTS)) : [];
		playing = live;
		buildButtons();
		if (!live)
			cursor = head.cuts[0]?.[0] ?? head.from;
	}
	link.tries = 0;
	if (live && !same || !live && $("word").textContent === "no connection")
		showState(live ? "live" : "connected", true);
	if (head.facts)
		showFacts(head.facts);
	say("");
	if (!live)
		listPlaces();
	widen();
	arrange();
	if (!live) {
		setView(wasWhole ? head.from : view.from, wasWhole ? head.to : view.to);
		cursorMoved();
	}
	wake();
}

// ---- actions: keys and buttons ------------------------------------------------------------

const step = () => (view.to - view.from) / STEPS;
const actions = [
	{key: "ArrowLeft", shown: "←", says: "cursor back; with Shift by ten", does: e => stepBy(-1, e)},
	{key: "ArrowRight", shown: "→", says: "cursor on; with Shift by ten", does: e => stepBy(1, e)},
	{key: " ", shown: "Space", says: "play or pause; live: freeze", button: "⏯", does: () => setPlaying(!playing)},
	{key: "+", also: "=", says: "zoom in", button: "+", does: () => zoom(0.5)},
	{key: "-", also: "_", shown: "−", says: "zoom out", button: "−", does: () => zoom(2)},
	{key: "0", says: "show the whole", button: "whole", does: () => setView(-Infinity, Infinity)},
	{key: "Home", says: "cursor to the start", button: "⏮", does: () => moveCursor(limits().from)},
	{key: "End", says: "cursor to the end", button: "⏭", does: () => moveCursor(limits().to)},
	{key: "p", says: "previous cut", button: "‹ cut", when: () => head.cuts.length, does: () => stepCut(-1)},
	{key: "n", says: "next cut", button: "cut ›", when: () => head.cuts.length, does: () => stepCut(1)},
	{key: ",", says: "previous event", does: () => stepEvent(-1)},
	{key: ".", says: "next event", does: () => stepEvent(1)},
	{key: "s", says: "select by dragging (else: Shift and drag)", button: "select", does: () => setSelecting(!selecting)},
	{key: "[", says: "selection starts at the cursor", does: () => setSpan(cursor, span ? span[1] : view.to)},
	{key: "]", says: "selection ends at the cursor", does: () => setSpan(span ? span[0] : view.from, cursor)},
	{key: "z", says: "zoom to the selection", button: "zoom to it", when: () => !live,
		does: () => span && setView(...span)},
	{key: "Escape", shown: "Esc", says: "select nothing", does: () => setSpan(null)},
	{key: "e", says: "copy the command that exports the selection, or else the view", does: copyCommand},
	{key: "?", says: "these keys", button: "?", does: () => $("keys").showModal()},
];

function stepBy(way, event) {
	moveCursor((cursor ?? (isFollowing() ? newest() : (view.from + view.to) / 2)) +
		way * step() * (event.shiftKey ? 10 : 1));
}

function setSelecting(on) {
	selecting = on;
	document.querySelector('[data-key="s"]').ariaPressed = String(on);
}

function buildButtons() {
	const shown = actions.filter(a => a.button && (!a.when || a.when()));
	$("buttons").replaceChildren(...shown.map(a => {
		const button = make("button", a.button, {type: "button", title: `${a.says} (${a.shown ?? a.key})`,
			ariaLabel: a.says});
		button.dataset.key = a.key;
		if (a.key === " " || a.key === "s")
			button.ariaPressed = "false";
		button.addEventListener("click", a.does);
		return button;
	}));
	if (live) {
		const select = make("select", "", {id: "window", ariaLabel: "window"});
		select.append(...WINDOWS_S.map(s => make("option", `${s} s`, {value: s})));
		select.value = windowS;
		select.addEventListener("change", () => {
			windowS = Number(select.value);
			setPlaying(true);
		});
		$("buttons").append(select);
	}
	fillTable($("keys").querySelector("table"), null, [...actions.map(a => [a.shown ?? a.key, a.says]),
		["wheel, pinch", "zoom"], ["drag", "pan; on the axis: move the cursor"],
		["±", "two standard uncertainties"]]);
}

document.addEventListener("keydown", event => {
	const tag = event.target.tagName;
	if (!head || event.ctrlKey || event.altKey || event.metaKey || $("keys").open ||
			["INPUT", "SELECT", "TEXTAREA"].includes(tag) ||
			event.key === " " && ["BUTTON", "SUMMARY"].includes(tag))
		return;
	const action = actions.find(a => a.key === event.key || a.also === event.key);
	if (!action)
		return;
	event.preventDefault();
	hover = null;
	action.does(event);
});

// ---- pointers -----------------------------------------------------------------------------

// One pointer pans, scrubs on the axis or selects; two zoom. A press that does not move is a click.
const pointers = new Map();
let drag = null;

const localX = event => event.clientX - $("over").getBoundingClientRect().left;
const rowAt = event => {
	const y = event.clientY - $("over").getBoundingClientRect().top;
	return rows.find(row => y >= row.top && y < row.top + row.height);
};

function startDrag(event) {
	if (!head || event.button)
		return;
	const px = localX(event);
	$("over").setPointerCapture(event.pointerId);
	pointers.set(event.pointerId, px);
	hover = null;
	const does = event.shiftKey || selecting ? "select" : rowAt(event)?.kind === "axis" ? "scrub" : "pan";
	drag = {does, px, x: toX(px), from: view.from, to: view.to, moved: false, pinch: pinch()};
	if (does === "scrub")
		moveCursor(toX(px));
}

function pinch() {
	const [a, b] = pointers.values();
	return b === undefined ? null : {xa: toX(a), xb: toX(b)};
}

function moveDrag(event) {
	if (!head)
		return;
	const px = localX(event);
	if (!pointers.has(event.pointerId)) {
		if (event.pointerType === "mouse") {
			hover = px >= LEFT && px <= LEFT + rows.width ? toX(px) : null;
			dirty.over = true;
			wake();
		}
		return;
	}
	pointers.set(event.pointerId, px);
	drag.moved ||= Math.abs(px - drag.px) > 4;
	if (drag.pinch && pointers.size === 2) {
		freeze();
		const [a, b] = pointers.values(), {xa, xb} = drag.pinch;
		if (Math.abs(b - a) > 8) {
			const scale = (xb - xa) / (b - a); // x a pixel that puts both places under the fingers
			const from = xa - (a - LEFT) * scale;
			if (scale > 0)
				setView(from, from + rows.width * scale);
		}
	} else if (drag.moved && drag.does === "pan") {
		freeze();
		const moved = (drag.px - px) / rows.width * (drag.to - drag.from);
		setView(drag.from + moved, drag.to + moved);
	} else if (drag.moved && drag.does === "select") {
		freeze();
		setSpan(clamp(drag.x, limits().from, limits().to), clamp(toX(px), limits().from, limits().to));
	} else if (drag.does === "scrub")
		moveCursor(toX(px));
}

function endDrag(event) {
	if (!pointers.delete(event.pointerId) || !drag)
		return;
	if (event.type === "pointerup" && !drag.moved && !drag.pinch && drag.does !== "scrub") {
		const x = toX(localX(event)), kind = rowAt(event)?.kind;
		const cut = kind === "cuts" && head.cuts.find(([from, to]) => x >= from && x <= to);
		if (cut)
			setSpan(...cut);
		moveCursor((kind === "events" && eventNear(x, 12)?.[0]) || x);
	}
	drag = null;
}

function turnWheel(event) {
	if (!head)
		return;
	event.preventDefault();
	freeze();
	hover = null;
	const width = view.to - view.from;
	if (Math.abs(event.deltaX) > Math.abs(event.deltaY))
		setView(view.from + event.deltaX / rows.width * width, view.to + event.deltaX / rows.width * width);
	else
		zoom(Math.exp(clamp(event.deltaY, -240, 240) / 400), clamp(toX(localX(event)), view.from, view.to));
}

// ---- the clock ----------------------------------------------------------------------------

function wake() {
	if (asleep && head) {
		asleep = false;
		requestAnimationFrame(draw);
	}
}

// The live window rolls with the newest sample. Where motion is to be reduced it stands still and
// fills from the left, and the next one starts when it is full.
function roll() {
	const to = newest();
	if (to === -Infinity)
		return;
	view.to = reducedMotion.matches ? Math.ceil(to / windowS) * windowS : to;
	view.from = view.to - windowS;
	dirty.data = dirty.over = true;
}

function play(now) {
	if (cursor >= head.to)
		return setPlaying(false);
	const x = (cursor ?? view.from) + (now - playedAt) / 1000;
	playedAt = now;
	moveCursor(x);
}

function draw(now) {
	asleep = true;
	if (isFollowing())
		roll();
	else if (playing)
		play(now);
	if (link.picture) {
		drawFrame(link.picture);
		link.picture = null;
	}
	if (dirty.data) {
		drawData();
		noteAge();
		if (!live)
			drawAbove();
	}
	if (dirty.data || dirty.over)
		drawOver();
	if (!live && !dirty.data)
		drawAbove();
	dirty.data = dirty.over = false;
	const {dataset} = document.body;
	dataset.view = `${view.from} ${view.to}`;
	dataset.cursor = cursor ?? "";
	if (part || live && newest() > -Infinity)
		dataset.ready = "1";
	if (live)
		speak();
	if (playing && !live)
		wake();
}

// How long ago the newest sample was taken, when it is first drawn: the median of the last 100.
function noteAge() {
	const to = live ? newest() : -Infinity;
	if (!(to > link.drawnTo))
		return;
	link.drawnTo = to;
	link.ages[link.aged++ % 100] = Date.now() - 1000 * to;
	const ages = link.ages.slice(0, Math.min(link.aged, 100)).sort();
	document.body.dataset.behind = Math.round(ages[ages.length >> 1]);
}

function startControls() {
	let id = 1e6; // apart from the requests for data
	const order = message => send({id: ++id, ...message});
	$("control").addEventListener("submit", event => {
		event.preventDefault();
		order({do: "mark", text: $("mark-text").value});
	});
	$("control").capture.addEventListener("click", () => order({do: "capture", name: $("capture-name").value}));
	$("control").stop.addEventListener("click", () => order({do: "stop"}));
	$("tool").addEventListener("change", () => order({do: "tool", tool: $("tool").value}));
}

function start() {
	readColours();
	startControls();
	$("copy").addEventListener("click", copyCommand);
	$("over").addEventListener("pointerdown", startDrag);
	$("over").addEventListener("pointermove", moveDrag);
	$("over").addEventListener("pointerup", endDrag);
	$("over").addEventListener("pointercancel", endDrag);
	$("over").addEventListener("pointerleave", () => {
		hover = null;
		dirty.over = true;
		wake();
	});
	$("over").addEventListener("wheel", turnWheel, {passive: false});
	const again = () => {
		readColours();
		if (head) {
			arrange();
			wake();
		}
	};
	matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
	new ResizeObserver(again).observe($("stage"));
	const text = $("document").textContent.trim();
	if (text) {
		const document = JSON.parse(text);
		frames = (document.frames ?? []).map(([t, src]) => [t, Object.assign(new Image(), {src, onload: again})]);
		takeHead(document.head);
		takePart(document.part);
		cursorMoved();
		return;
	}
	const fragment = decodeURIComponent(location.hash.slice(1));
	if (fragment) {
		sessionStorage.setItem("incise", fragment);
		history.replaceState(null, "", location.pathname + location.search);
	}
	addEventListener("hashchange", () => location.reload());
	connect();
}

start();
