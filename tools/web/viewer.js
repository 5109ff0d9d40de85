// SPDX-License-Identifier: GPL-2.0-or-later
// The viewer: panels over one x axis. A document in the page is shown without a network; without
// one, incise serve answers by WebSocket: parts of a recording, or a rig or loop live.
//
//	document or part ──► series ──┐
//	live message ──► ring ────────┼─► draw: min and max a pixel, one canvas, when something changed
//	pointer, key, button ─► view ─┘
//
// A series is x, low, high and, where known, u (standard uncertainty) in typed arrays of which
// `count` from `start` on hold something; NaN is a gap. A ring is a series that wraps around.
// x is in the head's unit: seconds, or UTC seconds when live. Sizes are CSS pixels.
"use strict";

const RING_SLOTS = 1 << 18; // a minute of 4 kHz; a faster track fills less of the longest window
const WINDOWS_S = [5, 10, 30, 60], RETRY_MS = [500, 1000, 2000, 4000];
const TRAIL = 512, EVENTS_KEPT = 1000; // places of the live tool from above; events when live
const LEFT = 62, RIGHT = 12, STEPS = 200; // beside the plots; of the cursor across the view

let head = null, live = false, status = {};
let series = []; // one a track: of the newest part, or rings
let part = null, whole = null; // parts: the newest, and one of the whole axis
let frames = []; // of a document: [t, image]
let trail = null; // where the live tool was
let cursor = null, hoverPx = null, span = null, playing = false, selecting = false;
let rows = [], plotWidth = 0, pixels = 1, windowS = 10, asleep = true, playedAt = 0;
const view = {from: 0, to: 1}, colours = {};
const $ = id => document.getElementById(id);
const keyButton = key => document.querySelector(`[data-key="${key}"]`);
const canvasIn = id => $(id).querySelector("canvas");
const clamp = (v, low, high) => Math.max(low, Math.min(high, v));

// ---- series -------------------------------------------------------------------------------
const numbers = list => Float64Array.from(list, v => v ?? NaN);
const slot = (s, i) => s.start + i & s.mask;
const newestX = s => s.count ? s.x[slot(s, s.count - 1)] : -Infinity;
const newest = () => series.reduce((x, s) => Math.max(x, newestX(s)), -Infinity);

function readPart({from, to, tracks}) {
	const centres = new Map(); // of columns, shared by the tracks that have as many
	return {from, to, series: tracks.map(track => {
		const low = numbers(track.low ?? track.y), count = low.length;
		if (!track.x && !centres.has(count))
			centres.set(count, low.map((_, i) => from + (to - from) * (i + 0.5) / count));
		return {x: track.x ? numbers(track.x) : centres.get(count), low, start: 0, count, mask: -1,
			high: track.high ? numbers(track.high) : low, u: track.u && numbers(track.u)};
	})};
}

function newRing(slots) {
	const v = new Float32Array(slots);
	return {x: new Float64Array(slots), low: v, high: v, start: 0, count: 0, mask: slots - 1};
}

function push(ring, x, v) {
	if (x < newestX(ring) - 1) ring.start = ring.count = 0; // the clock was set back
	else if (x < newestX(ring)) return;
	if (ring.count > ring.mask) ring.start = slot(ring, 1);
	else ring.count++;
	const k = slot(ring, ring.count - 1);
	ring.x[k] = x;
	ring.low[k] = v;
}

function countBefore(s, x) {
	let a = 0, b = s.count;
	while (a < b) {
		const i = a + b >> 1;
		if (s.x[slot(s, i)] < x) a = i + 1;
		else b = i;
	}
	return a;
}

// The place of the sample nearest to x, or -1 five samples beyond an end: live, some tracks lag.
function nearest(s, x) {
	const first = s.x[slot(s, 0)], last = newestX(s), reach = 5 * (last - first) / (s.count - 1) || 0;
	if (!s.count || !(x >= first - reach && x <= last + reach)) return -1;
	const i = countBefore(s, x), [a, b] = [i - 1, i].map(n => slot(s, clamp(n, 0, s.count - 1)));
	return x - s.x[a] <= s.x[b] - x ? a : b;
}

// The visible samples as at most one entry a device pixel, in s.seen; one more on either side
// leads the line out of the picture. `least` and `most` are the range with the band.
function reduce(s) {
	const room = pixels + 4, first = Math.max(0, countBefore(s, view.from) - 1);
	if (!(s.seen?.px.length >= room))
		s.seen = Object.fromEntries(["px", "low", "high", "u"].map(k => [k, new Float64Array(room)]));
	const {px, low, high, u} = s.seen, scale = pixels / (view.to - view.from);
	let e = -1, column = -2, i = first, least = Infinity, most = -Infinity;
	for (; i < s.count && column < pixels; i++) {
		const k = slot(s, i), at = (s.x[k] - view.from) * scale, band = s.u ? 2 * s.u[k] || 0 : 0;
		const here = at < 0 ? -1 : Math.min(pixels, Math.floor(at));
		if (here !== column) {
			column = here;
			px[++e] = LEFT + at / pixels * plotWidth;
			low[e] = high[e] = u[e] = NaN;
		}
		if (s.low[k] < low[e] || low[e] !== low[e]) low[e] = s.low[k];
		if (s.high[k] > high[e] || high[e] !== high[e]) high[e] = s.high[k];
		if (s.u && (s.u[k] > u[e] || u[e] !== u[e])) u[e] = s.u[k];
		if (s.low[k] - band < least) least = s.low[k] - band;
		if (s.high[k] + band > most) most = s.high[k] + band;
	}
	return Object.assign(s.seen, {n: e + 1, samples: i - first, least, most});
}

