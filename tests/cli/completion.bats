# SPDX-License-Identifier: GPL-2.0-or-later
# tools/incise.bash: what bash offers after a tab.

load cli

setup() {
	work_folder
	# shellcheck source=../../tools/incise.bash
	source "$root/tools/incise.bash"
}

# complete_words WORD… : what is offered for the last word.
complete_words() {
	COMP_WORDS=("$@")
	COMP_CWORD=$(($# - 1))
	COMPREPLY=()
	_incise
}

@test "bash knows what completes incise" {
	[[ "$(complete -p incise)" == *"-F _incise incise" ]]
}

@test "verbs are completed" {
	complete_words incise ""
	for verb in capture verify export train eval info plot haptic status tool view assess replay bench demo help; do
		[[ " ${COMPREPLY[*]} " == *" $verb "* ]]
	done
	complete_words incise tr
	[ "${COMPREPLY[*]}" = train ]
	complete_words incise help ev
	[ "${COMPREPLY[*]}" = eval ]
	complete_words incise nosuch
	[ "${#COMPREPLY[@]}" -eq 0 ]
}

@test "options are those of --help" {
	complete_words incise train --m
	[ "${COMPREPLY[*]}" = "--mf --mf-type" ]
	complete_words incise haptic --lo
	[ "${COMPREPLY[*]}" = --log ]
	for verb in capture verify export train eval info plot haptic status tool assess replay stepper bench demo; do
		complete_words incise "$verb" --
		for option in "${COMPREPLY[@]}"; do
			"incise-$verb" --help | grep -qE -- "^ .*$option( |\$)"
		done
		[[ " ${COMPREPLY[*]} " == *" --help "* ]]
		# not one is missing
		[ "${#COMPREPLY[@]}" -eq "$("incise-$verb" --help |
			grep -cE '^  (-[A-Za-z],|   ) --[a-z]')" ]
	done
}

@test "words of calibrate are completed, and the options of each" {
	complete_words incise calibrate ""
	[ "${COMPREPLY[*]}" = "force depth tip delay stepper check" ]
	complete_words incise calibrate st
	[ "${COMPREPLY[*]}" = stepper ]
	complete_words incise calibrate --h
	[ "${COMPREPLY[*]}" = --help ]
	for program in "$root"/tools/incise-calibrate-*.c; do
		[ -e "$program" ] || continue
		word=$(basename "$program" .c)
		complete_words incise calibrate "${word##*-}" --
		[ "${#COMPREPLY[@]}" -eq "$("$word" --help |
			grep -cE '^  (-[A-Za-z],|   ) --[a-z]')" ]
	done
}

@test "loops that told their state are completed, beside files" {
	mkdir -p run/incise
	touch run/incise/neck.state run/incise/nose.state nest.state
	export XDG_RUNTIME_DIR=$PWD/run
	complete_words incise status ne
	[ "${COMPREPLY[*]}" = "nest.state neck" ]
	complete_words incise tool ne
	[ "${COMPREPLY[*]}" = "nest.state neck" ]
	complete_words incise tool neck ""
	[ "${COMPREPLY[*]}" = "blade handle tube auto" ]
	complete_words incise tool neck tu
	[ "${COMPREPLY[*]}" = tube ]
}

@test "what bench measures is completed" {
	touch stale.csv
	complete_words incise bench ""
	[ "${COMPREPLY[*]}" = "precision training stability loop pose timeline vision capture scenes integers extremes view all compare" ]
	complete_words incise bench st
	[ "${COMPREPLY[*]}" = stability ]
	complete_words incise bench precision st
	[ "${COMPREPLY[*]}" = stale.csv ]
}

@test "commands of stepper are completed, and the word beside files of info" {
	touch stale.csv
	complete_words incise stepper ""
	[ "${COMPREPLY[*]}" = "status enable disable move jog home clear" ]
	complete_words incise stepper mo
	[ "${COMPREPLY[*]}" = move ]
	complete_words incise info st
	[ "${COMPREPLY[*]}" = "stale.csv stepper" ]
	complete_words incise info stepper st
	[ "${COMPREPLY[*]}" = stale.csv ]
	complete_words incise info dev
	[ "${COMPREPLY[*]}" = devices ]
}

@test "buses of info are completed: their word, then what there is of them" {
	complete_words incise info can
	[ "${COMPREPLY[*]}" = can: ]
	complete_words incise info sl
	[ "${COMPREPLY[*]}" = slcan: ]
	# as bash takes "can:can" apart
	export INCISE_SYS=$PWD/sys
	mkdir -p sys/class/net/{can0,can1,eth0,vcan0}
	echo 280 | tee sys/class/net/{can0,can1,vcan0}/type
	echo 1 >sys/class/net/eth0/type
	complete_words incise info can :
	[ "${COMPREPLY[*]}" = "can0 can1 vcan0" ]
	complete_words incise info can : can
	[ "${COMPREPLY[*]}" = "can0 can1" ]
	complete_words incise info can : x
	[ "${#COMPREPLY[@]}" -eq 0 ]
	complete_words incise info slcan : /dev/ttyNONE
	[ "${#COMPREPLY[@]}" -eq 0 ]
}

@test "files are completed otherwise" {
	touch data.csv "two words.csv"
	mkdir data.rec
	complete_words incise train da
	[ "${COMPREPLY[*]}" = "data.csv data.rec" ] || [ "${COMPREPLY[*]}" = "data.rec data.csv" ]
	complete_words incise train two
	[ "${COMPREPLY[0]}" = "two words.csv" ]
	complete_words incise train -o da
	[ "${#COMPREPLY[@]}" -eq 2 ]
}

@test "options of a verb that does not exist are none" {
	complete_words incise nosuch --
	[ "${#COMPREPLY[@]}" -eq 0 ]
}
