#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The power fails while a recording is written: what the disk held at a random moment, with any of the
# writes that it had not yet been told to keep, is mounted, and read. The disk is one whose writes and
# flushes the kernel logs (dm-log-writes).
. tests/vm/tap

in_virtual_time "a power cut"
[ "$INCISE_VM_KERNEL" = main ] || skip "a power cut" "one kernel is enough for it"
modprobe -a loop dm-mod dm-log-writes ext4 crc32c_generic 2>/dev/null ||
	skip "a power cut" "this kernel has no dm-log-writes, loop or ext4"
for program in dmsetup mkfs.ext4 losetup; do
	command -v $program >/dev/null || skip "a power cut" "there is no $program"
done
PATH=$INCISE_BUILD/bin:$INCISE_BUILD/tests/vm:$INCISE_BUILD/tests:$PATH
cuts=${INCISE_CUTS:-24}
seed=${INCISE_SEED:-1}
mkdir -p /run/power/disk
cd /run/power || exit 1

# --- a recording on a disk that logs ------------------------------------------------------

truncate -s 48M empty
mkfs.ext4 -q empty || skip "a power cut" "mkfs.ext4 fails"
cp empty now
truncate -s 256M log
disk=$(losetup -f --show now)
log=$(losetup -f --show log)
dmsetup create power --table "0 $(blockdev --getsz "$disk") log-writes $disk $log" || exit 1
dmsetup mknodes
mount -t ext4 /dev/mapper/power disk || exit 1
cat >rig.conf <<-END_OF_RIG
	clock = "real";
	tracker = "sim:";
	force = "sim:";
	sim = { force_hz = 1000.0; pause_s = 60.0; };
END_OF_RIG
# Virtual time goes on while programs are read from the host for the first time.
incise capture -o warm.rec -c none --duration 1s >/dev/null 2>&1
incise info warm.rec >/dev/null 2>&1
incise verify warm.rec >/dev/null 2>&1
sql -readonly warm.rec/recording.db "SELECT 1" >/dev/null
power_cut mark power &
marks=$!
check "a recording is made" incise capture -o disk/a.rec -c none --duration 5s
kill $marks
wait $marks 2>/dev/null
sql -readonly disk/a.rec/recording.db "SELECT min(t_ns), max(t_ns) FROM force" >times
first=$(cut -d'|' -f1 times)
last=$(cut -d'|' -f2 times)
umount disk
dmsetup remove power
losetup -d "$disk" "$log"
n=$(power_cut marks log)
echo "# $n marks in the log; $cuts of them, seed $seed"
check "the log has marks" [ "$n" -gt 100 ]

# --- cuts ---------------------------------------------------------------------------------

# judge: the recording on the disk as it was at a moment. Prints what is lost, ms, or why it is wrong.
judge()
{
	rec=disk/a.rec.part
	want=1
	[ ! -d disk/a.rec ] || rec=disk/a.rec
	[ -d "$rec" ] || {
		echo "there is no recording: $(ls disk)"
		return 1
	}
	incise info "$rec" >said 2>&1 || {
		echo "info: $(cat said)"
		return 1
	}
	[ "$rec" != disk/a.rec ] || want=0
	incise verify "$rec" >said 2>&1
	code=$?
	! grep -q damaged said || want=none
	[ $code = $want ] || {
		echo "verify ends with $code: $(cat said)"
		return 1
	}
	rm -rf copy
	mkdir copy
	cp "$rec"/recording.db* copy/
	had=$(sql copy/recording.db "SELECT max(t_ns) FROM force") || return 1
	until=$t_ns
	[ "$until" -lt "$last" ] || until=$last
	echo $(((until - had) / 1000000))
}

most=0
good=0
i=0
while [ $i -lt "$cuts" ]; do
	i=$((i + 1))
	cp empty cut
	at=$((($(printf '%d' "0x$(echo "$seed $i" | sha256sum | cut -c1-7)")) % n))
	t_ns=$(power_cut cut log cut $at $((seed * 1000 + i))) || good=-1000
	# The first commit is due 100 ms after the first sample.
	[ "$t_ns" -gt $((first + 200000000)) ] || continue
	mount -o loop -t ext4 cut disk || {
		echo "# cut $i, mark $at: the disk does not mount"
		good=-1000
		break
	}
	if lost=$(judge); then
		good=$((good + 1))
		[ "$lost" -le $most ] || most=$lost
	else
		echo "# cut $i, mark $at, $(((t_ns - first) / 1000000)) ms after the first sample: $lost"
		good=-1000
	fi
	umount disk
	[ $((i % 5)) != 0 ] || echo "# $i cuts"
done
echo "# $good cuts behind the first commits; at most $most ms are lost"
check "each disk mounts, each recording opens, none is damaged" [ $good -gt $((cuts / 2)) ]
# 100 ms, and the time that a commit takes
check "a power cut loses 100 ms" [ $most -le 120 ]
cd / || exit 1
rm -r /run/power
