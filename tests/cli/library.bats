# SPDX-License-Identifier: GPL-2.0-or-later
# The shared objects and headers, as a program that links to them meets them.

load cli

setup() {
	work_folder
	CC=${CC:-cc}
	CXX=${CXX:-c++}
	include=$root/lib/include
}

parts="libincise libincise-learn libincise-record"
# built where a screen's libraries are
[ ! -e "$INCISE_BUILD/lib/libincise-view.so" ] || parts="$parts libincise-view"

# Functions that a shared object gives to others.
exported_by() {
	nm -D --defined-only "$INCISE_BUILD/lib/$1.so" |
		awk '$2 != "A" { sub(/@.*/, "", $3); print $3 }' | sort
}

# The part of the library that a header belongs to, by its own words.
part_of() {
	local part
	part=$(tr -s ' *\n' ' ' <"$1" | grep -o 'Part of libincise-[a-z]*' | head -n 1)
	echo "${part:+${part#Part of }}" | sed 's/^$/libincise/'
}

# Functions that a header itself declares for export.
declared_by() {
	# a name in front of the first parenthesis, behind INCISE_API and the type
	tr '\n\t' '  ' <"$1" | sed 's|/\*[^*]*\*\+\([^/*][^*]*\*\+\)*/||g' |
		grep -oE 'INCISE_API [^(;]*\(' | grep -oE 'incise_[a-z0-9_]+ *\($' | tr -d ' ('
}

@test "each part exports what its map lists and its headers declare" {
	for part in $parts; do
		sed -n '/^global:/,/^local:/s/^\t\(.*\);$/\1/p' "$root/lib/$part.map" |
			grep -v '\*' | sort >map
		for header in "$include"/incise/*.h; do
			[ "$(part_of "$header")" != $part ] || declared_by "$header"
		done | sort >declared
		exported_by $part >exported
		[ "$(wc -l <exported)" -gt 3 ]
		diff map exported
		diff declared exported
	done
}

@test "every export has the library's symbol version" {
	for part in $parts; do
		nm -D --defined-only --with-symbol-versions "$INCISE_BUILD/lib/$part.so" |
			awk '$2 != "A"' >symbols
		[ -s symbols ]
		run ! grep -v '@@INCISE_1$' symbols
	done
}

@test "each part has its soname, and the link to it" {
	for part in $parts; do
		soname=$(readelf -d "$INCISE_BUILD/lib/$part.so" |
			sed -n 's/.*(SONAME).*\[\(.*\)\]/\1/p')
		[ "$soname" = $part.so.2 ]
		[ "$(readlink "$INCISE_BUILD/lib/$part.so")" = $soname ]
		[ -e "$INCISE_BUILD/lib/$soname" ]
	done
}

@test "each header compiles alone, as pedantic C11 and as C++" {
	for header in "$include"/incise/*.h; do
		name=incise/${header##*/}
		# the second inclusion must be harmless
		printf '#include <%s>\n#include <%s>\nint incise_test;\n' $name $name >one.c
		cp one.c one.cc
		$CC -std=c11 -pedantic-errors -Wall -Wextra -Werror -I"$include" -fsyntax-only one.c
		$CXX -std=c++11 -pedantic-errors -Wall -Wextra -Werror -I"$include" -fsyntax-only one.cc
	done
}

# bats test_tags=check
@test "the public headers say nothing of heavy libraries" {
	run grep -rnE '#include <(sqlite3|lapacke|libconfig|jansson|libav|SDL|epoxy|opencv)' "$include"
	[ "$status" -eq 1 ] # no match; 2 would be an error
}

# The order of doubles, vectors, clocks and the list of formats have no code behind them; benchmarks also use the generator, and the
# plant, whose object they link, as incise serve does with messages of OpenIGTLink.
@test "tools use public headers only" {
	for file in "$root"/tools/*.[ch] "$root"/tools/*/*.[ch]; do
		names=$(cd "${file%/*}" && sed -n 's/^#include "\(.*\)"/\1/p' "$file" | xargs -r realpath -e) ||
			complain "$file includes what is not there"
		for name in $names; do
			case $name in
			"$root"/tools/* | "$root"/lib/base/ascending.h | "$root"/lib/base/control_character.h | "$root"/lib/base/monotonic.h | \
				"$root"/lib/base/vector.h | "$root"/lib/base/features.def | \
				"$root"/lib/publish/formats.h) ;;
			"$root"/lib/base/random.h | "$root"/lib/control/plant.h)
				[[ "$file" == "$root"/tools/bench/* ]] || complain "$file: $name" ;;
			"$root"/lib/device/igtl/igtl_message.h | "$root"/lib/base/ros2.h)
				[[ "$file" == "$root"/tools/serve/* ]] || complain "$file: $name" ;;
			*) complain "$file: $name" ;;
			esac
		done
		for name in $(sed -n 's/^#include <\(incise\/.*\)>/\1/p' "$file"); do
			[ -f "$include/$name" ] || complain "$file: $name"
		done
		run grep -nE '^#include <[^>]*\.\.' "$file"
		[ "$status" -eq 1 ]
	done
}

# bats test_tags=full
@test "make core needs libconfig alone, and its library maps nothing else" {
	mkdir pc
	cp "$(pkg-config --variable=pcfiledir libconfig)/libconfig.pc" pc
	PKG_CONFIG_LIBDIR=$PWD/pc make -C "$root" core O="$PWD/core" >log 2>&1 || {
		cat log
		false
	}
	readelf -d core/lib/libincise.so | sed -n 's/.*NEEDED.*\[\(.*\)\]/\1/p' | sed 's/\.so.*//' | sort >found
	diff - found <<-END
		ld-linux-x86-64
		libc
		libconfig
		libm
	END
}

