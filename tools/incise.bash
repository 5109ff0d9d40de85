# SPDX-License-Identifier: GPL-2.0-or-later
# bash completion for incise. `incise --complete WORD…` prints the words that may replace the last
# one, from the tables of --help, so that nothing is listed here; tools/cli/complete.h documents the
# form of its output.
# shellcheck shell=bash

_incise()
{
	local line glob word words=() values=() globs=() text=${COMP_LINE:0:COMP_POINT}
	local -A seen=()

	# The words as the shell would pass them: COMP_WORDS has "--rig=sim:a" in pieces.
	# shellcheck disable=SC2162 # a blank behind a backslash is part of a word
	read -a words <<<"$text"
	[[ $text != *[[:space:]] ]] || words+=("")
	word=${words[-1]}
	COMPREPLY=()
	while IFS= read -r line; do
		case $line in
		:nospace) compopt -o nospace 2>/dev/null || : ;; # outside of a completion: a test
		:files) globs+=("*") ;;
		:files\ *) read -ra values <<<"${line#:files }"; globs+=("${values[@]}") ;;
		:folders) globs+=("") ;;
		*)
			line=${line%%$'\t'*}
			[[ $line != "$word"* ]] || COMPREPLY+=("$line")
			;;
		esac
	done < <("${words[0]}" --complete "${words[@]:1}" 2>/dev/null)
	# Files that match, and folders on the way to them; any file where none does.
	word=${word#--*=}
	if ((${#globs[@]})); then
		compopt -o filenames 2>/dev/null || :
		mapfile -t values < <(
			for glob in "${globs[@]}"; do
				[[ -z $glob ]] || compgen -f -X "!$glob" -- "$word"
			done
			compgen -d -- "$word"
		)
		((${#values[@]} + ${#COMPREPLY[@]})) || [[ -z ${globs[*]} ]] ||
			mapfile -t values < <(compgen -f -- "$word")
		for line in "${values[@]}"; do
			[[ -n ${seen[$line]} ]] || COMPREPLY+=("$line")
			seen[$line]=1
		done
	fi
	# bash replaces only what follows the last "=" or ":" of the word.
	word=${words[-1]}
	word=${word%"${word##*[=:]}"}
	[[ -z $word || $COMP_WORDBREAKS != *:* ]] || COMPREPLY=("${COMPREPLY[@]#"$word"}")
	return 0
}

complete -F _incise incise
