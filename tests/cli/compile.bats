# SPDX-License-Identifier: GPL-2.0-or-later
# incise compile, and compiled models in other verbs.

load cli

setup() {
	work_folder
	cp "$root/scenes/liver.fis" m.fis
}

# bats test_tags=check
@test "compile holds the default budget and says so" {
	run -0 --separate-stderr incise compile m.fis -o m.fx
	[[ "${lines[0]}" == "m.fis: "*"certified to "*" mN" ]]
	[ "$(head -c 8 m.fx)" = INCISEFX ]
	incise compile m.fis -o m.fx --overwrite --json >r.json
	# 0.1 mN, in N
	holds "$(key r.json bound_N) <= 1e-4"
	[ "$(key r.json size_bytes)" = "$(stat -c %s m.fx)" ]
}

# bats test_tags=check
@test "a tighter budget makes a finer model, too tight a one is refused" {
	incise compile m.fis -o a.fx --budget 0.09mN --json >a.json
	incise compile m.fis -o b.fx --budget 20uN --json >b.json
	holds "$(key b.json bound_N) <= 20e-6"
	holds "$(key b.json size_bytes) > $(key a.json size_bytes)"
	cp b.fx before.fx
	run --separate-stderr incise compile m.fis -o b.fx --overwrite --budget 1uN
	failed_with "m.fis: " "the bound of the best"
	cmp b.fx before.fx
}

@test "the haptic loop runs a compiled model" {
	incise compile m.fis -o m.fx
	run -0 incise haptic "$root/scenes/liver.scene" --model m.fx --rig sim:clock=simulated \
		--duration 3s
	run --separate-stderr incise haptic "$root/scenes/liver.scene" --model m.fx \
		--arith double --rig sim:clock=simulated --duration 1s
	failed_with compiled .fis
}

@test "damaged compiled models are refused" {
	incise compile m.fis -o m.fx
	size=$(stat -c %s m.fx)
	for n in 0 7 100 287 288 $((size - 1)); do
		head -c $n m.fx >bad.fx
		run --separate-stderr incise eval bad.fx <<<"5 20"
		failed_with bad.fx damaged
	done
	for at in 9 17 40 300 $((size - 3)); do
		cp m.fx bad.fx
		printf '\xa5' | dd of=bad.fx bs=1 seek=$at conv=notrunc 2>/dev/null
		run --separate-stderr incise eval bad.fx <<<"5 20"
		failed_with bad.fx
	done
}

# bats test_tags=check
@test "compile refuses by name" {
	sed "s/'gaussmf',\[[^]]*\]/'gbellmf',[2 2 5]/" m.fis >bell.fis
	fails incise compile bell.fis -o x.fx -- bell.fis gbellmf
	[ ! -e x.fx ]
	fails incise compile absent.fis -o x.fx -- absent.fis
}

@test "the C that is exported computes what the compiled model does" {
	incise compile m.fis -o m.fx -o "pig liver.c"
	cat >main.c <<-E
		#include <inttypes.h>
		#include <stdio.h>
		int32_t pig_liver_eval(const int32_t *x);
		int main(void)
		{
			int32_t x[2];

			while (scanf("%" SCNd32 "%" SCNd32, &x[0], &x[1]) == 2)
				printf("%.10g\\n", pig_liver_eval(x) / 65536.0);
			return 0;
		}
	E
	"${CC:-cc}" -std=c99 -pedantic -Wall -Wextra -Werror -c -o liver.o "pig liver.c"
	"${CC:-cc}" -std=c99 -o main main.c liver.o
	awk 'BEGIN { for (i = 0; i < 500; i++) print i * 2621, (i * 7919 % 500) * 6553 }' >q
	./main <q >c
	awk '{ printf "%.17g %.17g\n", $1 / 65536, $2 / 65536 }' q | incise eval m.fx >fx 2>/dev/null
	cmp c fx
}

@test "the integer core builds without a library, for a kernel" {
	# what the kernel has in place of stdint.h and errno.h, of the divisions that 32 bits lack, and of our CRC
	mkdir linux
	${CC:-cc} -E -dM -include errno.h -x c /dev/null | grep '#define E' >linux/errno.h
	printf '#include <%s.h>\n' stdbool stddef stdint | tee linux/types.h >linux/limits.h
	cat >linux/math64.h <<-'E'
		#include <linux/types.h>
		uint64_t div_u64(uint64_t, uint32_t), div64_u64(uint64_t, uint64_t);
		uint64_t div_u64_rem(uint64_t, uint32_t, uint32_t *);
		int64_t div64_s64(int64_t, int64_t);
	E
	cat >linux/crc32c.h <<-'E'
		#include <linux/types.h>
		uint32_t crc32c(uint32_t, const void *, unsigned int);
	E
	# its own sources, no headers but the compiler's, no float, nothing else undefined
	for bits in "" -m32; do
		echo 'int x;' >x.c
		${CC:-cc} $bits -ffreestanding -c x.c 2>/dev/null || continue
		rm -f ./*.o
		for source in "$root"/lib/fixed/*.c; do
			${CC:-cc} $bits -std=gnu11 -ffreestanding -nostdinc \
				-isystem "$(${CC:-cc} -print-file-name=include)" -O2 -Wall -Wextra -Werror \
				$([ "$(uname -m)" != x86_64 ] || echo -mgeneral-regs-only -fno-pic) \
				-I"$root/lib/include" -D__KERNEL__ -I. -c "$source" \
				-o "$(basename "$source" .c).o"
		done
		nm --defined-only --format=posix ./*.o | awk '$2 == "T" { print $1 }' | sort >has
		nm -u --format=posix ./*.o | awk '$2 == "U" { print $1 }' | sort -u >needs
		run comm -13 has needs
		[ -z "$(echo "$output" | grep -vE '^(div[0-9]*_[us]64(_rem)?|crc32c|mem(set|cpy))$')" ] || complain "$output"
		grep -q incise_ramp_tick needs
	done
}
