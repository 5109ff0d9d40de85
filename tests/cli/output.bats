# SPDX-License-Identifier: GPL-2.0-or-later
# An output of any command is never an input, nor inside one, and an existing file is replaced
# only with --overwrite.

load cli

quick=sim:clock=simulated,depth_mm=10,times=1,pause_s=0.1,cut_s=4

setup_file() {
	cd "${BATS_FILE_TMPDIR:?}"
	made_pairs >pairs.csv
	incise capture -o d.rec --rig $quick --duration 1s >/dev/null
	cp "$root/scenes/liver.fis" m.fis
	printf '#incise-sd\n' >m.fis.sd
	printf '%s\n' 'rate_hz = 1000.0; model = "m.fis";' \
		'surface = { kind = "mesh"; file = "s.obj"; };' >m.scene
	printf '%s\n' 'v -50 -50 0' 'v 50 -50 0' 'v 50 50 0' 'v -50 50 0' 'f 1 2 3' 'f 1 3 4' >s.obj
	incise calibrate force --rig sim:clock=simulated --weights 0,50g,100g,200g \
		--repeat 3 --duration 200ms -c calibration.conf -o forces.csv >/dev/null
	cat >rig.conf <<-END
		tracker = "sim"; force = "sim"; camera = "sim"; stepper = "sim";
	END
	incise haptic "$root/scenes/neck.scene" --rig $quick --duration 1s -o s.session >/dev/null
	many_pairs 8 >many.csv
	incise train many.csv --premises m.fis --group cut -o m.fac >/dev/null
	incise capture -o n.rec --rig sim:clock=simulated,seed=2 --duration 1s --clock-source sim:1000 >/dev/null
	incise capture -o w.rec --rig sim:clock=simulated,seed=3 --duration 1s --clock-source sim:1000 >/dev/null
}

setup() {
	work_folder
	cp -r "${BATS_FILE_TMPDIR:?}"/{pairs.csv,d.rec,m.fis,m.fis.sd,m.scene,s.obj,forces.csv,calibration.conf,s.session,m.fac} .
}

# Every byte, name and mode in this folder.
content() {
	find . -type f ! -name err ! -name out -exec cksum {} + | sort -k 3
	find . -printf '%p %m %l\n' | sort
}

# The command fails and changes nothing, with --overwrite, which says what is an input, and with CASES=all
# without it, too: an input that is found later only exists then.
spares_inputs() {
	local before try tries=(--overwrite)
	before=$(content)
	[ "${CASES:-}" != all ] || tries+=("")
	for try in "${tries[@]}"; do
		run --separate-stderr timeout 60 incise "$@" $try </dev/null
		[[ "$stderr" == *exists* && ! "$try" ]] || failed_with input || complain "incise $* $try" || return
		[ "$(content)" = "$before" ] || complain "incise $* $try: changed a file" || return
	done
}

# bats test_tags=check
@test "an output is never an input, by any name" {
	ln -s m.fis link.fis
	ln m.fis hard.fis
	mkdir folder
	for path in m.fis ./m.fis link.fis hard.fis folder/../m.fis "$PWD/m.fis" m.fis.sd; do
		spares_inputs compile m.fis -o $path
		spares_inputs compile m.fis -o m.fx -o c:$path
	done
	spares_inputs compile link.fis -o m.fis
	spares_inputs train pairs.csv -o pairs.csv
	spares_inputs train pairs.csv -o new.fis -o pairs.csv
	spares_inputs export d.rec -o d.rec/recording.db
	spares_inputs export d.rec -o calibration.conf -c calibration.conf
	# The extension of a log is .csv, by which name ever.
	for path in d.rec/recording.db m.scene m.fis s.obj calibration.conf; do
		ln -sf $path log.csv
		spares_inputs replay d.rec m.scene -c calibration.conf -o log.csv
	done
	for path in m.scene m.fis s.obj calibration.conf; do
		ln -sf $path log.csv
		spares_inputs haptic m.scene --rig $quick --duration 100ms -c calibration.conf -o log.csv
	done
	ln -sf m.fis log.csv
	spares_inputs haptic m.scene --rig $quick --duration 100ms --model link.fis -o log.csv
	mkdir report
	ln -s ../forces.csv report/fit.png
	spares_inputs calibrate force --from forces.csv -c calibration.conf -o report
	ln -s m.scene link.session
	spares_inputs haptic m.scene --rig $quick --duration 100ms -o link.session
	spares_inputs assess s.session -o s.session
	ln -s pairs.csv pairs.svg
	spares_inputs plot pairs.csv -o pairs.svg
	spares_inputs merge m.fac -o m.fac
}

