# SPDX-License-Identifier: GPL-2.0-or-later
# doc/tutorial.md, as a newcomer without a rig follows it: each block for the simulated rig, in
# order, in an empty folder. The results are compared with the simulated rig's truth.

load cli
load document

setup() {
	work_folder
	page=$root/doc/tutorial.md
	# As in a container, or after su: no session has made a folder.
	unset XDG_RUNTIME_DIR
	export TMPDIR=$PWD/temporary
	mkdir temporary
}

@test "every block of the tutorial that is said to run on the simulated rig is run here" {
	commands_in "$page" "simulated rig" >commands
	commands_in "$page" "simulated rig with view" >screen
	[ "$(cat commands screen | grep -cx '# simulated rig')" = "$(grep -cx '# simulated rig' "$page")" ]
	[ "$(grep -cx '# simulated rig' "$page")" -ge 8 ]
}

@test "the tutorial's commands run in their order, and find the simulated rig's truth" {
	commands_in "$page" "simulated rig" >commands
	if [ -e "$INCISE_BUILD/lib/incise/vision_opencv.so" ] && [ -e "$INCISE_BUILD/lib/incise/frames_mkv.so" ]; then
		has_pictures=yes
	else # what looks at pictures was not built
		sed -i '/^incise calibrate depth/d; /^incise capture -o look/d; s/^incise calibrate check$/& --only force,tip,delay,stepper/' commands
	fi
	# a machine that has else to do takes longer to begin
	sed -i 's/^sleep 2$/for i in $(seq 600); do incise status liver >seen 2>\&1 || :; ! grep -q "^liver: running since" seen || break; sleep 0.1; done/' commands
	grep -q seq commands
	bash -euo pipefail commands >out 2>err </dev/null || complain "$(tail -n 5 out err)"
	# the liver's force at 5 mm and 20 mm/s, as its formula has it (incise/sim.h)
	truth=$(awk 'BEGIN { d = 5; v = 20; print (0.045 * d + 0.0028 * d * d) * (1 + 0.35 * v / (v + 15)) }')
	read -r force sd < <(echo '5 20' | incise eval liver.fis --uncertainty total)
	# within its own 95 % interval
	holds "$force - $truth < 2 * $sd && $truth - $force < 2 * $sd"
	# mV/N, mm/px and ms of the simulated rig (incise/sim.h)
	force_mV_N=$(sed -n 's/^force_mV_N *= *\([0-9.]*\);.*/\1/p' calibration.conf)
	holds "$force_mV_N > 1240 - 5 && $force_mV_N < 1240 + 5"
	grep -q "liver.rec: complete, and as it was written" out
	grep -q "certified to 0\.0" out
	grep -q "^liver: running since" seen
	grep -qx "9 of 9 criteria met" out
	[ "$(awk -F, 'NR > 1' felt.csv | wc -l)" -gt 100000 ]
	# the scene that the service is given
	bash -c "$(grep -o "sed 's/model = .*;/'" "$page") $root/scenes/liver.scene" >mine.scene
	grep -q '"liver.fx"' mine.scene
	incise plan mine.scene --rig live.conf | grep -q "margin"
	if [ "${has_pictures-}" ] && [ -x "$INCISE_BUILD/bin/incise-view" ]; then
		commands_in "$page" "simulated rig with view" >commands
		run bash -euo pipefail commands
		if [ "$status" -ne 0 ]; then
			[[ "$output" == *OpenGL* ]] || complain "$output"
		else
			[ "$(find frames -name '*.png' | wc -l)" -ge 10 ]
		fi
	fi
}

# bats test_tags=check
@test "what the documents link to is there" {
	cd "$root/doc"
	for document in *.md ../README.md ../CONTRIBUTING.md ../CHANGELOG.md; do
		[ -f "$document" ] || complain "$document is not there"
		for link in $(grep -oE '\]\([^)]*\)' "$document" | sed 's/](//; s/)$//; s/#.*//' |
			grep -v '^https*:' | sort -u); do
			[ -e "$(dirname "$document")/$link" ] || complain "$document: $link"
		done
	done
}

@test "options in the tutorial are options of their programs" {
	# "incise calibrate force --scale": each --option stands in that program's --help
	grep -oE 'incise [a-z]+( [a-z-]+)?( [^`|]*)?' "$root"/doc/*.md "$root/README.md" -h |
		grep -e ' --' >lines
	[ "$(wc -l <lines)" -ge 20 ]
	while read -r line; do
		line=${line%%#*}
		read -r _ verb word _ <<<"$line"
		[ -x "$INCISE_BUILD/bin/incise-$verb" ] || continue
		[ ! -x "$INCISE_BUILD/bin/incise-$verb-$word" ] || verb=$verb-$word
		"incise-$verb" --help >help
		for option in $(grep -oE -- '--[a-z][a-z0-9-]*' <<<"$line"); do
			grep -qE -- "$option([ =,]|$)" help || complain "incise-$verb has no $option: $line"
		done
	done <lines
}

# Parsed by the programs themselves, in a folder without a rig that opens: what is more than
# bad usage (2) fails for want of devices or files, or runs until it is killed.
@test "every command that a document, a manual page or a help text gives is one" {
	local document command n=0 code
	local -a words
	export -n DISPLAY WAYLAND_DISPLAY
	echo 'no rig' >rig.conf
	mkdir help
	for document in "$INCISE_BUILD"/bin/incise*; do
		"$document" --help >"help/${document##*/}.help"
	done
	for document in "$root"/{README,CONTRIBUTING,tests/can/README}.md "$root"/doc/*.md \
		"$INCISE_BUILD"/man/*.[158] help/*.help; do
		typed_in "$document" | sed "s|^|${document##*/}\t|"
	done | grep -v '[…$]' | sort -u -t $'\t' -k 2 >typed
	[ "$(wc -l <typed)" -ge 120 ] || complain "only $(wc -l <typed) are found"
	: >wrong
	while IFS=$'\t' read -r document command; do
		mapfile -t words < <(xargs printf '%s\n' <<<"$command")
		code=0
		timeout -k 1 1 "${words[@]}" >/dev/null 2>err </dev/null || code=$?
		# Who asks for weights needs somebody who answers.
		[ "$code" -ne 2 ] || grep -q "without a terminal to ask" err || echo "$document: $command: $(head -n 1 err)" >>wrong
		n=$((n + 1))
	done <typed
	[ "$n" -eq "$(wc -l <typed)" ]
	[ ! -s wrong ] || complain "$(cat wrong)"
}
