# SPDX-License-Identifier: GPL-2.0-or-later
# The examples, as someone meets them who has incise installed: built by its pkg-config files, run
# with its programs. doc/device-backend.md explains one of them.

load cli
load document

setup() {
	work_folder
	page=$root/doc/device-backend.md
	dest=$PWD/dest
	env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u LD_LIBRARY_PATH \
		make -s --no-print-directory -C "$root" O="$INCISE_BUILD" install DESTDIR="$dest" prefix=/usr
	unset LD_LIBRARY_PATH
	PATH=$dest/usr/bin:$PATH
	export PKG_CONFIG_SYSROOT_DIR=$dest PKG_CONFIG_LIBDIR=$dest/usr/lib/pkgconfig
	# /usr/include is no folder of the system's here
	export PKG_CONFIG_ALLOW_SYSTEM_CFLAGS=1 PKG_CONFIG_ALLOW_SYSTEM_LIBS=1
	examples=$dest/usr/share/doc/incise/examples
	cp -r "$examples" outside
	cd outside
}

# Build all of them; the libraries are found where they were installed for this test.
build_examples() {
	command -v pkg-config >/dev/null || skip "pkg-config is not installed"
	[ "$(pkg-config --variable=moduledir incise)" = "$dest/usr/lib/incise" ]
	env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s CFLAGS=-Werror LDFLAGS="-Wl,-rpath,$dest/usr/lib" "$@"
}

@test "the examples that are installed are those of the source, and no more" {
	(cd "$root" && git ls-files examples 2>/dev/null || find examples -type f) | sed 's|^examples/||' | sort >../there
	[ "$(wc -l <../there)" -ge 5 ]
	find . -type f | sed 's|^./||' | sort | diff ../there -
	for name in $(cat ../there); do
		cmp "$root/examples/$name" "$name"
		grep -q "$name" README.md || [ "$name" = README.md ]
	done
	[ -x capture_to_figure.sh ]
}

@test "own_loop renders a scene: no force in the air, and that of the scene in the tissue" {
	build_examples own_loop
	# but for the force along the cut, and the texture
	smooth_liver
	sed -i 's/fracture_J_m2 = .*;/fracture_J_m2 = 0.0;/' liver.scene
	cp "$dest/usr/share/incise/scenes/liver.fis" .
	run -0 --separate-stderr ./own_loop liver.scene
	[ "${#lines[@]}" -eq 17 ]
	[[ "${lines[-1]}" =~ ^4000\ ticks,\ [0-9]+\ late\;\ up\ to\ ([0-9.]+)\ mm\ and\ ([0-9.]+)\ N$ ]]
	# The script goes 8 mm deep; predicted poses overshoot by less than a tenth of a mm there.
	holds "${BASH_REMATCH[1]} > 7.95 && ${BASH_REMATCH[1]} < 8.1"
	# While it cuts 8 mm deep at 10 mm/s the force is that of the scene's model, rounded to 1 mN
	# and to 0.01 mm of the slope of 0.1 N/mm.
	read -r _ _ depth _ force _ <<<"${lines[7]}"
	model=$(echo 8 10 | incise eval "$dest/usr/share/incise/scenes/liver.fis")
	holds "($depth - 8) ^ 2 < 0.01 ^ 2 && ($force - $model) ^ 2 < 0.003 ^ 2"
	# and at its end, in the air, there is none
	read -r _ _ depth _ force _ <<<"${lines[15]}"
	holds "$depth == 0 && $force == 0"
	run -1 --separate-stderr ./own_loop none.scene
	[[ "$stderr" == "./own_loop: none.scene: No such file"* ]]
	run -2 --separate-stderr ./own_loop
}