@test "an output is never inside a recording that is read" {
	ln -s d.rec link.rec
	mkdir -p d.rec/plot
	for path in d.rec/new.csv link.rec/new.csv d.rec/../d.rec/new.csv d.rec/plot/new.csv; do
		spares_inputs export d.rec -o $path
		spares_inputs export link.rec -o $path
		spares_inputs replay d.rec m.scene -o $path
	done
	spares_inputs plot d.rec -o d.rec/new.svg
	ln -s d.rec/recording.db into.csv
	spares_inputs export d.rec -o into.csv
	spares_inputs calibrate tip --from d.rec -o d.rec/new
	spares_inputs calibrate tip --from d.rec -c d.rec/calibration.conf
	if command -v gnuplot >/dev/null; then
		spares_inputs replay d.rec m.scene -o d.rec/picture.png
		spares_inputs replay d.rec m.scene -o d.rec/new/picture.png
	fi
	if [ -x "$INCISE_BUILD/bin/incise-view" ]; then
		spares_inputs view m.scene --from d.rec -o d.rec/new --duration 1s
		spares_inputs view m.scene --from d.rec -o d.rec/new.mkv --duration 1s
	fi
}

@test "rig.conf that is found, and scenes by name, are inputs too" {
	cp "${BATS_FILE_TMPDIR:?}/rig.conf" .
	for path in rig.conf m.scene; do
		ln -sf $path log.csv
		run --separate-stderr incise haptic m --duration 100ms -o log.csv --overwrite
		failed_with "$path" "is an input"
	done
	cmp rig.conf "$BATS_FILE_TMPDIR/rig.conf"
}

@test "standard input that is a file is an input" {
	before=$(cat pairs.csv)
	run --separate-stderr incise train - -o pairs.csv --overwrite <pairs.csv
	failed_with "is an input"
	[ "$(cat pairs.csv)" = "$before" ]
}

# bats test_tags=check
@test "two outputs are two files" {
	for more in a.fis ./a.fis "$PWD/a.fis"; do
		run --separate-stderr incise train pairs.csv -o a.fis -o initial.fis:$more --overwrite
		failed_with a.fis "written twice"
	done
	touch a.fis.sd
	ln -s a.fis.sd history.csv
	fails incise train pairs.csv -o a.fis -o history.csv --overwrite -- a.fis.sd "written twice"
	[ ! -e a.fis ]
}

# The command makes what it names; then it refuses and changes nothing; with --overwrite it
# replaces it. First argument: an output that is a file.
replaces_when_told() {
	local output=$1 before
	shift
	incise "$@" >out 2>err </dev/null || complain "incise $*: $(cat err)" || return
	[ -f "$output" ] || complain "incise $*: there is no $output" || return
	echo precious >"$output"
	before=$(content)
	run --separate-stderr incise "$@" </dev/null
	failed_with "$output" "exists" "--overwrite" || complain "incise $*" || return
	[ "$(content)" = "$before" ] || complain "incise $*: changed a file" || return
	incise "$@" --overwrite >out 2>err </dev/null ||
		complain "incise $* --overwrite: $(cat err)" || return
	[ "$(head -c 8 "$output")" != precious ] || complain "incise $*: $output is the old one"
}

@test "an existing file is replaced with --overwrite only, in each command" {
	replaces_when_told a.fx compile m.fis -o a.fx
	replaces_when_told b.c compile m.fis -o b.fx -o b.c
	replaces_when_told a.csv export d.rec -o a.csv
	replaces_when_told a.fis train pairs.csv -o a.fis --epochs 2
	replaces_when_told b.fis.sd train pairs.csv -o b.fis --epochs 2
	replaces_when_told c0.initial.fis train pairs.csv -o c.fis --epochs 2 -o c0.initial.fis
	replaces_when_told dh.csv train pairs.csv -o d.fis --epochs 2 -o dh.csv
	replaces_when_told r.csv replay d.rec wall -o r.csv
	replaces_when_told l.csv haptic wall --rig $quick --duration 100ms -o l.csv
	replaces_when_told a.session haptic wall --rig $quick --duration 100ms -o a.session
	replaces_when_told sessions.csv assess s.session -o sessions.csv
	replaces_when_told new.fis merge m.fac -o new.fis
	cp "$BATS_FILE_TMPDIR/many.csv" .
	replaces_when_told new.fac train many.csv --premises m.fis --group cut -o new.fac
	replaces_when_told k.csv calibrate force --rig sim:clock=simulated --weights 0,50g,100g,200g \
		--repeat 3 --duration 200ms -c k.conf -o k.csv
	replaces_when_told report/report.txt calibrate force --from forces.csv -c k.conf -o report
	replaces_when_told report2/report.json calibrate force --from forces.csv -c k.conf -o report2
}

