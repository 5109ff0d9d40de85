# SPDX-License-Identifier: GPL-2.0-or-later
# driver/abi: what the kernel module has in configfs, sysfs and debugfs, as the kernel's
# Documentation/ABI has it. The attributes are read out of the module's sources.

load cli

setup() {
	work_folder
	abi=$root/driver/abi
	groups=/sys/kernel/config/incise-stepper
}

# The paths of all attributes that the sources declare.
attributes() {
	sed -nE "s/^STEPPER_MOTOR_(LINE|NUMBER)\((\w+)[,)].*/\2/p" \
		"$root"/driver/stepper_configfs.c | sed "s|^|$groups/<controller>/motor<M>/|"
	sed -nE "s|^CONFIGFS_ATTR(_RO\|_WO)?\(stepper_folder_, (\w+)\);|$groups/<controller>/\2|p" \
		"$root"/driver/stepper_configfs.c
	sed -nE 's|^static DEVICE_ATTR(_RO\|_RW\|_WO)\((\w+)\);|/sys/class/incise/incise-stepper<N>/\2|p' \
		"$root"/driver/*.c
	sed -nE 's|^\t*debugfs_create_file\("(\w+)", .*|/sys/kernel/debug/incise_stepper/<device>/\1|p' \
		"$root"/driver/stepper_debugfs.c
}

# bats test_tags=check
@test "every attribute of the kernel module stands in driver/abi, and nothing else" {
	attributes | sort >there
	[ "$(wc -l <there)" -ge 14 ]
	# Every other one is a folder.
	sed -n 's/^What:[[:space:]]*//p' "$abi"/* | grep -vE "^$groups(/<controller>(/motor<M>)?)?$" | sort >said
	diff there said
}

# bats test_tags=check
@test "each entry of driver/abi has the tags that the kernel asks for" {
	local file
	for file in "$abi"/*; do
		awk -v file="${file##*/}" '
			function ends() {
				if (!what) return
				for (i = 1; i <= 4; i++) if (!(need[i] in has)) { print file ": " what ": no " need[i]; bad = 1 }
			}
			BEGIN { split("Date KernelVersion Contact Description", need) }
			/^What:/ { if (!same) { ends(); delete has }; what = $2; same = 1; next }
			/^(Date|KernelVersion|Contact|Description|Users):/ { sub(/:.*/, "", $1); has[$1]; same = 0; next }
			/^[^#\t ]/ { print file ": neither a tag nor indented: " $0; bad = 1 }
			END { ends(); exit bad }' "$file"
	done
}
