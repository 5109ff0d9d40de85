# SPDX-License-Identifier: GPL-2.0-or-later
# Sessions, as a user meets them: written by incise haptic and incise view, and assessed.

load cli

setup_file() {
	export XDG_RUNTIME_DIR="$BATS_FILE_TMPDIR/run"
	mkdir -p "$XDG_RUNTIME_DIR"
	cd "$BATS_FILE_TMPDIR"
	cp "$BATS_TEST_DIRNAME"/../../scenes/neck.scene .
	# one cut along the skin of the virtual surgeon; what is asked is met, then not
	rig=sim:clock=simulated,depth_mm=6,times=1,pause_s=1,cut_s=4
	sed -i '/^criteria = {/,/^};/d; /^membrane = {/,/^};/d' neck.scene
	echo 'criteria = { cut_length_mm = [10.0, 200.0]; incisions_most = 8; force_most_N = 4.0;
		back_wall = false; };' | cat neck.scene - >easy.scene
	echo 'criteria = { cut_length_mm = [10.0, 11.0]; insertion_depth_mm = [5.0, 9.0];
		force_most_N = 0.1; time_most_s = 100.0; };' | cat neck.scene - >hard.scene
	for scene in easy hard; do
		"$INCISE_BUILD/bin/incise" haptic $scene.scene --rig $rig --duration 8s \
			-o $scene.session --code S-$scene >/dev/null
	done
}

setup() {
	work_folder
	cp "$root"/scenes/neck.scene .
	cp "$BATS_FILE_TMPDIR"/*.session .
	quick=sim:clock=simulated,depth_mm=6,times=1,pause_s=1,cut_s=4
}

teardown() {
	[ -z "${pid:-}" ] || kill -9 "$pid" 2>/dev/null || :
}

# bats test_tags=check
@test "in simulated time the same run gives the same session, and another one another" {
	incise haptic neck --rig $quick --duration 8s -o a.session --code P07 >a.txt
	incise haptic neck --rig $quick --duration 8s -o b.session --code P07 >b.txt
	cmp a.session b.session
	cmp <(grep -v ^wrote a.txt) <(grep -v ^wrote b.txt)
	incise haptic neck --rig $quick,seed=2 --duration 8s -o c.session --code P07 >/dev/null
	run ! cmp -s a.session c.session
	# its scene by its name: a folder may have the name of a person
	mkdir kim
	cp neck.scene kim
	incise haptic "$PWD/kim/neck.scene" --rig $quick --duration 8s -o d.session --code P07 >/dev/null
	[ "$(key d.session scene.path)" = neck.scene ]
	run ! grep -q kim d.session
	cp a.session kim
	incise assess "$PWD/kim/a.session" "$PWD/kim/a.session" -o p.html >/dev/null 2>why ||
		grep -qE "gnuplot is not installed|python3-jinja2 is not installed" why
	run ! grep -qs kim p.html
	# every tick was seen, and the loop's own report agrees
	[ "$(key a.session ticks)" = 8000 ]
	[ "$(key a.session ticks_lost)" = 0 ]
	[ -z "$(key a.session start_unix_s)" ]
	[ "$(key a.session code)" = P07 ]
	[ "$(key a.session end.kind)" = asked ]
	incise haptic neck --rig $quick --duration 8s --json >r.json
	# rounded to four decimals
	holds "($(key a.session force.largest_N) - $(key r.json force_max_N))^2 < 1e-8"
}

@test "a session changes nothing of the run" {
	incise haptic neck --rig $quick --duration 4s -o a.csv >/dev/null
	incise haptic neck --rig $quick --duration 4s -o b.csv -o b.session >/dev/null
	cmp a.csv b.csv
}

# Wait until the loop $pid has run for 1000 ticks.
until_it_runs() {
	has_ticks() {
		[ "$(incise status ./page --prometheus | sed -n 's/^incise_loop_ticks_total{.*} //p')" -ge 1000 ]
	}
	await has_ticks
}

@test "in real time every tick is in the session, at 20 kHz too; SIGINT ends it with its reason" {
	sed -i 's/rate_hz = .*/rate_hz = 20000.0;/' neck.scene
	incise haptic neck --rig sim: --no-rt --state page --overruns 0 -o a.session \
		--json >r.json 3>&- &
	pid=$!
	until_it_runs
	kill -INT $pid
	wait $pid
	pid=
	# or is counted as lost, where the session is kept from reading for seconds
	[ "$(($(key a.session ticks) + $(key a.session ticks_lost)))" = "$(key r.json ticks)" ]
	[ "$(key a.session ticks)" -ge 1000 ]
	[ "$(key a.session end.kind)" = signal ]
	[ "$(key a.session end.why)" = Interrupt ]
	# a real clock says when; that of the test was not set back meanwhile
	holds "$(key a.session start_unix_s) > $(stat -c %Y neck.scene) - 1"
}

