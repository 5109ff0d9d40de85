# SPDX-License-Identifier: GPL-2.0-or-later
# doc/lesson.md, as a teacher follows it: its blocks in order, the marks that come out, the film, the
# student's window, and the class on a phone.

load cli
load document
load browser

setup() {
	work_folder
	page=$root/doc/lesson.md
	export XDG_RUNTIME_DIR=$PWD
}

teardown() {
	for one in $pid $server; do
		kill -9 "$one" 2>/dev/null || :
	done
}

needs_view() {
	[ -x "$INCISE_BUILD/bin/incise-view" ] && [ -e "$INCISE_BUILD/lib/incise/film_mkv.so" ] ||
		skip "incise view or its films were not built"
	incise view wall --procedure -o probe.png --at 0s --duration 0.05s --size 160x120 2>why ||
		skip "no OpenGL here: $(cat why)"
}

# bats test_tags=check
@test "every block of the lesson is run here, and its demonstration meets all criteria" {
	for mark in lesson "lesson with view" "lesson with window" "lesson over"; do
		commands_in "$page" "$mark"
	done >marked
	awk '/^```/ { inside = !inside && /^```sh/; next } inside' "$page" >all
	[ "$(sort marked)" = "$(sort all)" ]
	grep -e mkdir -e '^cd' -e expert.session marked | grep -v 'P\*' >first
	run -0 bash -euo pipefail first
	[[ "$output" == *"9 of 9 criteria met"* ]]
	cp lesson/expert.session once
	sed -i 's/-o expert/--overwrite &/' first
	bash -euo pipefail first >/dev/null
	cmp once lesson/expert.session
}

@test "the lesson's class is marked as it says, and a phone shows what is not met" {
	commands_in "$page" lesson >commands
	command -v gnuplot >/dev/null || skip "gnuplot is not installed"
	run bash -euo pipefail commands
	[[ "$output" != *"python3-jinja2 is not installed"* ]] || skip "$output"
	[ "$status" -eq 0 ] || complain "$output"
	python3 - lesson/class.csv <<-'END'
		import csv, sys
		rows = {r["code"]: r for r in csv.DictReader(open(sys.argv[1], newline=""))}
		failed = {c: {k for k, v in r.items() if k.endswith("_met") and v == "no"} for c, r in rows.items()}
		assert failed["EXPERT"] == set(), failed
		assert failed["P02"] == {"insertion_depth_mm_met"}, failed
		assert failed["P03"] == {"cut_length_mm_met", "insertion_depth_mm_met", "membrane_met"}, failed
		assert rows["EXPERT"]["met"] == rows["EXPERT"]["judged"] == "9"
	END
	cp -r lesson after
	# no file has the folder's name; when the lesson is over, no file has a code of a student
	run ! grep -rlF "$PWD" lesson
	(cd after && bash -euo pipefail <(commands_in "$page" "lesson over"))
	grep -rlwE 'P0[23]' lesson
	run ! grep -rlwE 'P0[23]' after
	browser --dump-dom 'data:text/html,<script>console.error("heard")</script>' >/dev/null
	grep -q 'CONSOLE.*heard' said
	for width in 390 1280; do
		answer=$(shown_in $width lesson/class.html)
		echo "$width: $answer"
		read -r inner whole small pictures blank broken twice wide _ <<<"$answer"
		[ "$inner $small $pictures $blank $broken $twice" = "$width 0 4 0 0 0" ]
		[ "$whole" -le "$width" ]
		[ "$width" != 390 ] || [ "$wide" = 0 ]
		# cells of the class table that are seen: session, code, met, and what is not met
		sed '/<\/main>/r /dev/stdin' lesson/class.html >seen.html <<-'END'
			<script>addEventListener("load", () => document.body.dataset.seen =
				[...document.querySelectorAll(".class td")].filter(e => e.offsetParent).length + " " +
				(document.querySelector(".class").scrollWidth <= document.querySelector(".class").parentNode.clientWidth));
			</script>
		END
		echo "<iframe id=f src=seen.html style='width:${width}px;height:844px;border:0'></iframe>
			<script>f.onload = () => document.body.dataset.seen = f.contentDocument.body.dataset.seen</script>" >frame.html
		browser --virtual-time-budget=10000 --allow-file-access-from-files --dump-dom "file://$PWD/frame.html" >dom
		seen=$(grep -oE 'data-seen="[^"]*' dom | cut -d'"' -f2)
		[ "$seen" = "$([ "$width" = 390 ] && echo 19 || echo 48) true" ] || complain "$width: $seen"
	done
}

@test "the lesson's film and pictures are made" {
	needs_view
	mkdir lesson
	commands_in "$page" "lesson with view" | sed 's/$/ --size 160x120 --rate 10/' >commands
	(cd lesson && bash -euo pipefail ../commands) >out
	grep -qx "wrote procedure.mp4: 220 frames, 22.0 s" out
	grep -qx "wrote procedure.png: 4 frames at 2.5, 8, 13, 21 s" out
}

@test "the student's window ends with q, and leaves a task log" {
	needs_view
	command -v Xvfb >/dev/null && command -v xdotool >/dev/null || skip "Xvfb or xdotool are not installed"
	Xvfb -displayfd 5 -noreset -screen 0 1400x800x24 5>display >/dev/null 2>&1 3>&- &
	server=$!
	await test -s display
	DISPLAY=:$(cat display)
	export DISPLAY SDL_VIDEODRIVER=x11
	commands_in "$page" "lesson with window" >command
	bash -c "exec $(cat command)" >out 2>err 3>&- &
	pid=$!
	window_is_there() { window=$(xdotool search --name neck 2>/dev/null | head -n 1) && [ -n "$window" ]; }
	await window_is_there
	key_ends_it() { xdotool key --window "$window" q 2>/dev/null; ! kill -0 $pid 2>/dev/null; }
	await key_ends_it
	wait $pid
	pid=
	grep -qx "wrote P01.session" out
	[ "$(key P01.session code)" = P01 ]
	[ "$(key P01.session end.kind)" = asked ]
}