// A step of 1, 2 or 5 times a power of ten that is not below `least`.
function niceStep(least) {
	const power = 10 ** Math.floor(Math.log10(least));
	return power * ([1, 2, 5].find(m => m * power >= least * (1 - 1e-9)) ?? 10);
}

const decimalsOf = step => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));

function fixed(v, decimals) {
	if (!Number.isFinite(v)) return "–";
	const text = Math.abs(v) >= 1e6 || decimals > 6 ? v.toExponential(3) : v.toFixed(decimals);
	return text.replace(/^-(?=[0.]*$)/, "").replace("-", "−");
}

function clock(x, decimals) {
	const text = new Date(1000 * x).toTimeString().slice(0, 8);
	return decimals ? `${text}.${String(Math.floor(1000 * x) % 1000).padStart(3, "0")}` : text;
}

// A place on the x axis for people: to a pixel, and as hours where seconds are many.
function place(x) {
	if (live) return clock(x, 3);
	const decimals = clamp(decimalsOf(niceStep((view.to - view.from) / 1500)), 0, 6);
	const unit = head.axis.unit ?? "", text = `${fixed(x, decimals)} ${unit}`.trim();
	const long = unit === "s" && head.to > 600 && head.to < 86400;
	return long ? `${text} (${new Date(1000 * x).toISOString().slice(11, 19)})` : text;
}

function valueText(s, x, decimals) {
	const k = s ? nearest(s, x) : -1;
	if (k < 0 || s.low[k] !== s.low[k]) return "–";
	const low = fixed(s.low[k], decimals), high = fixed(s.high[k], decimals);
	const band = s.u && s.u[k] === s.u[k] ? ` ± ${fixed(2 * s.u[k], decimals)}` : "";
	return (low === high ? low : `${low} … ${high}`) + band;
}

// ---- the picture --------------------------------------------------------------------------
const toPx = x => LEFT + (x - view.from) / (view.to - view.from) * plotWidth;
const toX = px => view.from + (px - LEFT) / plotWidth * (view.to - view.from);
const isSeen = (from, to = from) => to >= view.from && from <= view.to;
const seenCuts = () => head.cuts.filter(([from, to]) => isSeen(from, to));
const trackColour = i => colours.tracks[i % colours.tracks.length];
const isFollowing = () => live && playing;
const shownX = () => hoverPx !== null ? toX(hoverPx) : isFollowing() ? newest() : cursor;

function readColours() {
	const style = getComputedStyle(document.documentElement);
	for (const name of ["ink", "soft", "page", "line", "band", "mark", "cut", "bad", "tracks"])
		colours[name] = style.getPropertyValue("--" + name).trim();
	colours.tracks = colours.tracks.split(/\s+/);
	colours.font = `13px ${getComputedStyle(document.body).fontFamily}`;
}

const box = (g, colour, ...place) => Object.assign(g, {fillStyle: colour}).fillRect(...place);
const write = (g, colour, text, x, y, align = "left", widest = 9999) =>
	Object.assign(g, {fillStyle: colour, textAlign: align}).fillText(text, x, y, widest);

function stroke(g, colour, width, trace) {
	Object.assign(g, {strokeStyle: colour, lineWidth: width, lineJoin: "round", lineCap: "round"});
	g.beginPath();
	trace();
	g.stroke();
}

function within(g, x, y, w, h, draws) {
	g.save();
	g.beginPath();
	g.rect(x, y, w, h);
	g.clip();
	draws();
	g.restore();
}

function cleared(canvas, h) {
	const w = canvas.clientWidth, scale = Math.min(devicePixelRatio, 16000 / Math.max(w, h, 1));
	const g = canvas.getContext("2d"), [width, height] = [w, h].map(v => Math.round(v * scale));
	if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
	canvas.style.height = h + "px";
	g.setTransform(scale, 0, 0, scale, 0, 0);
	g.clearRect(0, 0, w, h);
	return Object.assign(g, {font: colours.font, textBaseline: "middle"});
}

// A legend's cell is as wide as its longest value, so that nothing moves while values change.
function arrangeLegend(g, width, panel) {
	const own = panel.tracks.length === 1 && panel.label, unit = panel.unit ? ` (${panel.unit})` : "";
	const name = own ? "" : (panel.label ?? "") + unit;
	let x = LEFT + (name ? g.measureText(name).width + 22 : 0), line = 0;
	const cells = panel.tracks.map((track, i) => {
		const label = head.tracks[track]?.label || panel.label || "", text = own ? label + unit : label;
		const {u, low, high} = whole?.series[track] ?? {}, range = low === high ? "" : " … −000.00";
		const cell = 24 + g.measureText(`${text}  −000.00${range}${u ? " ± 00.000" : ""}`).width;
		if (x + cell > width - RIGHT && x > LEFT) [x, line] = [LEFT, line + 1];
		x += cell;
		return {track, text, label, colour: i, x: x - cell, line};
	});
	return {kind: "panel", panel, name, cells, legend: 26 + 20 * line};
}

// Rows from the top: axis, cuts, events, a lane a member, frames, and panels, which share what the
// window has left.
function arrange() {
	const width = $("stage").clientWidth, g = canvasIn("stage").getContext("2d");
	g.font = colours.font;
	const panels = head.panels.map(panel => arrangeLegend(g, width, panel));
	rows = [{kind: "axis", height: 30}];
	if (head.cuts.length) rows.push({kind: "cuts", height: 24});
	if (head.events.length || live) rows.push({kind: "events", height: 24});
	rows.push(...(head.members ?? []).map(member => ({kind: "member", height: 40, member})));
	if (frames.length > 1) rows.push({kind: "frames", height: 64});
	const used = [...rows, ...panels].reduce((sum, row) => sum + (row.height ?? row.legend + 16), 60);
	const plot = clamp((innerHeight - $("stage").offsetTop - used) / (panels.length || 1), 110, 360);
	rows.push(...panels.map(row => ({...row, plot, height: row.legend + plot + 16})));
	rows.height = rows.reduce((top, row) => (row.top = top) + row.height, 0);
	plotWidth = Math.max(50, width - LEFT - RIGHT);
	pixels = Math.round(plotWidth * Math.min(devicePixelRatio, 16000 / rows.height));
	document.body.dataset.columns = pixels;
	wake();
}