@test "a fault ends a session with its reason" {
	incise haptic neck --rig sim: --no-rt --state page --overruns 1 -o a.session \
		>/dev/null 2>err 3>&- &
	pid=$!
	# one tick too late ends it: on a busy machine before this one, which is stopped for 0.1 s
	until_it_catches $pid incise-haptic 2 2>/dev/null || :
	! kill -STOP $pid || sleep 0.1
	kill -CONT $pid || :
	status=0
	wait $pid || status=$?
	pid=
	[ "$status" -eq 1 ]
	[ "$(key a.session end.kind)" = fault ]
	[[ "$(key a.session end.why)" == *"were a period late"* ]]
	grep -q "were a period late" err
}

@test "a session is of one scene: it is not read again" {
	setsid incise haptic neck --rig sim: --no-rt --state page --overruns 0 -o a.session \
		>/dev/null 2>err 3>&- </dev/null &
	pid=$!
	until_it_runs
	kill -HUP $pid
	await grep -q "not reloaded" err
	grep -q "not reloaded.*a session .*keep their scene" err
	kill -INT $pid
	wait $pid
	pid=
	[ "$(key a.session end.kind)" = signal ]
}

# Cell of a CSV file by the name of its column: cell FILE ROW NAME.
cell() {
	python3 -c 'import csv, sys
row = list(csv.DictReader(open(sys.argv[1], newline="")))[int(sys.argv[2])]
print(row[sys.argv[3]])' "$@"
}