@test "a kept recording is replaced with --overwrite only, and by a whole one" {
	delay="calibrate delay --rig sim:clock=simulated,motion=2 -c k.conf -o k.rec"
	incise $delay --duration 12s >/dev/null </dev/null
	before=$(content)
	run --separate-stderr incise $delay --duration 12s </dev/null
	failed_with k.rec "exists" "--overwrite"
	run --separate-stderr incise $delay --rig none.conf --duration 12s --overwrite </dev/null
	failed_with none.conf
	incise verify k.rec >/dev/null
	[ "$(content)" = "$before" ] || complain "$(content)"
	incise $delay --duration 13s --overwrite >/dev/null </dev/null
	[ "$(content)" != "$before" ]
	incise verify k.rec >/dev/null
	# nothing is left beside it, and what is no recording stays
	[ "$(echo k.rec*)" = k.rec ]
	mkdir other.rec
	echo mine >other.rec/notes
	run --separate-stderr incise capture -o other.rec --rig $quick --duration 1s --overwrite
	failed_with other.rec "not a recording"
	[ "$(cat other.rec/notes)" = mine ]
}

@test "pictures are replaced with --overwrite only" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed"
	replaces_when_told i.png plot m.fis -o i.png
	replaces_when_told r.png replay d.rec wall -o r.png
	replaces_when_told p.png plot d.rec -o p.png
	replaces_when_told r3/fit.png calibrate force --from forces.csv -c k.conf -o r3
}

@test "frames, films and strips are replaced with --overwrite only" {
	[ -x "$INCISE_BUILD/bin/incise-view" ] ||
		skip "incise view was not built: SDL2, epoxy, cairo or EGL were absent"
	export XDG_RUNTIME_DIR="$PWD"
	cp "$root"/scenes/wall.scene .
	small="--size 160x120 --no-panel --duration 0.2s --rate 10"
	incise view wall --procedure -o probe.png --at 0s --duration 0.05s $small 2>why ||
		skip "no OpenGL here: $(cat why)"
	replaces_when_told strip.png view wall --procedure -o strip.png --at 0s $small
	replaces_when_told f/frame-000000.png view wall --procedure -o f $small
	rm f/frame-000000.png
	fails incise view wall --procedure -o f $small -- f/frame-000001.png exists
	incise view wall --procedure -o a.mkv $small 2>why || skip "no film here: $(cat why)"
	replaces_when_told b.mkv view wall --procedure -o b.mkv $small
	replaces_when_told b.mp4 view wall --procedure -o b.mp4 $small
	# A link stays one, and a pipe a pipe.
	ln -s b.mkv link.mkv
	incise view wall --procedure -o link.mkv --overwrite $small
	[ -L link.mkv ]
	mkfifo pipe
	cat pipe >piped.mkv 3>&- &
	incise view wall --procedure -o pipe $small
	wait $!
	[ -p pipe ]
	[ "$(head -c 4 piped.mkv | od -An -tx1)" = " 1a 45 df a3" ]
}

@test "standard output, pipes and devices are written without --overwrite" {
	incise compile m.fis -o plain.fx >/dev/null
	incise compile m.fis -o - | cmp - plain.fx
	incise compile m.fis -o /dev/stdout | cmp -n "$(stat -c %s plain.fx)" - plain.fx
	for i in 1 2; do
		incise compile m.fis -o /dev/null
		incise export d.rec -o /dev/null
		incise train pairs.csv -o /dev/null --epochs 2 -o initial.fis:/dev/null -o csv:/dev/null
		incise haptic wall --rig $quick --duration 100ms -o /dev/null
	done
	[ -c /dev/null ]
	mkfifo pipe
	cat pipe >piped.fx 3>&- &
	incise compile m.fis -o pipe
	wait $!
	cmp piped.fx plain.fx
	[ -p pipe ]
}