// Draws what does not touch the one before.
function spread(list, middle, half, draws) {
	let free = -Infinity;
	for (const one of list) {
		const px = middle(one), room = half(one);
		if (px - room >= free) draws(one, px, free = px + room);
	}
}

function drawAxis(g, row) {
	const step = niceStep((view.to - view.from) * 95 / plotWidth), decimals = decimalsOf(step);
	const all = limits(), scale = plotWidth / (all.to - all.from), ticks = [];
	box(g, colours.band, LEFT, 0, plotWidth, row.height - 6);
	if (all.to - all.from > (view.to - view.from) * 1.0001) { // the place of the view in the whole
		box(g, colours.line, LEFT, 24, plotWidth, 4);
		within(g, LEFT, 24, plotWidth, 4, () => box(g, colours.mark,
			LEFT + (view.from - all.from) * scale, 24, Math.max(4, (view.to - view.from) * scale), 4));
	}
	write(g, colours.soft, head.axis.unit || head.axis.label, LEFT - 8, 12, "right", LEFT - 10);
	for (let i = Math.ceil(view.from / step); i * step <= view.to; i++) {
		const text = live ? clock(i * step + 1e-6, decimals) : fixed(i * step, decimals);
		const half = g.measureText(text).width / 2 + 2, px = toPx(i * step);
		write(g, colours.soft, text, clamp(px, LEFT + half, LEFT + plotWidth - half), 12, "center");
		g.fillRect(px - 0.5, 0, 1, 4);
		ticks.push(px);
	}
	return ticks;
}

const drawers = {
	cuts(g, {top}) {
		const ends = cut => [Math.max(LEFT, toPx(cut[0])), Math.min(LEFT + plotWidth, toPx(cut[1]))];
		for (const [a, b] of seenCuts().map(ends))
			box(g, colours.mark, a, top + 18, Math.max(1, b - a), 3);
		spread(seenCuts(), cut => (ends(cut)[0] + ends(cut)[1]) / 2, ([, , label]) =>
			g.measureText(label).width / 2 + 3, ([, , label], px) =>
			write(g, colours.mark, label, px, top + 9, "center"));
	},
	events(g, {top}) {
		spread(head.events.filter(([x]) => isSeen(x)), ([x]) => toPx(x), () => 1, (_, px) =>
			write(g, colours.bad, "▼", px, top + 12, "center"));
	},
	member(g, {top, member: {label, from, to, text}}) {
		within(g, LEFT, top, plotWidth, 40, () =>
			box(g, colours.line, toPx(from), top + 24, toPx(to) - toPx(from), 8));
		const line = text ? `${label}: ${text}` : label;
		write(g, colours.ink, line, LEFT + 4, top + 11, "left", plotWidth - 8);
	},
	frames(g, {top, height}) {
		const half = image => (height - 8) * image.naturalWidth / image.naturalHeight / 2;
		spread(frames.filter(([t, image]) => isSeen(t) && image.naturalWidth),
			([t, image]) => clamp(toPx(t), LEFT + half(image), LEFT + plotWidth - half(image)),
			([, image]) => half(image) + 1, ([, image], px) =>
				g.drawImage(image, px - half(image), top + 4, 2 * half(image), height - 8));
	},
	panel: drawPanel,
};

// The panel's range goes out to half steps of its axis.
function scalePanel(row, seen) {
	let low = Math.min(...seen.map(e => e.least)), high = Math.max(...seen.map(e => e.most));
	row.empty = !(low <= high);
	if (row.empty) [low, high] = [0, 1];
	if (!(high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high))))
		[low, high] = [low - (Math.abs(low) / 10 || 1), high + (Math.abs(high) / 10 || 1)];
	const step = niceStep((high - low) / Math.max(2, row.plot / 45)), half = step / 2;
	const y0 = Math.floor(low / half + 1e-6) * half, y1 = Math.ceil(high / half - 1e-6) * half;
	const base = row.top + row.legend, scale = row.plot / (y1 - y0);
	const toY = v => base + (y1 - v) * scale;
	Object.assign(row, {step, y0, y1, decimals: decimalsOf(step) + 2, toY});
}

function drawBand(g, e, toY) {
	for (let i = 0; i < e.n; i++) {
		const from = i;
		while (i < e.n && e.u[i] === e.u[i] && e.low[i] === e.low[i]) i++;
		g.beginPath();
		for (let k = from; k < i; k++) g.lineTo(e.px[k], toY(e.high[k] + 2 * e.u[k]));
		for (let k = i - 1; k >= from; k--) g.lineTo(e.px[k], toY(e.low[k] - 2 * e.u[k]));
		g.fill();
	}
}

function drawTrace(g, e, toY, joined) {
	for (let i = 0, down = false; i < e.n; i++) {
		const good = e.low[i] === e.low[i];
		if (good && !(down && joined)) g.moveTo(e.px[i], toY(e.low[i]));
		if (good) g.lineTo(e.px[i], toY(e.low[i]));
		if (good) g.lineTo(e.px[i], toY(e.high[i]) - 0.01); // a line of no length is not drawn
		down = good;
	}
}

