# SPDX-License-Identifier: GPL-2.0-or-later
# README: short, and its blocks run as typed and print what it shows.

load cli
load document

@test "README has at most 600 words" {
	[ "$(wc -w <"$root/README.md")" -le 600 ] || complain "$(wc -w <"$root/README.md") words"
}

# The numbers of a text with two digits: the last ones depend on the C library.
rounded() {
	awk '{ line = ""
		while (match($0, /[0-9]+\.[0-9]+(e[-+]?[0-9]+)?/)) {
			line = line substr($0, 1, RSTART - 1) sprintf("%.2g", substr($0, RSTART, RLENGTH))
			$0 = substr($0, RSTART + RLENGTH)
		}
		print line $0 }'
}

# The marks path and session are run here, wheel by tests/wheel/inside, container and source by the tests of
# those ways on an empty Debian.
@test "each block of README is one that a test runs" {
	[ "$(grep -cx '```sh' "$root/README.md")" -ge 5 ]
	awk '/^```sh/ { print mark } { mark = $0 }' "$root/README.md" >marks
	run ! grep -vxE '<!-- (path|session|wheel|container|source) -->' marks
	for mark in path session wheel container source; do
		grep -qx -- "<!-- $mark -->" marks || complain "no block $mark"
	done
	# The targets of make that it names are there.
	grep -oE 'make [a-z-]+' "$root/README.md" | sort -u >targets
	[ "$(wc -l <targets)" -ge 4 ]
	while read -r _ target; do
		make -C "$root" help | grep -q "^$target " || complain "make has no target $target"
	done <targets
}

@test "README's session runs as typed, and prints the lines that are shown" {
	ln -s "$INCISE_BUILD" build
	commands_in "$root/README.md" path >session
	grep -q 'build/bin' session
	commands_in "$root/README.md" session >>session
	[ "$(grep -c '^incise ' session)" -ge 3 ]
	sed -i 's/#.*//' session
	run -0 bash -euo pipefail session
	rounded <<<"$output" >printed
	commands_in "$root/README.md" "output of session" | rounded >shown
	[ "$(wc -l <shown)" -ge 3 ]
	while IFS= read -r line; do
		grep -qxF -- "$line" printed || complain "not printed: $line"
	done <shown
}

@test "the documents that are installed are those of doc/" {
	cd "$root"
	make -s -n install DESTDIR=/nowhere O="$INCISE_BUILD" >"$BATS_TEST_TMPDIR/installed" 2>/dev/null
	for document in doc/*.md doc/*.svg doc/*.png; do
		case $document in
		doc/reference.md) continue ;; # part of the reference of the headers
		esac
		grep -q -- "$document" "$BATS_TEST_TMPDIR/installed" ||
			complain "$document is not installed"
	done
}

@test "CITATION.cff names this version" {
	grep -qx "version: $(incise info --version | cut -d' ' -f2)" "$root/CITATION.cff"
}