@test "slow_host feels a scene at 60 steps a second" {
	build_examples slow_host
	smooth_liver
	sed -i 's/fracture_J_m2 = .*;/fracture_J_m2 = 0.0;/' liver.scene
	cp "$dest/usr/share/incise/scenes/liver.fis" .
	run -0 --separate-stderr ./slow_host liver.scene
	[ "${#lines[@]}" -eq 10 ]
	read -r _ _ depth _ force _ <<<"${lines[0]}"
	holds "$depth == 0 && $force == 0"
	# 5 mm/s, straight down
	read -r _ _ depth _ force _ <<<"${lines[9]}"
	model=$(echo "$depth" 5 | incise eval "$dest/usr/share/incise/scenes/liver.fis")
	holds "($depth - 7) ^ 2 < 0.01 ^ 2 && ($force - $model) ^ 2 < 0.02 ^ 2"
	run -1 --separate-stderr ./slow_host none.scene
	[[ "$stderr" == "./slow_host: none.scene: No such file"* ]]
	run -2 --separate-stderr ./slow_host
}

@test "capture_to_figure.sh leaves a recording, data, a model and two figures" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed"
	run -0 --separate-stderr ./capture_to_figure.sh out
	[[ "$output" == *"cuts.rec: complete"* ]]
	[ "$(head -c 8 out/recording.png | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]
	[[ "$(head -c 200 out/force.svg)" == *"<svg"* ]]
	incise info out/force.fis >/dev/null
	[ "$(grep -v '^#' out/pairs.csv | head -n 1 | tr , '\n' | grep -cx 'cut\|depth_mm\|velocity_mm_s\|force_N')" -eq 4 ]
	# another rig, named from where the script was called
	echo 'clock = "simulated"; tracker = "sim:"; force = "sim:"; sim = { depth_mm = [8]; times = [4]; };' >my.conf
	RIG=my.conf run -0 --separate-stderr ./capture_to_figure.sh other
	[ -s other/force.svg ]
	# it stops where a step fails
	RIG=sim:nosuch=1 run -1 --separate-stderr ./capture_to_figure.sh third
	[ -z "$(ls -A third)" ]
	run --separate-stderr ./capture_to_figure.sh
	[[ "$status" -ne 0 && "$stderr" == *"FOLDER is missing"* ]]
}

@test "device-backend.md shows parts of the example" {
	awk '/^<!-- part: tracker_lines.c -->/ { n++; getline; inside = 1; next }
		/^```/ { inside = 0 } inside { print >("part." n) }' "$page"
	[ "$(printf '%s\n' part.* | wc -l)" -eq 4 ]
	for part in part.*; do
		python3 -c 'import sys; sys.exit(open(sys.argv[1]).read() not in open("tracker_lines.c").read())' "$part" ||
			complain "$part is not in the file: $(cat "$part")"
	done
}

@test "the backend of device-backend.md is built, found, and captured with; it counts what is lost" {
	build_examples
	rm tracker_lines.so # of the Makefile; the page's commands build it again
	file_in "$page" rig.conf >rig.conf
	${CC:-cc} -std=gnu11 -Wall -Wextra -Werror -fsyntax-only tracker_lines.c \
		$(pkg-config --cflags incise)
	commands_in "$page" run >commands
	[ "$(grep -c '^incise' commands)" -eq 3 ]
	run -0 --separate-stderr bash -e commands
	[[ "$output" == *"tracker = \"lines:poses:100\";"* ]]
	[[ "$output" == *"capture reported a lost sample"* ]]
	# the loop's last line is 44 mm deep
	sqlite3 -readonly lines.rec/recording.db >rows \
		'SELECT count(*), max(seq), min(z_mm), max(z_mm), sum(x_mm = seq) FROM tracker'
	[ "$(cat rows)" = "149|149|-44.0|5.0|149" ]
	run -1 --separate-stderr incise verify lines.rec
	[[ "$output" == *"tracker: 1 missing, number 120,"* ]]
	# and what it refuses
	export INCISE_MODULE_PATH=$PWD/modules
	fails incise info lines:none -- "lines:none:" mkfifo
	sed -i 's/poses:100/poses:0/' rig.conf
	run --separate-stderr incise capture -o other.rec --duration 1s
	failed_with 'rig.conf:2: tracker: "lines:poses:0"' "1 to 1000 Hz"
}