function drawPanel(g, row) {
	const cells = row.cells.filter(cell => series[cell.track]), {top, legend, plot, cells: all} = row;
	scalePanel(row, cells.map(cell => reduce(series[cell.track])));
	const {step, toY} = row, base = top + legend;
	for (let i = Math.ceil(row.y0 / step - 1e-6); i * step <= row.y1 + 1e-6 * step; i++) {
		box(g, colours.line, LEFT, Math.round(toY(i * step)), plotWidth, 1);
		write(g, colours.soft, fixed(i * step, row.decimals - 2), LEFT - 8, toY(i * step), "right");
	}
	within(g, LEFT, base - 3, plotWidth, plot + 6, () => cells.forEach(({track, colour}) => {
		const {seen, u} = series[track];
		Object.assign(g, {fillStyle: trackColour(colour), globalAlpha: 0.22 / Math.sqrt(cells.length)});
		if (u) drawBand(g, seen, toY);
		g.globalAlpha = 1;
		stroke(g, trackColour(colour), 1.6, () => drawTrace(g, seen, toY, true));
		if (seen.samples < plotWidth / 12) // few: each is a dot
			stroke(g, trackColour(colour), 5, () => drawTrace(g, seen, toY, false));
	}));
	if (row.empty) write(g, colours.soft, "no data", LEFT + plotWidth / 2, base + plot / 2, "center");
	g.font = "600 " + colours.font;
	write(g, colours.ink, row.name, LEFT, top + 12);
	g.font = colours.font;
	for (const {track, text, colour, x, line} of all) {
		const at = shownX(), value = at === null ? "" : valueText(series[track], at, row.decimals);
		box(g, trackColour(colour), x, top + 10 + 20 * line, 14, 4);
		write(g, colours.ink, `${text}  ${value}`, x + 19, top + 12 + 20 * line);
	}
}

function eventNear(x) {
	const far = event => Math.abs(event[0] - x), reach = 10 * (view.to - view.from) / plotWidth;
	return head.events.filter(event => far(event) <= reach).sort((a, b) => far(a) - far(b))[0];
}

function drawLabel(g, text, middle, y) {
	const w = Math.min(g.measureText(text).width + 12, plotWidth);
	const x = clamp(middle - w / 2, LEFT, LEFT + plotWidth - w);
	box(g, colours.ink, x, y - 11, w, 22);
	write(g, colours.page, text, x + w / 2, y + 0.5, "center", w - 8);
}

function drawCursor(g) {
	const [a, b] = span ? span.map(toPx) : [0, 0], x = shownX(), event = x !== null && eventNear(x);
	within(g, LEFT, 0, plotWidth, rows.height, () => {
		g.globalAlpha = 0.1;
		box(g, colours.mark, a, 0, b - a, rows.height);
		g.globalAlpha = 1;
		for (const px of span ? [a, b] : []) box(g, colours.mark, px - 1, 0, 2, rows.height);
		if (cursor !== null) box(g, colours.ink, toPx(cursor) - 0.75, 0, 1.5, rows.height);
		if (hoverPx !== null) box(g, colours.soft, hoverPx - 0.5, 0, 1, rows.height);
	});
	if (cursor === null && hoverPx === null) return;
	drawLabel(g, (head.axis.label + " ").replace("time ", "") + place(x), toPx(x), 12);
	if (event) drawLabel(g, event.slice(1).filter(Boolean).join(": "), toPx(event[0]),
		rows.find(row => row.kind === "events").top + 12);
}

function drawPlots() {
	const g = cleared(canvasIn("stage"), rows.height), ticks = drawAxis(g, rows[0]);
	const {top, legend} = rows.find(row => row.kind === "panel") ?? rows[0];
	within(g, LEFT, top, plotWidth, rows.height - top - 4, () => {
		for (const px of ticks) box(g, colours.line, Math.round(px), top + legend, 1, rows.height);
		for (const [from, to] of seenCuts())
			box(g, colours.cut, toPx(from), top, Math.max(1, toPx(to) - toPx(from)), rows.height);
	});
	for (const row of rows) drawers[row.kind]?.(g, row);
	drawCursor(g);
}

// ---- beside the plots ---------------------------------------------------------------------
// The path from above, x to the right and y up, both to one scale, which a bar shows.
function drawAbove() {
	const p = trail ?? head.path, canvas = canvasIn("above");
	$("above").hidden = !p?.count;
	if (!p?.count) return;
	const size = canvas.clientWidth, tall = Math.round(size * 0.7), g = cleared(canvas, tall);
	const range = list => list.subarray(0, p.count).reduce(([a, b], v) =>
		[v < a ? v : a, v > b ? v : b], [Infinity, -Infinity]);
	const [x0, x1] = range(p.low), [y0, y1] = range(p.high), middle = (tall - 24) / 2;
	const scale = Math.min((size - 40) / (x1 - x0 || 1e-6), (tall - 56) / (y1 - y0 || 1e-6), size / 2);
	const at = k => [size / 2 + (p.low[k] - (x0 + x1) / 2) * scale,
		middle - (p.high[k] - (y0 + y1) / 2) * scale];
	const line = (colour, width, from, to) => stroke(g, colour, width, () => {
		for (let i = from; i < to; i++) g.lineTo(...at(slot(p, i)));
	});
	line(colours.soft, 1.2, 0, p.count);
	if (!trail) line(trackColour(0), 2, countBefore(p, view.from), countBefore(p, view.to));
	const k = nearest(p, trail ? newestX(p) : shownX() ?? NaN);
	if (k >= 0) stroke(g, trackColour(1), 12, () => g.arc(...at(k), 0.01, 0, 7));
	const bar = niceStep(60 / scale), text = `${bar} ${head.path?.unit ?? "mm"}`;
	box(g, colours.ink, 12, tall - 12, bar * scale, 2);
	write(g, colours.ink, text, 18 + bar * scale, tall - 12);
}

