# SPDX-License-Identifier: GPL-2.0-or-later
# incise plot: each kind of file, by its content; the forms of a figure; what is refused.

load cli

setup_file() {
	made_pairs >"$BATS_FILE_TMPDIR/pairs.csv"
	incise train "$BATS_FILE_TMPDIR/pairs.csv" -o "$BATS_FILE_TMPDIR/m.fis" >/dev/null 2>&1
	incise compile "$BATS_FILE_TMPDIR/m.fis" -o "$BATS_FILE_TMPDIR/m.fx" >/dev/null
}

setup() {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed"
	work_folder
	cp "$BATS_FILE_TMPDIR"/m.f* "$BATS_FILE_TMPDIR/pairs.csv" .
	mkdir tmp
	export TMPDIR=$PWD/tmp
	unset DISPLAY WAYLAND_DISPLAY
}

# Nothing stays in TMPDIR, whatever happened.
teardown() {
	[ ! -d tmp ] || [ -z "$(ls -A tmp)" ]
}

# Draw a file as SVG: the texts of the figure are in the file texts, a line each.
draws() {
	incise plot "$@" -o figure.svg --overwrite >out
	[ "$(cat out)" = "wrote figure.svg" ] || complain "$(cat out)" || return
	python3 - >texts <<-'END'
		import xml.etree.ElementTree as tree
		for text in tree.parse("figure.svg").iter("{http://www.w3.org/2000/svg}text"):
		    print("".join(text.itertext()))
	END
}

# The figure has each of these texts as a whole.
shows() {
	for text; do
		grep -qxF -e "$text" texts || complain "no '$text' among: $(cat texts)" || return
	done
}

@test "a model: functions, surface and contours" {
	draws m.fis
	shows "depth / mm" "velocity / (mm/s)" "force / N" degree in1mf1
	! grep -q residual texts
	# a curve for each function: 5 over the depth and 4 over the velocity
	[ "$(grep -c '^in[12]mf[1-9]$' texts)" = 9 ]
}

@test "a compiled model has no functions to show" {
	draws m.fx
	shows "depth / mm" "velocity / (mm/s)" "force / N"
	! grep -qE 'degree|residual' texts
}

@test "residuals are those of incise eval" {
	draws m.fis --data pairs.csv
	shows "residual of force / N" "quantile of the normal distribution / SD"
	awk -F, 'NR > 1 { print $2, $3 }' pairs.csv >points
	# the mean is rounded to two digits, the RMSE to three
	paste -d, <(tail -n +2 pairs.csv) <(incise eval m.fis points) | awk -F, '
		{ e = $4 - $5; sum += e; squares += e * e; n++ }
		END { printf "%d rows: measured - model, RMSE %.3g, mean %.2g\n",
			n, sqrt(squares / n), sum / n }' >want
	shows "$(cat want)"
	# rows where the blade did not advance are no data of the model
	sed '1s/$/,advancing/; 2,11s/$/,0/; 12,$s/$/,1/' pairs.csv >some.csv
	draws m.fx --data some.csv
	grep -q "^278 rows: measured - model" texts
}

@test "a dataset: over depth and velocity, and by cut" {
	draws pairs.csv
	shows "pairs.csv: 288 rows" "depth / mm" "velocity / (mm/s)" "force / N" \
		"mean and SD" cut mean SD "cut 1" "cut 6"
	! grep -qx "cut 7" texts
	cut -d, -f2,4 pairs.csv >two.csv
	draws two.csv
	shows "two.csv: 288 rows" "depth / mm"
	! grep -qE "velocity|cut" texts
	# averaged rows bring their own deviation
	sed '1s/$/,sd_N/; 2,$s/$/,0.05/' pairs.csv >averaged.csv
	draws averaged.csv
	shows "SD in the bin"
	! grep -qx "mean and SD" texts
}

@test "many rows make no larger a figure" {
	awk 'BEGIN { print "depth_mm,force_N"; for (i = 0; i < 200000; i++)
		printf "%.4f,%.4f\n", i % 1999 / 100, i % 5003 / 1000 }' >many.csv
	draws many.csv
	# there are 300 x 200 places, of 30 bytes at most in the data and 100 in the SVG
	[ "$(stat -c %s figure.svg)" -lt 6000000 ]
	[ "$(grep -c '<use' figure.svg)" -gt 10000 ]
}