# A line for each output of a command: its arguments, with PLACE for the path.
writers() {
	cat <<-END
		compile m.fis -o PLACE
		compile m.fis -o /dev/null -o c:PLACE
		export d.rec -o PLACE
		train pairs.csv --mf 2,2 --epochs 1 -o PLACE
		train pairs.csv --mf 2,2 --epochs 1 -o /dev/null -o initial.fis:PLACE
		train pairs.csv --mf 2,2 --epochs 1 -o /dev/null -o csv:PLACE
		train many.csv --premises m.fis --group cut -o fac:PLACE
		merge m.fac -o PLACE
		replay d.rec wall -o PLACE
		haptic wall --rig $quick --duration 100ms -o PLACE
		haptic wall --rig $quick --duration 100ms -o session:PLACE
		assess s.session -o csv:PLACE
		calibrate force --rig sim:clock=simulated --weights 0,50g,100g,200g --repeat 3 --duration 200ms -c k.conf -o csv:PLACE
	END
}

# cannot_write PLACE COMMAND…: the last line on stderr names the place; nothing is left.
cannot_write() {
	local place=$1 before
	shift
	before=$(content)
	run --separate-stderr timeout 60 "$@" </dev/null
	[ "$status" -eq 1 ] || complain "$*: exit $status: $stderr" || return
	# Warnings of the data may come before.
	[[ "${stderr_lines[-1]}" == "incise "*": "*"$place"* ]] || complain "$*: $stderr" || return
	[ "$(content)" = "$before" ] || complain "$*: changed a file"
}

# What a command names when that place is full.
full() {
	[[ "$1" == "export "* ]] && echo "the dataset" || echo "$2"
}

