# SPDX-License-Identifier: GPL-2.0-or-later
# One option has one name and one meaning in all commands: the dictionary doc/options.md.

load cli

setup() {
	work_folder
}

@test "every option of every command is in the dictionary, and nothing else is" {
	run -0 python3 "$root/tests/cli/options.py" "$root/doc/options.md" "$INCISE_BUILD"/bin/incise-*
	[ -z "$output" ]
}

@test "a dictionary that differs from the commands is found" {
	sed '/`--max-delay`/d; s/`-o, --output`/`-O, --output`/; s/^\(.*`--target`.*\)train/\1eval/' \
		"$root/doc/options.md" >wrong.md
	echo '| `--frob` | | does nothing | train |' >>wrong.md
	run -1 python3 "$root/tests/cli/options.py" wrong.md "$INCISE_BUILD"/bin/incise-*
	[[ "$output" == *"--max-delay: not in the dictionary (calibrate delay)"* ]]
	[[ "$output" == *"--output: letters"* ]]
	[[ "$output" == *"--target: differs in eval, train"* ]]
	[[ "$output" == *"--frob: no command has it"* ]]
}

@test "old spellings are refused, and the new one is named" {
	while read -r old now command; do
		# shellcheck disable=SC2086 # "calibrate delay" is two words
		run -2 --separate-stderr incise $command $old
		[ "${stderr_lines[0]}" = "incise $command: $old: this option is now called $now" ]
	done <<-END
		--time --duration calibrate delay
		--range --max-delay calibrate delay
		--camera --with-camera calibrate delay
		--axis --handle calibrate depth
		--pictures --images calibrate depth
		--time --duration calibrate force
		--range --input-range calibrate force
		--time --duration calibrate tip
		--arith --method compile
		--loop --duration demo
		--output --report demo
		-o --report demo
		-r --rate export
		--at --poses replay
		--csv --log replay
		--for --duration stepper
		--output-model --output train
		--camera --viewpoint view
	END
	run -2 --separate-stderr incise train pairs.csv --output force_N
	[[ "${stderr_lines[0]}" == *"name the column to learn with --target"* ]]
	run -2 --separate-stderr incise capture --camera pictures
	[[ "${stderr_lines[0]}" == *"auto, off, frames or depth"* ]]
}

@test "a misspelt option names the nearest, or the ambiguous beginning" {
	run -2 --separate-stderr incise capture --duraton 5s
	[ "${stderr_lines[0]}" = \
		"incise capture: --duraton: no such option; did you mean --duration?" ]
	run -2 --separate-stderr incise train --m 3
	[[ "${stderr_lines[0]}" == *"more than one option begins like this, for example --mf" ]]
	run -2 --separate-stderr incise train --frequency 3
	[ "${stderr_lines[0]}" = "incise train: --frequency: no such option" ]
}
