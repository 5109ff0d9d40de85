// SPDX-License-Identifier: GPL-2.0-or-later
// The search of the site: search.js, which is loaded at the first key, has title, address and text of each section.
"use strict";
const up = document.currentScript.dataset.up;
const input = document.querySelector("header input");
const found = document.getElementById("site-found");
let index;

function load() {
	index ??= new Promise(done => {
		const script = document.createElement("script");
		script.src = up + "search.js";
		script.onload = () => done(sections.map(([title, address, text]) =>
			({title, address, text, low: (title + " " + text).toLowerCase()})));
		document.head.append(script);
	});
	return index;
}

// Every word has to be there; a title with all of them comes first, then the place of the first word.
function matches(all, words) {
	const rank = s => {
		const title = s.title.toLowerCase();
		return words.reduce((sum, word) => sum + (title.includes(word) ? 2 : 0) + (title.endsWith(word) ? 1 : 0), 0);
	};
	return all.filter(s => words.every(word => s.low.includes(word))).map(s => [rank(s), s])
		.sort((a, b) => b[0] - a[0]).slice(0, 20).map(([, s]) => s);
}

function excerpt(text, word) {
	const at = Math.max(0, text.toLowerCase().indexOf(word) - 60);
	return (at ? "…" : "") + text.slice(at, at + 180) + (text.length > at + 180 ? "…" : "");
}

async function search() {
	const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
	const hits = words.length ? matches(await load(), words) : [];
	found.hidden = !words.length;
	found.replaceChildren(...hits.map(s => {
		const p = document.createElement("p");
		const a = document.createElement("a");
		const span = document.createElement("span");
		a.href = up + s.address;
		a.textContent = s.title;
		span.textContent = excerpt(s.text, words[0]);
		p.append(a, span);
		return p;
	}));
	if (words.length && !hits.length)
		found.textContent = "No section has all these words.";
}

input.addEventListener("input", search);