# bats test_tags=check
@test "where nothing can be written, each command names the place, and leaves what was there" {
	local n=0
	cp "$BATS_FILE_TMPDIR/many.csv" .
	mkdir folder shut
	chmod 555 shut
	echo old >file
	while read -r command; do
		for place in no/such/file folder shut/file; do
			# one for each command in turn, or all with CASES=all
			(((n / 3 + n++) % 3 == 0)) || [ "${CASES:-}" = all ] || continue
			# shellcheck disable=SC2086 # words of a command
			cannot_write $place "${plainly[@]}" incise ${command//PLACE/$place} || return
		done
		# shellcheck disable=SC2086
		cannot_write "$(full "$command" /dev/full)" incise ${command//PLACE//dev/full} || return
		# a disk that fills up, as EFBIG in place of ENOSPC
		# shellcheck disable=SC2086,SC2016
		cannot_write "$(full "$command" file)" bash -c 'trap "" XFSZ; set -o pipefail
			{ ulimit -f 0; incise "$@" 2>&1 >/dev/null; } | cat >&2' - ${command//PLACE/file} --overwrite || return
		[ "$(cat file)" = old ] || complain "$command: $(head -c 100 file)" || return
	done < <(writers)
	for name in no/such/a.rec shut/a.rec; do
		for overwrite in "" --overwrite; do
			# shellcheck disable=SC2086
			cannot_write "${name%/*}/" "${plainly[@]}" incise capture -o $name --rig $quick --duration 1s $overwrite
			# shellcheck disable=SC2086
			cannot_write "$name" "${plainly[@]}" incise join "$BATS_FILE_TMPDIR"/{n,w}.rec -o $name $overwrite
		done
	done
}

# bats test_tags=check
@test "a full standard output fails each command with one line" {
	incise export d.rec --rate 100 -o l.csv >/dev/null
	while read -r command; do
		# shellcheck disable=SC2086
		run --separate-stderr timeout 60 bash -c 'incise "$@" >/dev/full' - $command </dev/null
		[ "$status" -eq 1 ] || complain "$command: exit $status: $stderr" || return
		[[ "${stderr_lines[-1]}" == "incise "*": standard output: "* ]] || complain "$command: $stderr" || return
		[ "$(grep -vc ': warning: ' <<<"$stderr")" = 1 ] || complain "$command: $stderr" || return
	done <<-END
		assess s.session
		calibrate check
		calibrate depth two-point --pixels 400 -c k.conf
		capture -o c.rec --rig $quick --duration 1s
		compile m.fis -o -
		compile m.fis -o m.fx
		doctor --rig sim:
		eval m.fis --grid 3x3
		haptic wall --rig $quick --duration 100ms
		info m.fis
		info m.fis --json
		info d.rec
		join $BATS_FILE_TMPDIR/n.rec $BATS_FILE_TMPDIR/w.rec -o j.rec
		merge m.fac -o -
		plan wall
		provenance l.csv
		recalibrate d.rec -c calibration.conf
		recover d.rec -o r.rec
		replay d.rec wall
		info --all sim:
		serve --rig sim: --igtl 0 --duration 50ms
		stepper status --rig sim:
		stepper enable --duration 1s --rig sim:clock=simulated
		train pairs.csv --mf 2,2 -o -
		train pairs.csv --mf 2,2 -o n.fis
		verify d.rec
	END
	# what was made is whole
	incise verify c.rec >/dev/null
	incise info n.fis >/dev/null
}

# bats test_tags=check
@test "an extension that the command does not write is refused, and the possible ones are named" {
	while IFS='|' read -r command said; do
		# shellcheck disable=SC2086 # words of a command
		run --separate-stderr incise $command </dev/null
		bad_usage "$said"
		[ ! -e out ] && [ ! -e out.odd ]
	done <<-'END'
		export d.rec -o out.odd|--output: out.odd: unknown extension .odd; give .csv, .h5, .hdf5 or .mcap
		export d.rec -o out.CSV|--output: out.CSV: unknown extension .CSV; give .csv, .h5, .hdf5 or .mcap
		train pairs.csv -o out.odd|--output: out.odd: unknown extension .odd; give .fis, .initial.fis, .csv, .fac or .fis.tex
		compile m.fis -o out.odd|--output: out.odd: unknown extension .odd; give .fx, .plan or .c
		compile m.fis -o out.plan|--output: out.plan: unknown extension .plan; give .fx
		compile m.scene -o out.fx|--output: out.fx: unknown extension .fx; give .plan
		compile m.fis -o out.fx -o other.fx|--output other.fx: FILE.fx|NAME.plan is given twice
		replay d.rec m.scene -o out.odd|--output: out.odd: unknown extension .odd; give .csv, .png or .svg
		haptic m.scene -o out.odd|--output: out.odd: unknown extension .odd; give .csv or .session
		plot d.rec -o out.odd|--output: out.odd: unknown extension .odd; give .png, .svg, .pdf or .html
		calibrate tip --from none.csv -o out.odd|--output: out.odd: unknown extension .odd; give .csv
		capture -o out.odd|expected a name that ends in .rec
	END
	if [ -x "$INCISE_BUILD/bin/incise-view" ]; then
		misused incise view wall --procedure -o a.avi -- "--output: a.avi:"
	fi
	# No extension is none that is wrong.
	incise export d.rec -o out
	incise export d.rec -o .out
	cmp out .out
}

@test "each command ends with the files it wrote" {
	incise export d.rec -o a.csv >out
	[[ "$(cat out)" == "wrote a.csv: "*" rows from "*" cut"* ]] || complain "$(cat out)"
	ends() {
		local said=$1
		shift
		incise "$@" >out 2>err </dev/null || complain "incise $*: $(cat err)" || return
		[ "$(tail -n 1 out)" = "$said" ] || complain "incise $*: $(cat out)"
	}
	ends "wrote a.fis and a.fis.sd" train pairs.csv -o a.fis --epochs 2
	mkdir deep
	ends "wrote b.fis, deep/i.initial.fis, h.csv and b.fis.sd" train pairs.csv -o b.fis --epochs 2 \
		-o deep/i.initial.fis -o h.csv
	ends "wrote a.fis and a.fis.sd" train pairs.csv -o a.fis --epochs 2 --overwrite
	ends "wrote m.fx and m.c" compile m.fis -o m.fx -o m.c
	ends "wrote l.csv and l.session" haptic m.scene --rig $quick --duration 100ms -o l.csv -o l.session
	ends "wrote r.csv" replay d.rec m.scene -o r.csv
	ends "wrote c.rec" capture -o c.rec --rig $quick --duration 1s
	ends "wrote k.csv" calibrate force --rig sim:clock=simulated --weights 0,50g,100g,200g \
		--repeat 3 --duration 200ms -c k.conf -o k.csv
	grep -q '^wrote k.conf: active from now on$' out
	if command -v gnuplot >/dev/null; then
		ends "wrote f.png" plot d.rec -o f.png
		# more than a few files of a folder are one name
		ends "wrote deep/r/ (6 files)" calibrate force --from forces.csv -c k.conf -o deep/r
	fi
	# nothing where the data go to standard output, or where nothing is written
	incise train pairs.csv -o - --epochs 2 -o h2.csv 2>/dev/null | grep -c wrote | grep -qx 0
	incise haptic m.scene --rig $quick --duration 100ms >out
	run ! grep -q wrote out
}