// Lateness on a logarithmic axis from 1 µs on, counts logarithmic; the line is the period.
function drawLate({edges_us: edges, counts}) {
	$("late").hidden = false;
	const canvas = canvasIn("late"), w = canvas.clientWidth, h = 130, g = cleared(canvas, h);
	const deadline = 1e6 / (status.rate_hz || 1000), last = Math.max(deadline * 2, edges.at(-1) || 1);
	const px = us => 8 + (w - 16) * Math.log(Math.max(1, us)) / Math.log(last);
	const most = Math.log(1 + Math.max(1, ...counts)), colour = trackColour(0);
	counts.forEach((count, i) => {
		const a = px(edges[i] ?? last), b = px(edges[i + 1] ?? last);
		const bar = (h - 46) * Math.log(1 + count) / most;
		box(g, colour, a, h - 24 - bar, count ? Math.max(2, b - a - 1) : 0, bar);
	});
	box(g, colours.soft, 8, h - 24, w - 16, 1);
	for (let us = 1; us <= last; us *= 10)
		write(g, colours.soft, us < 1000 ? us + " µs" : us / 1000 + " ms", px(us) + 4, h - 11);
	box(g, colours.bad, px(deadline) - 1, 20, 2, h - 44);
	write(g, colours.bad, "deadline", px(deadline) - 5, 12, "right");
	const sum = from => counts.reduce((n, count, i) => n + (edges[i] >= from ? count : 0), 0);
	canvas.ariaLabel = `lateness of ${sum(0)} ticks, ${sum(deadline)} over the period; logarithmic`;
	setText($("late").querySelector("figcaption"), canvas.ariaLabel);
}

const make = (tag, text = "") => Object.assign(document.createElement(tag), {textContent: text});
const setText = (e, text) => e.textContent !== String(text) && (e.textContent = text);
const say = (text, className = "") => Object.assign($("said"), {className, textContent: text});
const showProgress = done => Object.assign($("progress"), {hidden: done >= 1, value: done});

// Cells that are there get their new texts in place, so that a selection of them stays.
function fillTable(table, names, lines) {
	const all = names ? [names, ...lines] : lines, cells = table.querySelectorAll("th, td");
	table.hidden = !all.length;
	if (cells.length === all.flat().length && table.rows.length === all.length)
		return all.flat().forEach((text, i) => setText(cells[i], text));
	table.replaceChildren(...all.map((line, i) => {
		const tr = make("tr");
		tr.append(...line.map(text => make(names && !i ? "th" : "td", text)));
		return tr;
	}));
}

// A state is a word with a symbol and a colour.
function showState(word, well, text) {
	$("state").hidden = !word;
	$("state").className = well ? "well" : "ill";
	setText($("state"), `${well ? "●" : "▲"} ${word}`);
	setText($("text"), text ?? "");
}

function takeStatus(s) {
	Object.assign(status, s);
	const {pose: {position_mm: p, quaternion: q} = {}, warnings = [], rate_hz: rate, late} = status;
	const {behind} = document.body.dataset, join = (list, n) => list.map(v => fixed(v, n)).join("  ");
	showState(status.word ?? "running", status.well ?? true, status.text);
	fillTable($("facts"), null, [...head.facts ?? [], ["tool", status.tool],
		["rate", rate && `${fixed(rate, 0)} Hz`], ["lost", status.lost], ["capture", status.capture],
		["behind", behind && behind + " ms"], ["position", p && join(p, 2) + " mm"],
		["quaternion", q && join(q, 3)]].filter(([, value]) => value ?? false));
	if (s.pose && p) {
		trail ??= {...newRing(TRAIL), high: new Float32Array(TRAIL)};
		push(trail, performance.now() / 1000, p[0]);
		trail.high[slot(trail, trail.count - 1)] = p[1];
		drawAbove();
	}
	fillTable($("warnings"), null, warnings.map(text => ["▲ " + text]));
	if (status.tool && document.activeElement !== $("tool")) $("tool").value = status.tool;
	if (s.late) drawLate(late);
}

function drawFrame(t, width, height, draws) {
	const canvas = canvasIn("camera"), caption = $("camera").querySelector("figcaption");
	if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
	$("camera").hidden = false;
	setText(caption, `frame at ${place(t)}`);
	draws(canvas.getContext("2d"));
}

function drawNearest() {
	const far = ([t]) => Math.abs(t - cursor), loaded = frames.filter(([, i]) => i.naturalWidth);
	if (!loaded.length) return;
	const [t, image] = loaded.reduce((a, b) => far(b) < far(a) ? b : a);
	drawFrame(t, image.naturalWidth, image.naturalHeight, g => g.drawImage(image, 0, 0));
}

function drawPicture({width, height, channels, t, bytes}) {
	const green = channels === 3 ? 1 : 0;
	if (drawPicture.image?.width !== width || drawPicture.image.height !== height)
		drawPicture.image = new ImageData(width, height);
	const out = drawPicture.image.data.fill(255);
	for (let i = 0, k = 0; k < out.length; i += channels, k += 4) {
		out[k] = bytes[i];
		out[k + 1] = bytes[i + green];
		out[k + 2] = bytes[i + 2 * green];
	}
	drawFrame(t, width, height, g => g.putImageData(drawPicture.image, 0, 0));
	link.picture = null;
}

// ---- the view -----------------------------------------------------------------------------
function limits() {
	const to = live ? newest() : head.to;
	return {from: live ? to - WINDOWS_S.at(-1) : head.from, to};
}