# bats test_tags=check
@test "criteria that are met and that are not, each with its value" {
	run -0 --separate-stderr incise assess easy.session
	[ -z "$stderr" ]
	[[ "${lines[0]}" == "easy.session: easy.scene, code S-easy" ]]
	[[ "$output" =~ length\ of\ the\ incision\ +[0-9.]+\ mm\ +10\ to\ 200\ +yes ]]
	# no membrane, no value and no judgement
	[[ "$output" =~ back\ wall\ touched\ +-\ +no\ +- ]]
	[ "${lines[-1]}" = "3 of 3 criteria met" ]
	incise assess easy.session --json >e.json
	holds "$(key e.json 'sessions[0].criteria.cut_length_mm.value') > 10"
	[ "$(key e.json 'sessions[0].criteria.cut_length_mm.met')" = 1 ]
	[ -z "$(key e.json 'sessions[0].criteria.back_wall.met')" ]
	[ -z "$(key e.json 'sessions[0].criteria.time_most_s.met')" ]
	[ "$(key e.json 'sessions[0].judged')" = 3 ]
	[ -z "$(key e.json reference)" ]

	incise assess hard.session --json >h.json
	# no tube, no time
	[ "$(key h.json 'sessions[0].judged')" = 3 ]
	[ "$(key h.json 'sessions[0].met')" = 0 ]
	[ "$(key h.json 'sessions[0].criteria.cut_length_mm.met')" = 0 ]
	[ "$(key h.json 'sessions[0].criteria.insertion_depth_mm.value')" = 0.0 ]
	[ -z "$(key h.json 'sessions[0].criteria.time_most_s.met')" ]
	[ -z "$(key h.json 'sessions[0].criteria.time_most_s.value')" ]
	# criteria change no value
	[ "$(key h.json 'sessions[0].criteria.cut_length_mm.value')" = \
		"$(key e.json 'sessions[0].criteria.cut_length_mm.value')" ]
	# the file's own list says as much: cuts that are joined, and their ends that are farthest apart
	longest=$(python3 -c 'import json, math
cuts = json.load(open("easy.session"))["cuts"]
ends = [(c["incision"], p) for c in cuts for p in (c["from_mm"], c["to_mm"])]
print(max(math.dist(p, q) for i, p in ends for k, q in ends if i == k))')
	holds "($(key e.json 'sessions[0].criteria.cut_length_mm.value') - $longest)^2 < 1e-12"
}

@test "a reference has a column and the differences; against itself there are none" {
	run -0 --separate-stderr incise assess hard.session --reference easy.session
	[ "${#stderr_lines[@]}" -eq 1 ]
	[[ "$stderr" == *"hard.session: its scene differs from that of easy.session; compare sessions of one scene" ]]
	[[ "$output" == *"reference difference"* ]]
	sed 's/"largest_N": [0-9.]*/"largest_N": 0.5/' easy.session >expert.session
	incise assess easy.session --reference expert.session --json >r.json
	largest=$(key r.json 'sessions[0].criteria.force_most_N.value')
	holds "($(key r.json 'sessions[0].difference.force_most_N') - ($largest - 0.5))^2 < 1e-12"
	[ "$(key r.json reference.file)" = expert.session ]
	run -0 --separate-stderr incise assess easy.session --reference easy.session --json
	[ -z "$stderr" ]
	echo "$output" >r.json
	[ "$(sqlite3 :memory: "SELECT count(*) FROM json_each(readfile('r.json'),
		'\$.sessions[0].difference') WHERE value != 0")" = 0 ]
}

@test "a row for each of many, as table and CSV" {
	run -0 --separate-stderr incise assess easy.session hard.session -o all.csv
	[ "${lines[1]%% *}" = easy.session ]
	[[ "${lines[2]}" == hard.session*"!"*" 0 of 3" ]]
	# a criterion of one scene counts its sessions alone; the reference is none of the class
	[ "$(tr -s ' ' <<<"${lines[3]}")" = "not met 1 of 2 - - 0 of 1 - 1 of 1 - 1 of 2 -" ]
	incise assess easy.session easy.session --reference hard.session 2>/dev/null | tr -s ' ' |
		grep -qx "not met 0 of 2 - - 0 of 2 - - - 0 of 2 -"
	[ "${lines[-1]}" = "wrote all.csv" ]
	[ "$(wc -l <all.csv)" -eq 3 ]
	[ "$(cell all.csv 1 file)" = hard.session ]
	[ "$(cell all.csv 1 code)" = S-hard ]
	[ "$(cell all.csv 1 met)" = 0 ]
	[ "$(cell all.csv 1 cut_length_mm_met)" = no ]
	[ "$(cell all.csv 0 cut_length_mm_met)" = yes ]
	[ -z "$(cell all.csv 0 off_target_mm)" ]
	holds "($(cell all.csv 0 force_most_N) - $(key easy.session force.largest_N))^2 < 1e-12"
	incise assess easy.session --reference hard.session -o csv:- 2>/dev/null >r.csv
	[ "$(cell r.csv 1 role)" = reference ]
	cp easy.session 'a,"b.session'
	incise assess 'a,"b.session' -o q.csv >/dev/null
	[ "$(cell q.csv 0 file)" = 'a,"b.session' ]
}

@test "a page holds all of it, with figures, and nothing from elsewhere" {
	command -v gnuplot || skip "no gnuplot"
	mkdir t
	export TMPDIR=$PWD/t
	incise assess easy.session hard.session --reference easy.session -o p.html 2>why >out ||
		{ grep -q "python3-jinja2 is not installed" why && skip "$(cat why)"; false; }
	[ "$(tail -n 1 out)" = "wrote p.html" ]
	# two figures each
	[ "$(grep -o 'src="data:image/svg+xml;base64,' p.html | wc -l)" -eq 4 ]
	run ! grep -qE '(src|href)="(https?:|//|/)' p.html
	grep -q 'S-hard' p.html
	grep -q '<strong>no</strong>' p.html
	# what is in the folder for figures is gone
	[ -z "$(ls -A t)" ]
	python3 - p.html <<-'END'
		import base64, re, sys, xml.dom.minidom
		for figure in re.findall('base64,([A-Za-z0-9+/=]+)', open(sys.argv[1]).read()):
		    xml.dom.minidom.parseString(base64.b64decode(figure))
	END
	# what a file says is shown as it is
	sed -E 's|"path": "easy.scene"|"path": "<script>alert(1)</script> **a** \| b"|' easy.session >x.session
	incise assess x.session -o x.html >/dev/null
	run ! grep -q '<script>' x.html
	grep -qF '&lt;script&gt;alert(1)&lt;/script&gt; **a** | b' x.html
}

@test "a session without a tick, or without a contact, is reported too" {
	incise haptic neck --rig $quick --duration 0.5s -o a.session >/dev/null
	[ -z "$(key a.session first_contact_s)" ]
	run -0 --separate-stderr incise assess a.session
	[ -z "$stderr" ]
	[[ "$output" == *"no tool touched the tissue, so there was no force"* ]]
	for label in incisions "back wall touched" "largest force" "time needed"; do
		grep -qE "^$label +-  .* - *\$" <<<"$output" || complain "$label: $output"
	done
	[ "${lines[-1]}" = "0 of 5 criteria met" ]
	incise assess a.session -o a.html >/dev/null 2>why || grep -qE "gnuplot is not installed|python3-jinja2 is not installed" why
	python3 - <<-'END'
		import json
		s = json.load(open('a.session'))
		s['trace']['rows'] = []
		s['ticks'] = 0
		s['ticks_lost'] = 5
		json.dump(s, open('b.session', 'w'))
	END
	run -0 --separate-stderr incise assess b.session
	[ -z "$stderr" ]
	[[ "$output" == *"5 of 5 ticks were lost"* ]]
	sed 's/"largest_N": [0-9.]*/"largest_N": 0.0/' easy.session >c.session
	run -0 --separate-stderr incise assess c.session
	[[ "$output" == *"no force, although a tool was in the tissue"* ]]
	incise assess b.session -o b.html >/dev/null 2>why || grep -qE "gnuplot is not installed|python3-jinja2 is not installed" why
}

# refused TEXT…: bad.session is, in one line.
refused() {
	run --separate-stderr incise assess easy.session bad.session
	failed_with bad.session "$@" || return
	[ -z "$output" ] || complain "printed: $output"
}

# tests/unit/tools/session.c has the rest.
# bats test_tags=check
@test "damaged files are refused in one line that says where" {
	head -c 1000 easy.session >bad.session
	refused "not JSON"
	echo '[]' >bad.session
	refused incise_session
	sed 's/"duration_s": [0-9.]*/"duration_s": 1e300/' easy.session >bad.session
	refused "duration_s: expected a number from 0 to"
	sed 's/"path": "easy.scene"/"path": "\\u001b[2J"/' easy.session >bad.session
	refused "scene.path"
	python3 -c 'print("[" * 100000)' >bad.session
	refused "not JSON"
	head -c 20000000 /dev/zero | tr '\0' ' ' >bad.session
	refused "8"
	cp "$root/scenes/neck.scene" bad.session
	refused "this is a scene, not a session"
	rm bad.session
	refused "No such file"
	mkdir bad.session
	refused directory
	fails incise assess easy.session --reference none.session -- none.session
}

@test "the script meets every criterion of the neck, and without the tube all but one" {
	incise haptic neck --procedure -o a.session >/dev/null
	incise assess a.session --json >a.json
	[ "$(key a.json 'sessions[0].judged')" = 9 ]
	[ "$(key a.json 'sessions[0].met')" = 9 ]
	[ "$(key a.session target.punctured)" = 1 ]
	[ "$(key a.session target.missed)" = 0 ]
	# before the tube is in
	incise haptic neck --procedure --duration 14s -o b.session >/dev/null
	incise assess b.session --json >b.json
	[ "$(key b.json 'sessions[0].met')" = 7 ]
	[ "$(key b.json 'sessions[0].judged')" = 8 ]
	[ "$(key b.json 'sessions[0].criteria.insertion_depth_mm.met')" = 0 ]
	# the page has the membrane
	incise assess a.session -o a.html >/dev/null 2>why || { grep -qE "gnuplot is not installed|python3-jinja2 is not installed" why && skip "$(cat why)"; }
	python3 - a.html <<-'END'
		import base64, re, sys
		figures = re.findall('base64,([A-Za-z0-9+/=]+)', open(sys.argv[1]).read())
		assert sum(b'>membrane<' in base64.b64decode(f) for f in figures) == 1
	END
}

@test "a view's session is that of the ticks that it shows" {
	[ -x "$INCISE_BUILD/bin/incise-view" ] ||
		skip "incise view was not built: SDL2, epoxy, cairo or EGL were absent"
	small="--size 160x120 --no-panel --rate 1 --duration 4s"
	incise view neck --procedure -o gl $small 2>why || skip "no OpenGL here: $(cat why)"
	incise view neck --procedure -o f -o a.session $small
	incise view neck --procedure -o f -o b.session --overwrite --json $small >r.json
	cmp a.session b.session
	[ "$(key a.session source)" = procedure ]
	# the picture's cuts are the session's, but for a place, 0.5 mm, at each end
	holds "($(key r.json cut_mm) - $(key a.session 'cuts[0].length_mm'))^2 < 1"
	[ -z "$(key a.session start_unix_s)" ]
}