@test "the haptic loop maps no heavy library" {
	heavy='sqlite|libcrypto|lapack|blas|gfortran|libopencv|libav|hdf5|libGL|epoxy|SDL|IGTL|ddsc|stdc'
	# names alone: a folder may be called blas
	ldd "$INCISE_BUILD/bin/incise-haptic" | sed 's/ => .*//' >haptic
	grep -q libincise.so haptic
	run grep -E "$heavy" haptic
	[ "$status" -eq 1 ]
	# what needs them has them: the pattern finds what it looks for
	ldd "$INCISE_BUILD/bin/incise-train" | grep -q libcrypto
	ldd "$INCISE_BUILD/bin/incise-export" | grep -q sqlite
	for program in incise incise-eval incise-compile; do
		ldd "$INCISE_BUILD/bin/$program" | sed 's/ => .*//' >mapped
		run grep -E "$heavy" mapped
		[ "$status" -eq 1 ]
	done
}

# Each BLAS rounds in its own way, and some start threads and map 128 MB at a time.
@test "no program depends on the BLAS that is installed" {
	for file in "$INCISE_BUILD"/bin/incise* "$INCISE_BUILD"/lib/libincise*.so; do
		readelf -d "$file" >needed
		grep -q 'NEEDED.*libc\.so' needed || complain "$file: not read" || return
		run grep -E 'NEEDED.*(lapack|blas|gfortran)' needed
		[ "$status" -eq 1 ] || complain "$file: $output" || return
	done
}

# The files that a program maps, what it loads by itself included.
maps() {
	LD_DEBUG=files LD_DEBUG_OUTPUT=$PWD/debug "$@" >/dev/null 2>&1 || :
	cat debug.* >mapped
	rm debug.*
	grep -q libincise.so mapped
}

@test "SDL, OpenGL and cairo are mapped by who draws, and by no one else" {
	screen='libSDL|libepoxy|libcairo|libEGL|libOpenGL|libGL'
	for file in "$INCISE_BUILD"/lib/lib*.so "$INCISE_BUILD"/bin/*; do
		case ${file##*/} in
		libincise-view.so | incise-view | incise-bench-view)
			ldd "$file" | grep -qE "$screen" ;;
		*)
			ldd "$file" >linked
			run ! grep -E "$screen" linked ;;
		esac
	done
}

@test "OpenCV is mapped by who looks at pictures, and by no one else" {
	for file in "$INCISE_BUILD"/lib/lib*.so "$INCISE_BUILD"/bin/*; do
		ldd "$file" >linked
		run ! grep libopencv linked
		# they send JPEG frames as rows of pixels, and put frames into a page
		[[ ${file##*/} != incise-serve && ${file##*/} != incise-plot ]] || continue
		run ! grep libjpeg linked
	done
	maps incise bench precision --quick
	run ! grep -E 'libopencv|vision_opencv|libav(format|codec)|frames_mkv' mapped
	maps incise info "$root/scenes/liver.fis"
	run ! grep -E 'libopencv|vision_opencv|libav(format|codec)|frames_mkv' mapped
	maps incise info devices
	run ! grep -E 'libopencv|vision_opencv|libav(format|codec)|frames_mkv' mapped
	printf '%s\n' 'tracker = "sim:"; stepper = "sim:"; camera = "sim:";' >rig.conf
	maps incise haptic "$root/scenes/liver.scene" --no-rt --rig rig.conf --duration 0.2s
	run ! grep -E 'libopencv|vision_opencv|libav(format|codec)|frames_mkv' mapped
	# the pattern finds it where it is
	[ -e "$INCISE_BUILD/lib/incise/vision_opencv.so" ] || skip "OpenCV's headers were absent"
	maps incise capture -o o.rec --rig sim:clock=simulated --duration 0.5s --camera depth
	grep -q vision_opencv.so mapped
	grep -q libopencv_core mapped
}

@test "a screen's libraries are mapped by who shows pictures, and by no one else" {
	# libavcodec has cairo behind it: its modules are left out
	for file in "$INCISE_BUILD"/lib/lib*.so "$INCISE_BUILD"/lib/incise/[!f]*.so "$INCISE_BUILD"/bin/*; do
		case ${file##*/} in libincise-view.so | incise-view | incise-bench-view) continue ;; esac
		ldd "$file" >linked
		run ! grep -E 'libSDL|libepoxy|libEGL|libcairo|libincise-view' linked
	done
	[ -x "$INCISE_BUILD/bin/incise-view" ] || skip "incise view was not built"
	ldd "$INCISE_BUILD/bin/incise-view" >linked
	grep -q libSDL linked
}