// A view is asked for with half of one on either side, so that a pan has data.
function setView(from, to) {
	const all = limits(), most = all.to - all.from || 1;
	const width = clamp(to - from, Math.max(1e-6, most * 1e-7), most);
	view.from = clamp((from + to - width) / 2, all.from, all.to - width);
	view.to = view.from + width;
	const a = Math.max(all.from, view.from - width / 2), b = Math.min(all.to, view.to + width / 2);
	const columns = clamp(Math.ceil(pixels * (b - a) / width), 1, 4000);
	if (!live) ask("get", {from: a, to: b, columns});
	pickPart();
	wake();
}

const zoom = (factor, at = isSeen(cursor ?? NaN) ? cursor : (view.from + view.to) / 2) =>
	setView(at - (at - view.from) * factor, at + (view.to - at) * factor);

function moveCursor(x) {
	freeze();
	cursor = clamp(x, limits().from, limits().to);
	const width = view.to - view.from, lead = cursor > view.to ? 0.1 : 0.9;
	if (!isSeen(cursor)) setView(cursor - width * lead, cursor + width * (1 - lead));
	if (head.frames && !frames.length) ask("frame", cursor);
	wake();
}

function freeze() {
	hoverPx = null;
	if (isFollowing()) setPlaying(false);
}

function setPlaying(on) {
	playing = on;
	playedAt = performance.now();
	if (live) cursor = on ? null : newest();
	if (live && on) span = null;
	wake();
}

const setSpan = (a, b) => wake(span = a === null ? null : [Math.min(a, b), Math.max(a, b)]);

function showCut([from, to]) {
	freeze();
	setView(from - (to - from) * 0.1, to + (to - from) * 0.1);
	setSpan(from, to);
	moveCursor(from);
}

// The next or previous one of a list whose members begin with a place.
function stepTo(list, way, goes) {
	const after = list.filter(([x]) => way * (x - (cursor ?? view.from)) > 1e-9);
	if (after.length) goes(after.at(way > 0 ? 0 : -1));
}

const stepBy = (way, {shiftKey}) =>
	moveCursor((shownX() ?? view.from) + way * (view.to - view.from) / STEPS * (shiftKey ? 10 : 1));

// Buttons, command and the state for tests.
function showView() {
	const [from, to] = span ?? [view.from, view.to], filled = (head.export ?? "")
		.replaceAll("{from}", from.toFixed(4)).replaceAll("{to}", to.toFixed(4));
	$("export").hidden = !filled;
	setText($("span"), `${span ? "selected" : "visible"}: ${place(from)} to ${place(to)}`);
	setText($("command"), filled);
	keyButton(" ").ariaPressed = String(live ? !playing : playing);
	keyButton("s").ariaPressed = String(selecting);
	keyButton("z").hidden = !span;
	Object.assign(document.body.dataset, {view: `${view.from} ${view.to}`, cursor: cursor ?? ""});
	if (part || live && newest() > -Infinity) document.body.dataset.ready = "1";
}

// A page that is neither from https nor from this machine has no clipboard but the selection's.
async function copyCommand() {
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
	speak.timer ??= setTimeout(() => {
		speak.timer = undefined;
		const x = shownX(), cells = rows.flatMap(row => (row.cells ?? []).map(cell => [row, cell]));
		if (x === null || x === -Infinity) return;
		const values = cells.map(([{decimals, panel}, {label, track}]) =>
			`${label} ${valueText(series[track], x, decimals ?? 3)} ${panel.unit ?? ""}`).join(", ");
		const range = `${head.axis.label} ${place(view.from)} to ${place(view.to)}`;
		canvasIn("stage").ariaLabel = [head.title, range, `at ${place(x)}: ${values}`,
			...eventNear(x)?.slice(1) ?? []].join("; ");
		if (!isFollowing()) setText($("spoken"), `${place(x)}: ${values}`);
	}, 1000);
}

// ---- the server ---------------------------------------------------------------------------
// One request of each kind is on the way; the newest wish goes out when it is answered.
const asks = {get: {id: 0, wish: null}, frame: {id: 0, wish: null}};
const link = {socket: null, tries: 0, id: 0, picture: null, ages: new Float64Array(100), aged: 0,
	drawnTo: -Infinity};

function send(message) {
	if (link.socket?.readyState !== 1) return 0;
	link.socket.send(JSON.stringify({id: ++link.id, ...message}));
	return link.id;
}

function ask(kind, wish) {
	const one = asks[kind];
	one.wish = wish ?? one.wish;
	if (one.id || one.wish === null) return;
	one.id = send({[kind]: one.wish});
	if (one.id) one.wish = null;
}

function answered(id) {
	for (const kind in asks) if (id && asks[kind].id === id) ask(kind, asks[kind].id = null);
}

function pickPart() {
	const covers = part && part.from <= view.from + 1e-9 && part.to >= view.to - 1e-9;
	if (part && !live) series = (covers ? part : whole).series;
}

function takePart(message) {
	part = readPart(message);
	if (!whole || part.from <= head.from && part.to >= head.to) whole = part;
	showProgress(message.done ?? 1);
	pickPart();
	arrange(); // the legend needs space for ±
}

// little-endian: u32 id, width, height, channels, f64 t, then bytes
function takePicture(buffer) {
	const at = new DataView(buffer), bytes = new Uint8Array(buffer, 24);
	const [id, width, height, channels] = [0, 4, 8, 12].map(i => at.getUint32(i, true));
	if (bytes.length && width * height * channels === bytes.length)
		link.picture = {width, height, channels, t: at.getFloat64(16, true), bytes};
	answered(id);
	wake();
}