@test "little data and a flat model are drawn too" {
	printf 'depth_mm,force_N\n1,2\n' >one.csv
	draws one.csv
	shows "one.csv: 1 rows"
	sed -E "s/^(MF[0-9]+='out1mf[0-9]+':'linear',).*/\1[0 0 0]/" m.fis >flat.fis
	! cmp -s m.fis flat.fis
	draws flat.fis --data pairs.csv
	shows "force / N"
	# a text in a file is no command of gnuplot
	sed "s/^Name='depth_mm'/Name='\`touch broken\`_mm'/" m.fis >odd.fis
	! cmp -s m.fis odd.fis
	draws odd.fis
	shows " touch broken  / mm"
	[ ! -e broken ] && [ ! -e tmp/broken ]
}

@test "the kind is that of the content, not of the name" {
	cp m.fis dataset.csv
	draws dataset.csv
	shows degree
	cp m.fx model.fis
	draws model.fis
	! grep -q degree texts
	(echo "# a comment"; echo; cat pairs.csv) >m.fx
	draws m.fx
	shows "m.fx: 288 rows"
}

@test "PNG and SVG follow from the extension, others are refused" {
	run -0 --separate-stderr incise plot m.fis -o a.png
	[ "$output" = "wrote a.png" ] && [ -z "$stderr" ]
	[ "$(od -An -c -N 4 a.png | tr -d ' ')" = '211PNG' ]
	run -2 --separate-stderr incise plot m.fis -o a.pdf
	bad_usage "-o: 'a.pdf' has no extension of a figure; give NAME.png or NAME.svg"
	run --separate-stderr incise plot m.fis -o a.png
	failed_with "a.png: exists; give --overwrite"
	cp pairs.csv pairs.svg
	run --separate-stderr incise plot pairs.svg -o pairs.svg --overwrite
	failed_with "pairs.svg: is an input"
	cmp pairs.csv pairs.svg
	run --separate-stderr incise plot m.fis -o none/a.png
	failed_with none/a.png
}

@test "files that it does not draw" {
	run --separate-stderr incise plot nothing.fis -o a.png
	failed_with "nothing.fis: No such file or directory"
	printf 'a,b\n1,2\n' >other.csv
	run --separate-stderr incise plot other.csv -o a.png
	failed_with "other.csv:1: there is no column 'force_N'; the columns are: a, b"
	run --separate-stderr incise plot m.fis --data other.csv -o a.png
	failed_with "other.csv:1: there is no column 'depth_mm'"
	head -n 20 m.fis >half.fis
	run --separate-stderr incise plot half.fis -o a.png
	failed_with half.fis
	head -c 100 /dev/urandom >noise
	run --separate-stderr incise plot "$root/scenes/liver.scene" -o a.png
	failed_with "liver.scene: this is a scene, not" "'incise plan "
	run --separate-stderr incise plot m.fis --data m.fx -o a.png
	failed_with "m.fx: this is a compiled model (.fx), not a CSV table"
	for file in noise "$root/README.md" /dev/null .; do
		run --separate-stderr incise plot "$file" -o a.png
		failed_with "$file: "
	done
	run -2 --separate-stderr incise plot pairs.csv --data pairs.csv -o a.png
	bad_usage "--data is for a model, and pairs.csv is none"
	[ ! -e a.png ]
}

@test "without gnuplot, and without a display, it says what helps" {
	run --separate-stderr env PATH="$INCISE_BUILD/bin" incise plot m.fis -o a.png
	failed_with "gnuplot is not installed" "apt-get install gnuplot-nox"
	run --separate-stderr incise plot m.fis
	failed_with "there is no display for a window; give -o NAME.png or NAME.svg"
	mkdir bin
	printf '#!/bin/sh\necho png svg\n' >bin/gnuplot
	chmod +x bin/gnuplot
	DISPLAY=:7 PATH=$PWD/bin:$PATH run --separate-stderr incise plot m.fis
	failed_with "this gnuplot opens no windows; give -o" "apt-get install gnuplot-qt"
}

@test "an error of gnuplot is one line, and nothing is written" {
	mkdir bin
	cat >bin/gnuplot <<-'END'
		#!/bin/sh
		printf 'set x\n    ^\n"f.gp" line 3: wrong\n' >&2
		exit 1
	END
	chmod +x bin/gnuplot
	PATH=$PWD/bin:$PATH run --separate-stderr incise plot m.fis -o a.png
	failed_with 'gnuplot could not draw it: "f.gp" line 3: wrong'
	[ ! -e a.png ]
}
