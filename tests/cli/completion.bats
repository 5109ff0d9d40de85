# SPDX-License-Identifier: GPL-2.0-or-later
# Completion in bash and zsh, tools/incise.bash and tools/_incise: what they offer after a tab, by
# `incise --complete`.

load cli

setup() {
	work_folder
	# shellcheck source=../../tools/incise.bash
	source "$root/tools/incise.bash"
}

# complete_words WORD… : what bash offers for the last word.
complete_words() {
	COMP_LINE=$(printf '%s ' "${@// /\\ }")
	COMP_LINE=${COMP_LINE% }
	[ -n "${*: -1}" ] || COMP_LINE="${*:1:$#-1} "
	COMP_POINT=${#COMP_LINE}
	COMPREPLY=()
	_incise
}

# offers TEXT WORD…: these are all that it offers.
offers() {
	complete_words "${@:2}"
	[[ "${COMPREPLY[*]}" == "$1" && (-n "$1" || "${#COMPREPLY[@]}" -eq 0) ]] ||
		complain "$*: ${COMPREPLY[*]}"
}

sorted() {
	printf '%s\n' "${COMPREPLY[@]}" | LC_ALL=C sort | tr '\n' ' ' | sed 's/ $//'
}

@test "bash completes incise" {
	[[ "$(complete -p incise)" == *"-F _incise incise" ]]
}

# bats test_tags=check
@test "commands are completed, and topics of help" {
	complete_words incise ""
	for verb in $({ incise --help && incise help advanced; } | awk '/^  [a-z]/ { print $1 }') help --help --version; do
		[[ " ${COMPREPLY[*]} " == *" $verb "* ]] || complain "no $verb"
	done
	offers train incise tr
	offers eval incise help ev
	offers "rig.conf" incise help rig
	offers "" incise nosuch
	offers "" incise nosuch --
}

# That each command offers its options and their values is in option_tables.py.
# bats test_tags=check
@test "options and values, as bash takes the words apart" {
	offers "--mf" incise train --m
	# letters, too
	complete_words incise train -
	[[ " ${COMPREPLY[*]} " == *" -o "* ]]
	offers fifo incise haptic neck --policy f
	offers "idle cpu memory disk view" incise bench loop --load ""
	# lists: the item behind the last comma
	offers loop,stability incise bench all --only loop,stab
	# as bash takes "--policy=fi" apart
	offers fifo incise haptic neck --policy=fi
	# a number has none
	offers "" incise train --epochs ""
}

# bats test_tags=check
@test "operands are completed as the synopsis has them" {
	offers "force depth tip delay stepper frame torque check" incise calibrate ""
	offers "two-point line board" incise calibrate depth ""
	complete_words incise bench ""
	[ "${COMPREPLY[*]}" = "$(incise bench --help | awk '/^  [a-z]/ { printf "%s ", $1 } /^compare/ { print $1; exit }')" ]
	offers stability incise bench st
	offers move incise stepper mo
	offers "" incise stepper move ""
	offers "blade handle tube auto" incise tool neck ""
	# options in between are no operands, and their arguments neither
	offers tube incise tool --json neck tu
	complete_words incise replay -o ticks.csv a.rec ne
	[[ " ${COMPREPLY[*]} " == *" neck "* ]]
}

# bats test_tags=check
@test "scenes are those of the folder and the installed ones" {
	touch mine.scene
	complete_words incise haptic ""
	for scene in mine liver neck wall mine.scene; do
		[[ " ${COMPREPLY[*]} " == *" $scene "* ]]
	done
	offers "mine mine.scene" incise plan mi
	offers neck incise bench scenes liver ne
}

# bats test_tags=check
@test "recordings, calibrations, models and data are files with such names" {
	touch pairs.csv "two words.csv" my.conf m.fis m.fx p.plan old.json s.session
	mkdir cuts.rec folder
	complete_words incise verify ""
	[ "$(sorted)" = "cuts.rec folder" ]
	complete_words incise export cuts.rec -c ""
	[ "$(sorted)" = "cuts.rec folder my.conf" ]
	complete_words incise haptic neck --model m
	[ "$(sorted)" = "m.fis m.fx" ]
	complete_words incise train pa
	[ "$(sorted)" = pairs.csv ]
	complete_words incise train tw
	[ "${COMPREPLY[0]}" = "two words.csv" ]
	complete_words incise train "two words.csv" --check 0.3 --js
	[ "$(sorted)" = --json ]
	complete_words incise bench compare old.json o
	[ "$(sorted)" = old.json ]
	complete_words incise assess ""
	[ "$(sorted)" = "cuts.rec folder s.session" ]
	complete_words incise info m
	[ "$(sorted)" = "m.fis m.fx" ]
	complete_words incise bench all -o ""
	[ "$(sorted)" = "cuts.rec folder" ]
	# where none has such a name, any file
	complete_words incise train m.f
	[ "$(sorted)" = "m.fis m.fx" ]
}

# bats test_tags=check
@test "rigs are files, and keys of the simulated one" {
	touch rig.conf
	complete_words incise capture --rig ""
	[ "$(sorted)" = "rig.conf sim: sim:clock=simulated" ]
	# behind the colon, as bash takes it apart
	complete_words incise capture --rig sim:se
	[ "$(sorted)" = "seed=" ]
	complete_words incise capture --rig sim:seed=7,clo
	[ "$(sorted)" = "7,clock=" ]
	COMP_WORDBREAKS=${COMP_WORDBREAKS//[:=]/}
	complete_words incise capture --rig sim:se
	[ "$(sorted)" = "sim:seed=" ]
}

@test "loops are those that have a page here" {
	mkdir -p run/incise
	touch run/incise/neck.state run/incise/nose.state nest.state
	export XDG_RUNTIME_DIR=$PWD/run
	for command in status tool; do
		complete_words incise $command ne
		[ "${COMPREPLY[*]}" = "neck nest.state" ] || complain "$command: ${COMPREPLY[*]}"
	done
}

@test "buses of info are completed: their word, then what there is of them" {
	offers can: incise info can
	offers slcan: incise info sl
	offers "" incise info slcan:/dev/ttyNONE
	unshare -rm true 2>/dev/null || skip "no user namespaces"
	mkdir -p net/{can0,can1,eth0,vcan0}
	echo 280 | tee net/{can0,can1,vcan0}/type
	echo 1 >net/eth0/type
	run -0 unshare -rm sh -c "mount --bind net /sys/class/net && incise --complete info can:"
	[ "$(grep ^can: <<<"$output" | cut -f1 | tr '\n' ' ')" = "can:can0 can:can1 can:vcan0 " ]
}

# bats test_tags=check
@test "completion starts nothing and writes nothing" {
	touch calibration.conf
	for program in "$INCISE_BUILD"/bin/incise-*; do
		"$program" --complete "" >/dev/null
		"$program" --complete -o new --rig sim: "" >/dev/null
	done
	[ "$(ls -A)" = calibration.conf ]
	# nor has an error an output
	run -0 --separate-stderr incise --complete export a.rec --average x --nosuch ""
	[ -z "$stderr" ]
	run -0 --separate-stderr incise --complete
	[ -z "$stderr" ]
}

# Type keys at a shell on a terminal, and print what is there after each tab. \t is a tab.
typed_at() { # SHELL… -- SETUP KEYS
	python3 - "$@" <<-'END'
		import os, pty, select, sys, time
		split = sys.argv.index("--")
		shell, (setup, keys) = sys.argv[1:split], sys.argv[split + 1:]
		pid, fd = pty.fork()
		if pid == 0:
		    os.environ.update(TERM="dumb", PS1="> ")
		    os.execvp(shell[0], shell)

		def until(text, seconds=60):
		    """What comes up to a text; all of it where that does not come."""
		    got, end = b"", time.monotonic() + seconds
		    while text not in got and time.monotonic() < end:
		        if select.select([fd], [], [], 0.1)[0]:
		            try:
		                got += os.read(fd, 65536)
		            except OSError:
		                break
		    return got

		# What the shell echoes of the setup has a quote where the prompt has none.
		os.write(fd, setup.encode() + b"; PS1='read''y> '\n")
		until(b"\nready> ")
		keys, want = keys.split("=>")
		os.write(fd, keys.replace("\\t", "\t").encode())
		text = until(want.encode())
		os.write(fd, b"\x15exit\n")
		os.close(fd)
		os.waitpid(pid, 0)
		sys.exit(want not in text.decode(errors="replace") and repr(text))
	END
}

@test "a tab in bash completes" {
	typed_at bash --norc -i -- "source '$root/tools/incise.bash'" 'incise verif\t=>verify '
	typed_at bash --norc -i -- "source '$root/tools/incise.bash'" 'incise haptic neck --policy=fi\t=>--policy=fifo '
	typed_at bash --norc -i -- "source '$root/tools/incise.bash'" 'incise capture --rig sim:see\t=>sim:seed='
}

@test "a tab in zsh completes, with descriptions" {
	command -v zsh >/dev/null || skip "zsh is not installed"
	touch "two words.csv"
	begin="unsetopt zle_bracketed_paste prompt_cr prompt_sp 2>/dev/null; fpath=('$root/tools' \$fpath); autoload -U compinit; compinit -u -D; stty cols 200 rows 100"
	while IFS= read -r keys; do
		typed_at zsh -f -i -- "$begin" "$keys"
	done <<-'END'
		incise verif\t=>verify 
		incise train --search ty\t=>type=
		incise haptic neck --policy=fi\t=>--policy=fifo 
		incise capture --rig sim:see\t=>sim:seed=
		incise train two\t=>two\ words.csv 
		incise bench stab\t=>stability 
		incise plan ne\t=>neck 
		incise calibrate dep\t=>depth 
		incise train --shar\t=>--share 
		incise ex\t=>export 
		incise train --se\t\t=>random choice
	END
}
