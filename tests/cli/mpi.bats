# SPDX-License-Identifier: GPL-2.0-or-later
# Training by many processes: the same model to the bit for any number of them, and no model where
# one fails.

load cli

setup() {
	command -v mpirun >/dev/null || skip "no mpirun: install openmpi-bin"
	[ -e "$INCISE_BUILD/lib/incise/ranks_mpi.so" ] || skip "built without libopenmpi-dev"
	work_folder
	for i in 1 2 3 4 5; do
		made_pairs | awk -F, -v OFS=, -v by=0.0$i 'NR > 1 { $4 = $4 + by } 1' >s$i.csv
	done
}

# N ARGUMENTS…: train by N processes
train_by() {
	local n=$1
	shift
	# As root too, and with more processes than processors.
	OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_btl_base_warn_component_unused=0 \
		mpirun --oversubscribe -n "$n" incise train "$@" --share mpi
}

@test "1, 2, 3 and 8 processes give the model of one program, to the bit" {
	incise train s?.csv --group cut --check 0.3 -o one.fis --json >one.json 2>/dev/null
	for n in 1 2 3 8; do
		train_by $n s?.csv --group cut --check 0.3 -o $n.fis --json >$n.json 2>/dev/null
		cmp one.fis $n.fis
		cmp one.fis.sd $n.fis.sd
		diff <(grep -v '"model"' one.json) <(grep -v '"model"' $n.json)
	done
	# and the shares of a job array, merged
	for i in 1 2 3 4 5; do
		many_pairs 20 | awk -F, -v OFS=, -v by=0.0$i 'NR > 1 { $4 = $4 + by } 1' >l$i.csv
	done
	incise train s1.csv --group cut --mf 3,3 -o start.fis >/dev/null
	for i in 1 2; do
		incise train l?.csv --share $i/2 --premises start.fis --group cut -o $i.fac >/dev/null
	done
	incise merge ?.fac -o merged.fis >/dev/null
	train_by 3 l?.csv --premises start.fis --group cut -o all.fis >/dev/null
	cmp merged.fis all.fis
}

@test "a bad source of any process is named once, and leaves no model" {
	sed -i '7s/,[^,]*$/,x/' s4.csv
	run --separate-stderr train_by 3 s?.csv -o m.fis
	[ "$status" -ne 0 ]
	[ "$(grep -c "^incise train: s4.csv:7: " <<<"$stderr")" -eq 1 ]
	[ ! -e m.fis ]
}

@test "a process that is killed leaves no model" {
	for i in 1 2 3; do
		made_pairs | awk -F, -v OFS=, -v by=0.$i 'NR == 1 { print; next }
			{ for (k = 0; k < 1000; k++) print $1, $2, $3, $4 + by }' >s$i.csv
	done
	train_by 3 s?.csv -o m.fis >/dev/null 2>&1 3>&- &
	mpirun=$!
	for ((i = 0; i < 9600; i++)); do
		victim=$(pgrep -P $mpirun -n -f 'train s1.csv' || pgrep -P "$(pgrep -P $mpirun | head -n 1)" -n || :)
		[ -z "$victim" ] || break
		sleep 0.05
	done
	kill -KILL "$victim"
	! wait $mpirun
	[ ! -e m.fis ]
}