const takers = {head: takeHead, part: takePart, state: takeStatus,
	live: ({t, tracks}) => wake(tracks.forEach((values, i) => series[i] &&
		values?.forEach((v, k) => push(series[i], t[k], v ?? NaN)))),
	event: event => wake(head.events = [...head.events, event].slice(-EVENTS_KEPT)),
	progress: done => [showProgress(done), setView(view.from, view.to)],
	ok: text => say(text), error: text => say(text, "ill")};

function receive({data}) {
	if (typeof data !== "string") return takePicture(data);
	const message = JSON.parse(data);
	for (const name in takers) if (message[name] !== undefined) takers[name](message[name]);
	answered(message.id);
}

function connect() {
	const [token, control] = (sessionStorage.getItem("incise") ?? "").split(".");
	const hint = "open the address that incise serve printed, with all that follows #";
	if (!token) return showState("no token", false, hint);
	const scheme = location.protocol === "https:" ? "wss" : "ws";
	const socket = link.socket = new WebSocket(`${scheme}://${location.host}/ws`);
	Object.assign(socket, {binaryType: "arraybuffer", onmessage: receive});
	socket.onopen = () => socket.send(JSON.stringify({token, control}));
	socket.onclose = ({code, reason}) => {
		link.socket = null;
		asks.get.id = asks.frame.id = 0;
		if (code === 1008) {
			sessionStorage.removeItem("incise");
			return showState("refused", false, `${reason || "not this token"}: ${hint}`);
		}
		showState("no connection", false, "trying again");
		for (const ring of live ? series : []) // a line across the outage would be a lie
			push(ring, newest() + 1e-6, NaN);
		setTimeout(connect, RETRY_MS[Math.min(link.tries++, RETRY_MS.length - 1)]);
	};
}

// A head that comes again, after a change or a new connection, keeps view, cursor and rings.
function takeHead(h) {
	const names = one => one?.kind + one?.tracks.map(t => t.label), same = names(head) === names(h);
	const wasWhole = !same || view.from <= head.from && view.to >= head.to;
	const events = same && live && !h.events?.length ? head.events : h.events ?? [];
	head = {cuts: [], panels: [], axis: {label: "time", unit: "s"}, ...h, events};
	live = head.kind === "live";
	const {path, tools = [], axis} = head;
	if (path?.t) Object.assign(path, {x: numbers(path.t), low: numbers(path.x), high: numbers(path.y),
		start: 0, count: path.t.length, mask: -1});
	document.title = `${head.title} · incise`;
	document.body.dataset.mode = head.kind;
	for (const name of ["title", "note"]) setText($(name), head[name] ?? "");
	$("control").hidden = !head.control;
	$("tool-label").hidden = !tools.length;
	$("tool").replaceChildren(...tools.map(name => make("option", name)));
	fillTable($("table"), head.table?.head, head.table?.rows ?? []);
	fillTable($("facts"), null, head.facts ?? []);
	keyButton("p").hidden = keyButton("n").hidden = !head.cuts.length;
	Object.assign(keyButton(" "), {textContent: live ? "freeze" : "play", hidden: axis.unit !== "s"});
	$("window").hidden = !live;
	if (!same) {
		part = whole = trail = hoverPx = span = null;
		series = live ? head.tracks.map(() => newRing(RING_SLOTS)) : [];
		playing = live;
		cursor = live ? null : head.cuts[0]?.[0] ?? head.from;
	}
	link.tries = 0;
	showState(live ? "live" : "", true);
	say("");
	arrange();
	if (live) return;
	setView(wasWhole ? head.from : view.from, wasWhole ? head.to : view.to);
	moveCursor(cursor);
}

// ---- keys and buttons ---------------------------------------------------------------------
// The page has the words for these in its list of keys.
const actions = {
	"ArrowLeft": event => stepBy(-1, event), "ArrowRight": event => stepBy(1, event),
	" ": () => setPlaying(!playing), "+": () => zoom(0.5), "-": () => zoom(2),
	"0": () => [freeze(), setView(limits().from, limits().to)],
	"Home": () => moveCursor(limits().from), "End": () => moveCursor(limits().to),
	"p": () => stepTo(head.cuts, -1, showCut), "n": () => stepTo(head.cuts, 1, showCut),
	",": () => stepTo(head.events, -1, ([x]) => moveCursor(x)),
	".": () => stepTo(head.events, 1, ([x]) => moveCursor(x)),
	"s": () => wake(selecting = !selecting),
	"[": () => setSpan(cursor, span ? span[1] : view.to),
	"]": () => setSpan(span ? span[0] : view.from, cursor),
	"z": () => span && setView(...span), "Escape": () => setSpan(null), "e": copyCommand,
	"?": () => $("keys").showModal(),
};

function pressKey(event) {
	const {key, target: {tagName}} = event, action = actions[{"=": "+", "_": "-"}[key] ?? key];
	if (!head || !action || event.ctrlKey || event.altKey || event.metaKey || $("keys").open ||
			["INPUT", "SELECT"].includes(tagName) ||
			key === " " && ["BUTTON", "SUMMARY"].includes(tagName))
		return;
	event.preventDefault();
	hoverPx = null;
	action(event);
}

// ---- pointers -----------------------------------------------------------------------------
// One pointer pans, scrubs on the axis or selects; two zoom. A press that does not move is a click.
const pointers = new Map();
let drag = null;

function pointerPlace({clientX, clientY}) {
	const {left, top} = canvasIn("stage").getBoundingClientRect();
	return [clientX - left, rows.findLast(row => clientY - top >= row.top)?.kind];
}

