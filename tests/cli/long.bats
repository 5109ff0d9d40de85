# SPDX-License-Identifier: GPL-2.0-or-later
# Ten hours: what is asked of a long recording costs what is asked, in memory and in bytes that are read.

load cli

# BYTES-READ MEMORY-KB of a command, which must succeed; what it prints is in output.txt.
cost() {
	python3 - "$@" <<'PY'
import resource, subprocess, sys
read = lambda: int(open("/proc/self/io").readline().split()[1])  # with children that ended
before = read()
with open("output.txt", "w") as out:
    subprocess.run(sys.argv[1:], check=True, stdout=out)
print(read() - before, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
PY
}

@test "of ten hours info reads no sample, a part is read alone, and nothing takes memory by length" {
	incise capture -o short.rec --rig sim:clock=simulated --duration 127s >/dev/null
	cp -r short.rec long.rec
	"$INCISE_BUILD/tests/longer" short.rec long.rec 284
	size=$(stat -c %s long.rec/recording.db)

	read -r bytes kB < <(cost incise info long.rec)
	echo "info: $bytes bytes of $size, $kB kB"
	grep -q '^recording long.rec: 36068.0 s' output.txt
	grep -q "^samples *not read" output.txt
	[ "$bytes" -lt 5000000 ]
	[ "$kB" -lt 60000 ]

	read -r bytes kB < <(cost incise verify long.rec)
	echo "verify: $bytes bytes, $kB kB"
	grep -q '^force *360680000 expected, 360680000 present, 0 lost' output.txt
	grep -q 'complete, and as it was written' output.txt
	[ "$kB" -lt 60000 ]

	# The same ten seconds of the short one, at both ends and in the middle: nothing is read of what lies before
	# the cut before, and nothing of what lies behind.
	incise export short.rec --resample --range 40s..50s -o short.csv
	for k in 1 142 283; do
		read -r bytes kB < <(cost incise export long.rec --resample --range "$((127 * k + 40))s..$((127 * k + 50))s" \
			-o $k.csv)
		echo "part $k: $bytes bytes, $kB kB"
		[ "$bytes" -lt $((size / 30)) ]
		[ "$kB" -lt 60000 ]
		[ "$(grep -cv '^#' $k.csv)" -eq "$(grep -cv '^#' short.csv)" ]
	done
	# A cut of the second repetition and that of the last are one, but for name and time.
	for cut in 22 3970; do
		read -r bytes kB < <(cost incise export long.rec --cut $cut --no-lineage -o $cut.csv)
		echo "cut $cut: $bytes bytes, $kB kB"
		[ "$bytes" -lt $((size / 30)) ]
		[ "$kB" -lt 60000 ]
		cut -d, -f3- $cut.csv >$cut.values
	done
	[ "$(wc -l <22.values)" -gt 50000 ]
	cmp 22.values 3970.values
	# And a part is learnt from without the rest.
	read -r bytes kB < <(cost incise train long.rec --range 5h..18060s -o part.fis)
	echo "train: $bytes bytes, $kB kB"
	grep -q 'pairs to train (7 cuts)' output.txt
	[ "$bytes" -lt $((size / 6)) ]
	[ "$kB" -lt 60000 ]
}
