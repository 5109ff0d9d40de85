# SPDX-License-Identifier: GPL-2.0-or-later
# Pages as Chromium shows them: `load browser`.
# shellcheck shell=bash

browser() {
	command -v chromium >/dev/null || skip "chromium is not installed"
	chromium --headless=new --no-sandbox --disable-gpu --hide-scrollbars --no-first-run \
		--user-data-dir="$PWD/profile" --enable-logging=stderr --force-prefers-reduced-motion \
		"$@" 2>said || complain "chromium: $(tail -n 3 said)"
}

# The page as it is, with a script that has it say how it came out.
asked() { # PAGE
	sed '/<\/main>/r /dev/stdin' "$1" <<-'EOF'
		<script>
		addEventListener("load", () => {
			const small = [...document.querySelectorAll("p, li, td, th, figcaption, pre")]
				.filter(e => parseFloat(getComputedStyle(e).fontSize) < 16).length;
			const blank = [...document.images].filter(image => {
				const canvas = document.createElement("canvas");
				canvas.width = 300;
				canvas.height = 300;
				const context = canvas.getContext("2d");
				context.drawImage(image, 0, 0, 300, 300);
				return new Set(new Uint32Array(
					context.getImageData(0, 0, 300, 300).data.buffer)).size < 20;
			}).length;
			const broken = [...document.querySelectorAll('a[href^="#"]')]
				.filter(a => !document.getElementById(a.hash.slice(1))).length;
			const ids = [...document.querySelectorAll("[id]")].map(e => e.id);
			// boxes with more in them than they show, which would scroll sideways
			const wide = [...document.querySelectorAll("body, body *")]
				.filter(e => getComputedStyle(e).display != "inline" &&
					e.scrollWidth > e.clientWidth + 1).length;
			// cells that show the name of their column
			const named = [...document.querySelectorAll("td")].filter(e =>
				getComputedStyle(e, "::before").content.startsWith('"') &&
				e.dataset.label == e.closest("table").querySelectorAll("th")
					[e.cellIndex].textContent.trim()).length;
			parent.postMessage([innerWidth, document.documentElement.scrollWidth,
				small, document.images.length, blank, broken,
				ids.length - new Set(ids).size, wide, named,
				document.querySelectorAll("td").length].join(" "), "*");
		});
		</script>
	EOF
}

# It prints, of a page in a frame of that width: the widths of both, the numbers of small texts, of
# images, of blank ones, of links into the page that lead nowhere, of identifiers that are there
# twice, of boxes that scroll sideways, of cells with the name of their column, and of cells. A
# window is no narrower than 500 pixels; a frame may be.
shown_in() { # WIDTH PAGE
	asked "$2" >asked.html
	cat >frame.html <<-EOF
		<script>addEventListener("message",
			e => document.body.dataset.asked = e.data);</script>
		<body><iframe src="asked.html" style="width:$1px;height:844px;border:0">
	EOF
	browser --virtual-time-budget=10000 --dump-dom "file://$PWD/frame.html" >dom
	! grep CONSOLE said || return
	grep -oE 'data-asked="[^"]*' dom | cut -d'"' -f2
}
