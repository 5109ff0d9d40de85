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
