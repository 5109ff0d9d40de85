# SPDX-License-Identifier: GPL-2.0-or-later
# Colour on a terminal, and only there: errors, warnings, the states of incise doctor.

load cli

bold=$'\e[1m' red=$'\e[1;31m' yellow=$'\e[1;33m' green=$'\e[32m' plain=$'\e[0m'

setup() {
	work_folder
	unset NO_COLOR
	export TERM=xterm
}

# The command on a terminal, its streams of these numbers.
on_terminal() { # STREAMS COMMAND…
	python3 "$root/tests/cli/terminal.py" "$@"
}

# bats test_tags=check
@test "an error has a red prefix on a terminal, and the same text without colour in a pipe" {
	run -1 on_terminal 2 incise info none.rec
	[[ "$output" == "${red}incise info:$plain none.rec: "* ]]
	coloured=$output
	run -1 --separate-stderr incise info none.rec
	[[ "$stderr" == "incise info: none.rec: "* ]]
	[ "$(sed 's/\x1b\[[0-9;]*m//g' <<<"$coloured")" = "$stderr" ]
	# incise itself, and bad usage
	run -2 on_terminal 2 incise nosuch
	[ "$output" = "${red}incise:$plain 'nosuch': no such command; 'incise --help' lists them" ]
	run -2 on_terminal 2 incise train --nosuch
	[ "${lines[0]}" = "${red}incise train:$plain --nosuch: no such option" ]
	[ "${lines[1]}" = "Try 'incise train --help'." ]
}

@test "a warning has a bold prefix and a yellow word" {
	made_pairs | head -n 101 >few.csv
	train=(incise train few.csv -o model.fis --epochs 1 --overwrite)
	run -0 --separate-stderr "${train[@]}"
	[[ "$stderr" == *"incise train: warning: 100 training pairs for "* ]]
	plainly=$stderr
	run -0 --separate-stderr on_terminal 2 "${train[@]}"
	[[ "$output" == *"${bold}incise train:$plain ${yellow}warning:$plain 100 training pairs for "* ]]
	[[ "$(sed 's/\x1b\[[0-9;]*m//g' <<<"$output")" == *"$plainly"* ]]
}

# bats test_tags=check
@test "NO_COLOR, TERM=dumb and no TERM turn colour off" {
	export NO_COLOR=1
	run -1 on_terminal 2 incise info none.rec
	[[ "$output" == "incise info: none.rec: "* ]]
	# as no-color.org has it: empty is not set
	export NO_COLOR=
	run -1 on_terminal 2 incise info none.rec
	[[ "$output" == "${red}incise info:$plain "* ]]
	unset NO_COLOR
	export TERM=dumb
	run -1 on_terminal 2 incise info none.rec
	[[ "$output" == "incise info: none.rec: "* ]]
	unset TERM
	run -1 on_terminal 2 incise info none.rec
	[[ "$output" == "incise info: none.rec: "* ]]
}

@test "doctor's states are coloured on a terminal" {
	printf 'tracker = "tty:/dev/none:115200";\nforce = "sim:";\n' >rig.conf
	run -1 --separate-stderr on_terminal 1 incise doctor
	[[ "$output" == *"  ${green}ok      $plain rig "* ]]
	[[ "$output" == *"  ${red}problem $plain tracker "* ]]
	[[ "$output" == *"  ${yellow}warning $plain file "* ]]
	# colour is of each stream by itself
	run -1 --separate-stderr on_terminal 2 incise doctor
	[[ "$output" != *$'\e'* ]]
}
