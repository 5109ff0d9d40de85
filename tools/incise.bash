# SPDX-License-Identifier: GPL-2.0-or-later
# bash completion for incise. Verbs and options are what the programs say of themselves
# when a word is completed, so there is no list here to keep.
# shellcheck shell=bash

# The verbs of `incise --help`.
_incise_verbs()
{
	"$1" --help 2>/dev/null | awk '
		/^Commands:/ { list = 1; next }
		list && /^  [a-z]/ { print $1; next }
		{ list = 0 }'
}

# The options of `incise VERB [WORD] --help`: the words with dashes that begin a line.
_incise_options()
{
	"$@" --help 2>/dev/null | awk '
		/^Options:/ { list = 1; next }
		/^[^ ]/ { list = 0 }
		list && /^ +-/ {
			sub(/  [^ -].*/, "")
			while (match($0, /(^|[ ,])--?[a-zA-Z][a-z-]*/)) {
				option = substr($0, RSTART, RLENGTH)
				gsub(/[ ,]/, "", option)
				print option
				$0 = substr($0, RSTART + RLENGTH)
			}
		}'
}

# The choices of a command, where its usage line lists words: "bench precision [FILE] | …", or the
# beginning of one, "can:IFACE"; and FILE, in capitals, where it lists others than words.
_incise_words()
{
	"$1" "$2" --help 2>/dev/null | awk '
		NR == 1 && sub(/^Usage: incise [a-z]+ /, "") {
			n = split($0, part, "|")
			for (i = 1; i <= n; i++) {
				split(part[i], word, " ")
				if (word[1] ~ /^[a-z]+:/)
					sub(/:.*/, ":", word[1])
				print word[1] ~ /^[a-z]+:?$/ ? word[1] : "FILE"
			}
		}'
}

_incise_files()
{
	compopt -o filenames 2>/dev/null || : # not within a completion: a test
	mapfile -t COMPREPLY < <(compgen -f -- "$1")
}

# Words that may follow "can:", which bash takes for two words: interfaces of CAN (280 in
# linux/if_arp.h); and "slcan:": serial adapters.
_incise_buses()
{
	local type

	case $1 in
	can)
		for type in "${INCISE_SYS:-/sys}"/class/net/*/type; do
			[ "$(cat "$type" 2>/dev/null)" != 280 ] ||
				basename "$(dirname "$type")"
		done ;;
	slcan) compgen -G "/dev/ttyACM*"; compgen -G "/dev/ttyUSB*" ;;
	esac
}

# Loops that told their state here.
_incise_loops()
{
	local page

	for page in /run/incise/*.state ${XDG_RUNTIME_DIR:+"$XDG_RUNTIME_DIR"/incise/*.state}; do
		[ ! -f "$page" ] || basename "$page" .state
	done
}

_incise()
{
	local word=${COMP_WORDS[COMP_CWORD]}
	local program=${COMP_WORDS[0]} verb=${COMP_WORDS[1]} words= part=()

	COMPREPLY=()
	if ((COMP_CWORD == 1)); then
		mapfile -t COMPREPLY < <(compgen -W \
			"$(_incise_verbs "$program") help --help --version" -- "$word")
	elif [[ $verb == help ]]; then
		mapfile -t COMPREPLY < <(compgen -W "$(_incise_verbs "$program")" -- "$word")
	elif [[ $verb == info && ${COMP_WORDS[3]} == : ]]; then
		mapfile -t COMPREPLY < <(compgen -W "$(_incise_buses "${COMP_WORDS[2]}")" \
			-- "${word#:}")
	elif [[ $word == -* ]]; then
		# each word of calibrate, and two of bench, is a program of its own
		[[ $verb != calibrate && ! "$verb ${COMP_WORDS[2]}" =~ ^bench\ (view|all)$ ||
			${COMP_WORDS[2]} == -* ]] || part=("${COMP_WORDS[2]}")
		mapfile -t COMPREPLY < <(compgen -W \
			"$(_incise_options "$program" "$verb" "${part[@]}")" -- "$word")
	else
		((COMP_CWORD > 2)) || words=$(_incise_words "$program" "$verb")
		[[ $verb != status ]] || words="FILE $(_incise_loops)"
		if [[ $verb == tool ]]; then
			words="FILE $(_incise_loops)"
			((COMP_CWORD == 2)) || words="blade handle tube auto"
		fi
		[[ $words != *FILE* ]] || _incise_files "$word"
		mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -W \
			"${words//FILE/}" -- "$word")
		((${#COMPREPLY[@]})) || _incise_files "$word"
		[[ "${COMPREPLY[*]}" != *: ]] || compopt -o nospace 2>/dev/null || :
	fi
}

complete -F _incise incise
