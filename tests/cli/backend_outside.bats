# SPDX-License-Identifier: GPL-2.0-or-later
# doc/device-backend.md, as who follows it: a backend built outside the tree against what was
# installed, and used by the installed programs.

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
	mkdir outside
	cd outside
}

@test "the backend of device-backend.md is built, seen, and captured with; what it lost is told" {
	command -v pkg-config >/dev/null || skip "pkg-config is not installed"
	[ "$(pkg-config --variable=moduledir incise)" = "$dest/usr/lib/incise" ]
	file_in "$page" tracker_lines.c >tracker_lines.c
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
	run --separate-stderr incise info lines:none
	failed_with "lines:none:" mkfifo
	sed -i 's/poses:100/poses:0/' rig.conf
	run --separate-stderr incise capture -o other.rec --duration 1s
	failed_with 'rig.conf:2: tracker: "lines:poses:0"' "1 to 1000 Hz"
}
