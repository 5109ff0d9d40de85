# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench all, as a user meets it: that the report holds all of it, says the same in each
# form, and can be read. Times are not judged here: the machine is shared.

load cli
load report
load browser

# One report for all that only look at it. What fails here is in it, with the reason. What each
# benchmark says of itself is looked at in tests of their own.
setup_file() {
	cd "$BATS_FILE_TMPDIR"
	PATH=$INCISE_BUILD/bin:$PATH
	mkdir -p t "$shared_reports"
	TMPDIR=$PWD/t incise bench all --quick -o r >out 2>err && echo 0 >status || echo $? >status
	cp r/data/*.json "$shared_reports"
}

setup() {
	work_folder
	r=$BATS_FILE_TMPDIR/r
}

benchmarks="precision training realism stability loop view scenes"

# A folder that is a report to incise bench all, of this JSON.
report_of() {
	mkdir -p made
	printf '%s\n' "$1" >made/report.json
}

@test "one command measures every benchmark, and writes one report" {
	for file in report.html report.md report.json; do
		[ -s "$r/$file" ]
	done
	[ ! -e "$r/.unfinished" ]
	[ -z "$(ls -A "$BATS_FILE_TMPDIR/t")" ]
	[ -n "$(key "$r/report.json" machine.cpu)" ]
	[ -n "$(key "$r/report.json" date)" ]
	[ "$(key "$r/report.json" quick)" = 1 ]
	[ "$(key "$r/report.json" command)" = "incise bench all -o DIR --quick" ]
	[ "incise $(key "$r/report.json" version)" = "$(incise --version | head -n 1)" ]
	for benchmark in $benchmarks; do
		case $(key "$r/report.json" "runs.$benchmark.state") in
		measured)
			cmp <(jq ".benchmarks.$benchmark" "$r/report.json") <(jq . "$r/data/$benchmark.json")
			grep -qF "(data/$benchmark.json)" "$r/report.md" ;;
		failed | "left out")
			grep -qE "^- $benchmark: (failed|left out): .{10}" "$r/report.md" ;;
		*) complain "$benchmark: what came out?" ;;
		esac
	done
	# what needs no screen, camera or real time
	for benchmark in precision training stability; do
		[ "$(key "$r/report.json" "runs.$benchmark.state")" = measured ]
	done
	holds "$(key "$r/report.json" "figures[0].value") > 0"
	[[ "$(key "$r/report.json" "figures[0].name")" == "precision: "* ]]
}

@test "each report agrees with its schema" {
	for python in python3 /usr/bin/python3; do
		! "$python" -c "import jsonschema" 2>/dev/null || break
	done
	"$python" -c "import jsonschema" || skip "python3-jsonschema is not installed"
	incise bench compare "$r/data/training.json" "$r/data/training.json" --json >compare.json
	run "$python" "$BATS_TEST_DIRNAME/json_schema.py" "$INCISE_BUILD/schema" "$r/report.json" "$r"/data/*.json compare.json
	[ "$status $output" = "0 " ] || complain "$output"
	# each benchmark that was measured is one of them
	for benchmark in $benchmarks; do
		[ -e "$INCISE_BUILD/schema/bench-$benchmark.json" ]
	done
}

@test "it fails when a benchmark failed, and says where that stands" {
	n=$(sqlite3 :memory: "SELECT json_array_length(readfile('$r/report.json'), '\$.failed')")
	if [ "$n" = 0 ]; then
		[ "$(cat "$BATS_FILE_TMPDIR/status")" = 0 ]
		[ ! -s "$BATS_FILE_TMPDIR/err" ]
	else
		[ "$(cat "$BATS_FILE_TMPDIR/status")" = 1 ]
		[ "$(cat "$BATS_FILE_TMPDIR/err")" = \
			"incise bench all: $n of 7 benchmarks failed; r/report.md says why" ]
	fi
}

@test "HTML and Markdown say the same" {
	python3 "$BATS_TEST_DIRNAME/report_cells.py" "$r/report.html" >html
	python3 "$BATS_TEST_DIRNAME/report_cells.py" "$r/report.md" >md
	# the list of contents is behind the title in both
	[ "$(wc -l <html)" -gt 500 ]
	diff html md
	grep -qx fixed_table html
	grep -qx "picture .*" html
}

@test "the report begins with a verdict of three sentences and a figure" {
	for file in "$r/report.html" "$r/report.md"; do
		python3 "$BATS_TEST_DIRNAME/report_cells.py" "$file" >cells
		mapfile -t lines < <(head -n 6 cells)
		[[ "${lines[1]}" =~ ^"Error against run time: a fixed-point force takes "[0-9.]+" ns and is within "[0-9.]+" µN " ]]
		[[ "${lines[2]}" =~ ^"Stable when stiff: "[0-9]+" of "[0-9]+" simulated " ]]
		[[ "${lines[3]}" =~ ^"Nothing that a scene does not need: "[0-9]+" of "[0-9]+" scenes " ]]
		! command -v gnuplot >/dev/null || [[ "${lines[4]}" == "picture A scatter of evaluators"* ]]
		# a sentence each
		for line in "${lines[@]:1:3}"; do
			[ "$(grep -o '\.\( \|$\)' <<<"$line" | wc -l)" = 1 ] || complain "$line"
		done
	done
	# of nothing, it says so, and what was measured is in it
	report_of '{"benchmarks": {"none": {"rows": []}}, "quick": true}'
	incise bench all --from made
	[ "$(grep -c 'not measured\.$' made/report.md)" = 3 ]
}

@test "each row of the summary can be read alone, in a quick report too" {
	python3 "$BATS_TEST_DIRNAME/report_cells.py" "$r/report.md" >cells
	run ! grep '^…' cells
	# a row whose neighbour is missing: only one of two textures
	report_of '{"benchmarks": {"view": {"frames": [{"width": 1280, "texture_px": 512, "frames_hz": 61}]}}}'
	incise bench all --from made
	grep -qF '| Frame rate of a bleeding wound, 1280 × 720, texture of 512² | 61 Hz |' made/report.md
	run ! grep -F '2048²' made/report.md
}

@test "a percentile of too few samples is a dash, with the reason" {
	# 200 wake-ups resolve the 99th percentile, and not the 99.9th
	report_of '{"benchmarks": {"loop": {"wakeups": {"rows": [{"load": "idle", "rate_hz": 1000,
		"lateness_us": {"median": 12, "p99": 34, "p999": null, "max": 56}, "cyclictest_us": null}]}},
		"precision": {"rows": [{"name": "fixed_table", "ns": 10, "ns_p5": null, "ns_p95": null},
		{"name": "fuzzylite", "ns": null, "ns_p5": null, "failed": "not built in"}]}}}'
	incise bench all --from made
	grep -qE '^\| Wake-up latency at 1 kHz, idle machine: 99.9th percentile \| – \(fewer than 1000 samples\) \|' made/report.md
	# a program that was not there took no samples at all
	run ! grep 'cyclictest at the same time' made/report.md
	grep -qF '| idle | 1000 | 12 | 34 | – | 56 |' made/report.md
	grep -qx '“–” means fewer samples than the percentile needs: 99.9 %, µs takes 1000.' made/report.md
	grep -qx '“–” means fewer samples than the percentile needs: 5 %, ns takes 20, 95 %, ns takes 20.' made/report.md
	# what was measured follows the same rule: 20 values for the 5th, 1000 for the 99.9th
	[ "$(sqlite3 :memory: "SELECT count(*) FROM json_each(readfile('$r/data/loop.json'), '\$.wakeups.rows')
		WHERE (json_extract(value, '\$.lateness_us.p999') IS NULL) <>
			(coalesce(json_extract(value, '\$.lateness_us.ticks'), 0) < 1000)")" = 0 ]
}

@test "reference implementations are named, with how to measure them" {
	for name in fuzzylite scikit-learn cyclictest MATLAB CHAI3D SOFA; do
		grep -qE "^\| $name[^|]* \| [^|]+ \| [^|]+ \| .{40}" "$r/report.md"
	done
	grep -q '^| CHAI3D .*computeInteractionForces()' "$r/report.md"
}

@test "every picture is there, in both" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed, it draws the pictures"
	grep -oE '\(plots/[a-z-]+\.svg\)' "$r/report.md" | tr -d '()' >named
	(cd "$r" && ls plots/*.svg) >there
	# the one of the verdict is in its section, too
	diff <(sort -u named) there
	[ "$(grep -c . named)" = 3 ]
	[ "$(grep -o 'src="data:image/svg+xml;base64,' "$r/report.html" | wc -l)" = "$(grep -c . named)" ]
	while read -r file; do
		base64 -w0 <"$r/$file" >coded
		grep -qFf coded "$r/report.html"
	done <named
}

@test "its figures can be printed: no text is cut, none overlaps, axes are quantity / unit" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed, it draws the pictures"
	python3 "$BATS_TEST_DIRNAME/figures.py" "$r"/plots/*.svg
}

@test "no number is missing by its name, and nothing comes from elsewhere" {
	python3 "$BATS_TEST_DIRNAME/report_cells.py" "$r/report.md" >cells
	run ! grep -iwE '^[+-]?(nan|null|inf)$|^null| null' cells
	run ! grep -oE '(src|href)="(https?:)?//[^"]*' "$r/report.html"
	run ! grep -E '<script|<link [^>]*stylesheet|@import|url\(' "$r/report.html"
	run ! grep -F '://' "$r/report.md"
	if command -v tidy >/dev/null; then
		run -0 tidy -q -e --drop-empty-elements no "$r/report.html"
		[ -z "$output" ]
	fi
}

@test "--from writes the same again" {
	cp -r "$r" again
	rm again/report.html again/report.md
	run -0 --separate-stderr incise bench all --from again
	fails incise bench all --from again -- again/report.html exists --overwrite
	run -0 --separate-stderr incise bench all --from again --overwrite
	[ -z "$stderr" ]
	for file in report.html report.md report.json; do
		cmp "$r/$file" "again/$file"
	done
}

# bats test_tags=slow
@test "a benchmark that fails stands in the report, and the others go on" {
	few_files() (
		ulimit -n 18
		incise bench all --quick -o r --only precision,scenes
	)
	fails few_files -- "1 of 2 benchmarks failed" r/report.md
	grep -qE "^- scenes: failed: .*Too many open files" r/report.md
	grep -qE "see “Failures and omissions”" r/report.md
	[ "$(key r/report.json 'failed[0]')" = scenes ]
	[ ! -e r/data/scenes.json ]
	grep -q "^## Force evaluation" r/report.md
	run ! grep "^## Stability" r/report.md
	# it is replaced by the next one
	fails incise bench all --quick -o r --only training -- r/report.html exists --overwrite
	incise bench all --quick -o r --overwrite --only training --json >r.json
	cmp r.json r/report.json
	[ "$(ls r)" = "$(printf '%s\n' data plots report.html report.json report.md)" ]
	[ "$(ls r/data)" = training.json ]
}

# bats test_tags=slow
@test "what changed since another report stands in it" {
	# figures that are exact, of the same program
	incise bench all --quick -o r --only training
	run --separate-stderr incise bench all --quick -o r --overwrite --only training \
		--against r/report.json
	failed_with r/report.json "is an input"
	cp r/report.json first.json
	run --separate-stderr incise bench all --quick -o r --overwrite --only training,precision \
		--against first.json
	grep -q "^## Changes" r/report.md
	# the exact ones are; times may be worse by chance
	holds "$(key r/report.json against.same) >= 14"
	[ "$(key r/report.json against.file)" = first.json ]
	n=$(sqlite3 :memory: "SELECT json_array_length(readfile('r/report.json'), '\$.against.gone')
		+ json_extract(readfile('r/report.json'), '\$.against.worse')")
	# not for tests/messages, which must not depend on how busy the machine is
	if [ "$n" = 0 ]; then
		[ "$status" = 0 ]
	else
		[ "$status" = 1 ] && [[ "$stderr" == "incise bench all: $n metric"*" compared with first.json; "* ]]
	fi
	# of an older one that was better, and had more
	jq '.benchmarks.training.figures |= map(if .name == "classic error on unseen cuts" then .value = 1e-9 else . end) +
		[{name: "other", kind: "exact", unit: "mm", value: 1}]' r/report.json >old.json
	run --separate-stderr incise bench all --quick -o r --overwrite --only training --against old.json
	failed_with "worse or missing compared with old.json; r/report.md says which"
	grep -qF -- "- Missing: training: other" r/report.md
	grep -qE "^\| training \| .* \| 1.000×10⁻⁹ \| .* \| yes \|$" r/report.md
	# what is none is said before anything is measured
	echo '{}' >none.json
	fails incise bench all --quick -o new --against none.json -- none.json
	[ ! -e new ]
}

@test "what a report holds is shown as it is, whatever it is" {
	report_of '{"benchmarks": {"training": {"rows": [
		{"name": "<script>alert(1)</script>", "ms": 1.5, "failed": "a|b *c* [d](e) `f` & \"g\""},
		{"name": "\\| --- \u0007_x_ <!--", "ms": 1e300, "failed": null}, 7, null],
		"figures": 3}, "no_such_word": {}, "loop": [], "pose": {"rows": {"a": 1}}},
		"runs": {"training": 5, "view": {"state": "failed", "why": "</p><b>x", "warnings": ["1. x", 2]}},
		"machine": {"cpu": "\"<i>\u00e9"}, "failed": ["view"], "command": "`$(x)`\n```<b>", "date": 3}'
	incise bench all --from made
	run ! grep -E '<(script|i|b)>|<!--' made/report.html
	grep -qF '&lt;script&gt;alert(1)&lt;/script&gt;' made/report.html
	grep -qF '| \<script\>alert(1)\</script\> |' made/report.md
	grep -qF 'a\|b \*c\* \[d\](e) \`f\` \& "g"' made/report.md
	grep -qF '1.00×10³⁰⁰' made/report.md
	# no fence that a command would end
	grep -qxF "'\$(x)' '''<b>" made/report.md
	diff <(python3 "$BATS_TEST_DIRNAME/report_cells.py" made/report.html) \
		<(python3 "$BATS_TEST_DIRNAME/report_cells.py" made/report.md)
}

@test "what is no report is refused, and stays" {
	mkdir other
	echo mine >other/report.json
	fails incise bench all -o other -- "other: not empty and not a report; give another -o DIR"
	[ "$(cat other/report.json)" = mine ]
	[ "$(ls -A other)" = report.json ]
	touch file
	fails incise bench all -o file -- "file: Not a directory"
	fails incise bench all --from other -- other/report.json
	fails incise bench all --from nowhere -- nowhere/report.json
	echo '{"rows": []}' >other/report.json
	fails incise bench all --from other -- "other/report.json: not a report"
}

@test "bench all: a folder without a name" {
	misused incise bench all -o "" -- "the folder has no name"
}

@test "an interrupted one leaves what was there, and ends what it started" {
	cp -r "$r" old
	cp old/report.json was.json
	for folder in old "new/one"; do
		incise bench all -o "$folder" --overwrite --only stability 2>err &
		pid=$!
		until [ -e "$folder/.unfinished/data/stability.json" ]; do sleep 0.05; done
		until child=$(ps -o pid= --ppid "$pid" | tr -d ' ') && [ -n "$child" ]; do sleep 0.05; done
		kill -INT "$pid"
		wait "$pid" && complain "it went on" || [ "$?" = 1 ]
		grep -qx "incise bench all: Interrupt: $folder is unchanged" err
		run ! kill -0 "$child"
	done
	cmp old/report.json was.json
	[ ! -e old/.unfinished ]
	[ ! -e new/one ]
}

# ---- in a browser ----

@test "a browser shows it: no error, no text that is small, nothing wider than a phone" {
	browser --dump-dom 'data:text/html,<script>console.error("heard")</script>' >/dev/null
	grep -q 'CONSOLE.*heard' said # so that silence means something
	for width in 390 1280; do
		answer=$(shown_in $width "$r/report.html")
		echo "$width: $answer"
		read -r inner page small pictures blank broken twice wide named cells <<<"$answer"
		[ "$inner" = "$width" ]
		[ "$page" -le "$width" ]
		[ "$small $blank $broken $twice" = "0 0 0 0" ]
		[ "$pictures" = "$(grep -c '^!\[' "$r/report.md")" ]
		# on a phone a row is a block, its cells have the names of their columns, and nothing
		# scrolls sideways; on a screen a wide table scrolls in its own box
		if [ "$width" = 390 ]; then
			[ "$cells" -gt 500 ]
			[ "$wide $named" = "0 $cells" ]
		else
			[ "$named" = 0 ]
		fi
	done
}

# bats test_tags=slow
@test "pictures of the report, and its pages" {
	mkdir -p "$INCISE_BUILD/artefacts"
	for size in 390,844 1280,2000; do
		browser --window-size=$size --screenshot="$PWD/$size.png" "file://$r/report.html"
		run ! grep CONSOLE said
		# a page of one colour is some kilobytes
		[ "$(wc -c <"$size.png")" -gt 30000 ]
		cp "$size.png" "$INCISE_BUILD/artefacts/report-${size/,/x}.png"
	done
	browser --no-pdf-header-footer --print-to-pdf="$PWD/report.pdf" "file://$r/report.html"
	[[ "$(head -c 5 report.pdf)" == %PDF- ]]
	# each section begins a page
	[ "$(grep -ac '/Type */Page\b' report.pdf)" -ge "$(grep -c '^## ' "$r/report.md")" ]
	cp report.pdf "$INCISE_BUILD/artefacts/report.pdf"
}

@test "the figures of doc/evidence.md are facts of the report, put there by mk/readme-figures" {
	facts=$(sed -n 's/^\t\["\(.*\)", .*, to(".*")\],$/| \1 |/p' "$root/tools/report/bench.j2" | sed 's/", .*/ |/')
	figures=$(sed -n '/^<!-- figures: make bench/,/^<!-- end of figures/p' "$root/doc/evidence.md")
	[ "$(grep -c '^\*\*' <<<"$figures")" = 3 ]
	n=0
	while read -r name; do
		[[ "$facts" == *"| $name |"* ]] || complain "no fact: $name"
		n=$((n + 1))
	done < <(sed -n 's/^| \([^|]*\) | .* |$/\1/p' <<<"$figures" | grep -v -e '^metric$' -e '^---')
	((n > 15))
	run -1 --separate-stderr "$root/mk/readme-figures" "$PWD/none"
	[[ "$stderr" == *"'make bench' makes one"* ]]
}
