# SPDX-License-Identifier: GPL-2.0-or-later
# incise demo, once, and what it leaves. The loop reaches the tissue in half of its time.

load cli

setup() {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed, it draws the pictures"
	work_folder
	demo="$BATS_FILE_TMPDIR/my demo's"
}

# Made once, from a folder of its own, into one whose name is awkward.
need_demo() {
	[ -e "$demo" ] || (cd "$BATS_FILE_TMPDIR" &&
		incise demo -o "my demo's" --duration 6s --seed 3 >printed 2>warned || [ $? = 1 ])
}

pictures="fig2-force fig3a-membership fig3b-surface fig5-prediction tick-lateness camera"

@test "demo draws every picture, as PNG and SVG" {
	need_demo
	for name in $pictures; do
		# the fewest bytes that a picture with axes, labels and curves came to is 20 KB
		for ext in png svg; do
			[ "$(stat -c %s "$demo/$name.$ext")" -gt 5000 ]
		done
		[ "$(head -c 8 "$demo/$name.png" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]
		# its last chunk: the file is whole
		[ "$(tail -c 8 "$demo/$name.png" | head -c 4)" = IEND ]
		grep -q '<svg' "$demo/$name.svg"
		[[ "$(tail -c 20 "$demo/$name.svg" | tr -d '\n ')" == *"</svg>" ]]
	done
}

@test "its figures can be printed: no text is cut, none overlaps, axes are quantity / unit" {
	need_demo
	python3 "$BATS_TEST_DIRNAME/figures.py" "$demo"/*.svg
	# one time axis for the first panels of figure 5, and one for the part seen close
	[ "$(grep -c '^set xrange' "$demo/plot/fig5-prediction.gp")" = 2 ]
	[ "$(grep -c '>time in the cut / s<' "$demo/fig5-prediction.svg")" = 3 ]
	for text in "skin line" "exposed length" "tip, hidden by the tissue,"; do
		[ ! -e "$INCISE_BUILD/lib/incise/vision_opencv.so" ] || grep -q ">$text<" "$demo/camera.svg"
	done
	for text in shallow deep slow fast; do
		grep -q ">$text<" "$demo/fig3a-membership.svg"
	done
}

@test "demo leaves a summary for programs" {
	need_demo
	file=summary.json
	cp "$demo/summary.json" .
	[ "$(key $file version)" = "$(incise info --version | cut -d' ' -f2)" ]
	[ "$(key $file seed)" = 3 ]
	[ "$(key $file pictures)" = "[\"${pictures// /\",\"}\"]" ]
	[ "$(key $file train_random_halves.pairs)" = 120 ] # the paper's number
	[ "$(key $file capture.lost)" = 0 ]
	[ "$(key $file capture.seconds)" = 127.0 ] # 14 cuts of 8 s with 15 pauses of 1 s
	[ "$(key $file train_random_halves.train.pairs)" = 60 ]
	holds "$(key $file train_random_halves.train.mse_N2) > 0"
	holds "$(key $file train_unseen_cuts.check.rmse_N) < \
		$(key $file train_unseen_cuts.baselines.mean.rmse_N)"
	holds "$(key $file fixed_point.max_difference_N) < 1e-3"
	# the tissue's mean force is known; cuts differ by 10 % of at most 2.7 N
	holds "$(key $file truth_rms_error_N) > 0 && $(key $file truth_rms_error_N) < 0.27"
	holds "$(key $file new_cut_rms_error_N) > 0"
	holds "$(key $file haptic.ticks) + $(key $file haptic.skipped) >= 5990"
	holds "$(key $file haptic.contact) > 0"
	holds "$(key $file seconds) > 2"
	for name in note paper.mse_train paper.mse_check export_raw export_by_cut \
		capture_new_cut export_new_cut haptic.lateness_us.max; do
		[ -n "$(key $file $name)" ]
	done
}

@test "demo leaves a summary for people, and prints it" {
	need_demo
	grep -q "simulated rig with seed 3" "$demo/summary.txt"
	run ! grep -qiE '\bnan\b|\binf\b' "$demo/summary.txt"
	# all of it is in what was printed
	while IFS= read -r line; do
		grep -qF -- "$line" "$BATS_FILE_TMPDIR/printed"
	done < <(grep . "$demo/summary.txt")
}

@test "demo leaves data that the other verbs take" {
	need_demo
	[ "$(grep -v '^#' "$demo/pairs.csv" | awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "advancing") c = i; next }
		c && $c == 1' | wc -l)" -eq 120 ]
	incise info "$demo/liver.rec" --json >r.json
	[ "$(key r.json cuts)" = 14 ]
	[ "$(key r.json complete)" = 1 ]
	holds "$(echo '10 20' | incise eval "$demo/liver.fis") > 0.3"
	incise haptic "$demo/liver.scene" --rig sim:clock=simulated --duration 100ms >/dev/null
	incise train "$demo/pairs-by-cut.csv" --group cut --check 0.3 --seed 3 -o m.fis 2>/dev/null
	cmp m.fis "$demo/liver.fis"
}

@test "demo ends with a page of its figures and results, and without warnings of halves that are small" {
	need_demo
	[ "$(tail -n 1 "$BATS_FILE_TMPDIR/printed")" = "open my demo's/index.html" ] ||
		{ grep -q "python3-jinja2 is not installed" "$BATS_FILE_TMPDIR/warned" && skip "no jinja2"; }
	[ "$(grep -o 'src="data:image/svg+xml;base64,' "$demo/index.html" | wc -l)" = "$(wc -w <<<"$pictures")" ]
	run ! grep -qE '(src|href)="(https?:|//|/)' "$demo/index.html"
	cp "$demo/summary.json" .
	error=$(printf %.3g "$(key summary.json train_unseen_cuts.check.rmse_N)")
	grep -qE ">$error(0*) N rms<" "$demo/index.html" || complain "no $error N"
	[ "$(key summary.json warnings_of_splits)" -ge 12 ]
	run ! grep "incise train: warning" "$BATS_FILE_TMPDIR/warned"
}

@test "the commands that demo prints are those that it ran" {
	need_demo
	for verb in capture export train replay haptic; do
		grep -q "^\$ incise $verb " "$BATS_FILE_TMPDIR/printed"
	done
}

@test "a picture can be drawn again from what is left" {
	need_demo
	cp -r "$demo" copy
	rm copy/fig3b-surface.png
	cd copy/plot
	gnuplot -e "ext='png'" fig3b-surface.gp
	[ "$(stat -c %s ../fig3b-surface.png)" -gt 5000 ]
}

@test "a demo whose loop gave no force says so, and fails with its results in place" {
	mkdir bin
	ln -s "$INCISE_BUILD"/bin/* bin
	rm bin/incise-haptic bin/incise-demo
	cp "$INCISE_BUILD/bin/incise-demo" bin # it runs the programs beside its own file
	cat >bin/incise-haptic <<-X
		#!/bin/sh
		"$INCISE_BUILD/bin/incise-haptic" "\$@" | sed -E 's/"no_force": (null|"[^"]*")/"no_force": "no contact"/'
	X
	chmod +x bin/incise-haptic
	LD_LIBRARY_PATH=$INCISE_BUILD/lib run -1 --separate-stderr bin/incise-demo -o short --duration 0.2s
	[[ "${stderr##*$'\n'}" == "incise demo: the haptic loop gave no force: no contact; run the demo again"* ]] || complain "$stderr"
	[ -s short/summary.json ]
	[ ! -e short/.unfinished ]
}

@test "demo does not write into a folder that exists" {
	need_demo
	before=$(sha256sum <"$demo/summary.json")
	fails incise demo -o "$demo" --duration 1s -- "my demo's" "File exists" --overwrite
	[ -z "$output" ]
	[ "$(sha256sum <"$demo/summary.json")" = "$before" ]
}

# interrupted_in COMMAND: the group gets SIGINT, as by Ctrl-C at a terminal, once that command of the
# demo catches it.
interrupted_in() {
	local group pid mask
	env --default-signal=INT setsid incise demo -o part --duration 1h >out 2>err 3>&- &
	group=$!
	for ((i = 0; i < 6000; i++)); do
		pid=$(awk -v group=$group -v name="(incise-$1)" '$5 == group && $2 == name { print $1 }' \
			/proc/[0-9]*/stat 2>/dev/null | head -n 1)
		mask=$(sed -n 's/^SigCgt:\t*//p' "/proc/${pid:-none}/status" 2>/dev/null) || :
		! ((0x${mask:-0} & 2)) || break
		kill -0 $group || break
		sleep 0.02
	done
	kill -INT -- -$group
	status=0
	wait $group || status=$?
	[ "$status" -eq 1 ] || complain "exit $status: $(cat err)" || return
	[[ "$(tail -n 1 err)" == "incise demo: interrupted"*" part "*"run it again"* ]] || complain "$(cat err)" ||
		return
	! grep -E "full|see the line" err
}

@test "demo that is interrupted says so, and its next run replaces what it left" {
	need_demo
	interrupted_in haptic
	[ ! -e part/summary.json ]
	[ -s part/liver.fis ]
	interrupted_in capture
	# A folder of something else is none of its own, and one that is whole is no part.
	mkdir other
	fails incise demo -o other -- other "File exists"
	[ ! -e "$demo/.unfinished" ]
}

# bats test_tags=check
@test "demo without gnuplot says what to install, and leaves nothing" {
	mkdir empty
	fails env PATH="$PWD/empty" "$INCISE_BUILD/bin/incise" demo -o x -- gnuplot-nox
	[ ! -e x ]
}

@test "demo where it cannot write" {
	fails incise demo -o no/such/folder -- no/such/folder "No such file"
	touch file
	fails incise demo -o file -- file
	fails incise demo -o file --overwrite -- file
}