function startDrag(event) {
	if (!head || event.button) return;
	const [px, kind] = pointerPlace(event), selects = event.shiftKey || selecting;
	event.target.setPointerCapture(event.pointerId);
	pointers.set(event.pointerId, px);
	hoverPx = null;
	drag = {does: selects ? "select" : kind === "axis" ? "scrub" : "pan", px, x: toX(px),
		...view, moved: false, pinch: pointers.size === 2 && [...pointers.values()].map(toX)};
	if (drag.does === "scrub") moveCursor(toX(px));
}

function moveDrag(event) {
	const [px] = pointerPlace(event), all = head && limits();
	if (!pointers.has(event.pointerId)) {
		const over = head && event.pointerType === "mouse" && px >= LEFT && px <= LEFT + plotWidth;
		return wake(hoverPx = over ? px : null);
	}
	pointers.set(event.pointerId, px);
	drag.moved ||= Math.abs(px - drag.px) > 4;
	if (drag.moved) freeze();
	if (drag.pinch) {
		const [a, b] = pointers.values(), scale = (drag.pinch[1] - drag.pinch[0]) / (b - a);
		const from = drag.pinch[0] - (a - LEFT) * scale; // both places stay under their fingers
		if (scale > 0 && Math.abs(b - a) > 8) setView(from, from + plotWidth * scale);
	} else if (drag.does === "scrub")
		moveCursor(toX(px));
	else if (drag.moved && drag.does === "select")
		setSpan(clamp(drag.x, all.from, all.to), clamp(toX(px), all.from, all.to));
	else if (drag.moved) {
		const moved = (drag.px - px) / plotWidth * (drag.to - drag.from);
		setView(drag.from + moved, drag.to + moved);
	}
}

function endDrag(event) {
	if (!pointers.delete(event.pointerId) || !drag) return;
	const [px, kind] = pointerPlace(event), x = toX(px), {moved, pinch, does} = drag;
	drag = null;
	if (event.type !== "pointerup" || moved || pinch || does === "scrub") return;
	const cut = kind === "cuts" && head.cuts.find(([from, to]) => x >= from && x <= to);
	if (cut) setSpan(...cut);
	moveCursor(kind === "events" ? eventNear(x)?.[0] ?? x : x);
}

function turnWheel(event) {
	event.preventDefault();
	if (!head) return;
	freeze();
	const {deltaX, deltaY} = event, moved = deltaX / plotWidth * (view.to - view.from);
	const at = clamp(toX(pointerPlace(event)[0]), view.from, view.to);
	if (Math.abs(deltaX) > Math.abs(deltaY)) setView(view.from + moved, view.to + moved);
	else zoom(Math.exp(clamp(deltaY, -240, 240) / 400), at);
}

// ---- the clock ----------------------------------------------------------------------------
function wake() {
	if (asleep && head) requestAnimationFrame(draw);
	asleep &&= !head;
}

// The live window rolls with the newest sample. Where motion is to be reduced it stands still and
// fills from the left, and the next one starts when it is full.
function advance(now) {
	const still = matchMedia("(prefers-reduced-motion: reduce)").matches, x = newest();
	const to = still ? Math.ceil(x / windowS) * windowS : x;
	if (live) return x > -Infinity && Object.assign(view, {from: to - windowS, to});
	moveCursor(cursor + (now - playedAt) / 1000);
	playedAt = now;
	playing = cursor < head.to;
}

// How long ago the newest sample was taken, when it is first drawn: the median of the last 100.
function noteAge() {
	if (!live || !(newest() > link.drawnTo)) return;
	link.drawnTo = newest();
	link.ages[link.aged++ % 100] = Date.now() - 1000 * link.drawnTo;
	const ages = link.ages.slice(0, Math.min(link.aged, 100)).sort();
	document.body.dataset.behind = Math.round(ages[ages.length >> 1]);
}

function draw(now) {
	asleep = true;
	if (playing) advance(now);
	if (link.picture) drawPicture(link.picture);
	drawPlots();
	drawNearest();
	noteAge();
	if (!live) drawAbove();
	showView();
	speak();
}

function redraw() {
	readColours();
	if (head) arrange();
}

function listen() {
	Object.assign(canvasIn("stage"), {onpointerdown: startDrag, onpointermove: moveDrag,
		onpointerup: endDrag, onpointercancel: endDrag, onwheel: turnWheel,
		onpointerleave: () => wake(hoverPx = null)});
	document.onkeydown = pressKey;
	for (const button of document.querySelectorAll("[data-key]"))
		button.onclick = event => head && actions[button.dataset.key](event);
	$("window").onchange = () => setPlaying(true, windowS = Number($("window").value));
	$("copy").onclick = copyCommand;
	$("control").onsubmit = event => event.preventDefault();
	for (const one of $("control").querySelectorAll("[data-do]")) {
		const {do: does, field} = one.dataset, input = one.form.elements[field];
		one[one === input ? "onchange" : "onclick"] = () =>
			send({do: does, ...input && {[field]: input.value}});
	}
	matchMedia("(prefers-color-scheme: dark)").onchange = redraw;
	new ResizeObserver(redraw).observe($("stage"));
}

function start() {
	readColours();
	listen();
	const text = $("document").textContent.trim(), own = text && JSON.parse(text);
	const load = src => Object.assign(new Image(), {src, onload: wake});
	frames = (own.frames ?? []).map(([t, src]) => [t, load(src)]);
	if (own) return takeHead(own.head), takePart(own.part);
	if (location.hash.length > 1) {
		sessionStorage.setItem("incise", decodeURIComponent(location.hash.slice(1)));
		history.replaceState(null, "", location.pathname + location.search);
	}
	onhashchange = () => location.reload();
	connect();
}

start();