@test "without its module vision says where that was looked for" {
	mkdir modules
	export INCISE_MODULE_PATH=$PWD/modules
	run --separate-stderr incise capture -o o.rec --rig sim:clock=simulated --duration 0.5s --camera depth
	failed_with "vision:" \
		libopencv-imgproc-dev
	# one that is none, and one of another kind
	echo none >modules/vision_opencv.so
	run --separate-stderr incise capture -o o.rec --rig sim:clock=simulated --duration 0.5s --camera depth
	failed_with "vision:"
	cp "$INCISE_BUILD/lib/incise/tracker_tty.so" modules/vision_opencv.so
	run --separate-stderr incise capture -o o.rec --rig sim:clock=simulated --duration 0.5s --camera depth
	failed_with "contains another backend"
}

@test "no program and no library has a part of the tests" {
	nm --defined-only "$INCISE_BUILD"/obj/tests/extremes.a "$INCISE_BUILD"/obj/tests/bench/*.o 2>/dev/null |
		awk '$2 == "T" && $3 !~ /^(cli_|features_|file_|folder_|whole_|memory_|scene_|state_|complete|closed_loop_|help_|main$)/ { print $3 }' |
		sort -u >tests
	grep -qx extremes_try tests
	for file in "$INCISE_BUILD"/lib/lib*.so "$INCISE_BUILD"/lib/incise/*.so "$INCISE_BUILD"/bin/*; do
		nm --defined-only "$file" 2>/dev/null | awk '{ print $3 }' >own
		run ! grep -xFf tests own
	done
}

@test "a module exports its backend and nothing else of its own" {
	for module in "$INCISE_BUILD"/lib/incise/[!p]*.so; do
		# C++ templates leave weak symbols
		nm -D --defined-only "$module" |
			awk '$2 !~ /[VWu]/ || $3 == "incise_backend" { print $3 }' |
			grep -vxE '_end|_edata|__bss_start' >exported
		case $module in
		*/frames_mkv.so) symbol=incise_frames ;;
		*/export_hdf5.so) symbol=incise_table_hdf5 ;;
		*/film_mkv.so) symbol=incise_film_module ;;
		*/ranks_mpi.so) symbol=incise_ranks_join ;;
		*/outlet_*.so) symbol=incise_outlets_load ;;
		*) symbol=incise_backend ;;
		esac
		[ "$(cat exported)" = "$symbol" ] || complain "$module: $(cat exported)"
	done
}

@test "nothing is left unresolved" {
	for part in $parts; do
		run -0 ldd -r "$INCISE_BUILD/lib/$part.so"
		[[ "$output" != *"not found"* ]]
		[[ "$output" != *"undefined symbol"* ]]
	done
	for module in "$INCISE_BUILD"/lib/incise/[!p]*.so; do
		run -0 ldd -r "$module"
		[[ "$output" != *"not found"* && "$output" != *"undefined symbol"* ]]
	done
}

@test "libincise(3) says of each header what it is for, and of none that there is not" {
	# the table's rows: room, headers, what for
	sed -n 's/^\.It [a-z]* *Ta \([a-z_, ]*\) Ta .*/\1/p' "$root/man/libincise.3" |
		grep -v '^ *$' | tr -d ' ' | tr , '\n' | sort >told
	(cd "$include/incise" && printf '%s\n' *.h) | sed 's/\.h$//' | sort | diff told -
}

@test "the model of libincise(3)'s example compiles and runs" {
	example_in "$root/man/libincise.3" incise_model_load >program.c
	$CC -std=c11 -Wall -Wextra -Werror -I"$include" program.c -o program \
		-L"$INCISE_BUILD/lib" -Wl,-rpath,"$INCISE_BUILD/lib" -lincise
	example_in "$root/man/incise-fis.5" "[Rules]" >m.fis
	run -0 ./program m.fis
	for arithmetic in double fixed; do
		force=$(echo '5 20' | incise eval m.fis --arith $arithmetic)
		[[ "$output" == *"$(printf %.4f "$force") N in "$arithmetic* ]]
	done
	run -1 ./program none.fis
	[[ "$output" == none.fis:* ]]
	run -2 ./program
}

@test "a C++ program links" {
	cat >program.cc <<-'EOF'
		#include <cstdio>
		#include <incise/model.h>
		#include <incise/version.h>
		int main() { std::puts(incise_version()); return incise_model_load("none", nullptr) != nullptr; }
	EOF
	$CXX -std=c++11 -I"$include" program.cc -o program \
		-L"$INCISE_BUILD/lib" -Wl,-rpath,"$INCISE_BUILD/lib" -lincise
	run -0 ./program
	[ "incise $output" = "$(incise info --version)" ]
}
