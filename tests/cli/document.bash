# SPDX-License-Identifier: GPL-2.0-or-later
# Files and commands that a document asks its reader to write and to run: `load document`. A
# comment in the line before a block's fence marks it, <!-- file: NAME --> or <!-- WORD -->.
# shellcheck shell=bash

# The block that is to be a file.
file_in() { # DOCUMENT NAME
	awk -v mark="<!-- file: $2 -->" '
		marked && /^```/ { if (inside) exit; inside = 1; next }
		inside { print }
		$0 == mark { marked = 1 }' "$1"
}

# The commands of all blocks with that mark, in order.
commands_in() { # DOCUMENT WORD
	awk -v mark="<!-- $2 -->" '
		/^```/ { if (inside) { inside = marked = 0 } else inside = marked; next }
		inside { print }
		{ if (!inside) marked = $0 == mark }' "$1"
}

# Every `incise …` that a document tells its reader to type: a line each, without what comes
# before and behind it in a pipe or a list. Of Markdown its shell blocks and the code in its
# tables, of a manual page its displays, of a help text its examples; long lines are joined,
# comments dropped.
typed_in() { # DOCUMENT
	case $1 in
	*.md)
		awk '
			/^```/ { inside = !inside && /^```sh/; next }
			inside { print; next }
			/^\|/ { n = split($0, part, "`"); for (i = 2; i < n; i += 2) print part[i] }' "$1"
		;;
	*.help) sed -nE '/^Examples?:/,/^$/p' "$1" ;;
	*)
		awk '
			/^\.Dl / { print substr($0, 5); next }
			/^\.Bd -literal/ { inside = 1; next }
			/^\.Ed/ { inside = 0 }
			inside { print }' "$1" | sed 's/\\e/\\/g; s/\\-/-/g; s/\\&//g; s/\\ / /g'
		;;
	esac | sed -e ':join' -e '/\\$/{N;s/\\\n[[:space:]]*/ /;b join' -e '}' |
		sed -E 's/(^|[[:space:]])#.*//; s/&&|\|\||[|;&]/\n/g' |
		sed -nE 's/^[[:space:]]*(\$ +)?(sudo +)?(perf stat +)?(incise [a-z].*)/\4/p' |
		sed -E 's/[0-9]*[<>].*//; s/[[:space:]]+$//'
}
