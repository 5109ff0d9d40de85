# SPDX-License-Identifier: GPL-2.0-or-later
# incise serve --ros2: topics for programs of others, Cyclone DDS for Python and Fast DDS (tests/ros2), and for
# those who send damaged datagrams. Each test has a network of its own with lo alone. ROS 2 itself was not there.

load cli

setup() {
	work_folder
	peers="$INCISE_BUILD/tests/ros2"
	[ -e "$INCISE_BUILD/lib/incise/outlet_ros2.so" ] || skip "built without cyclonedds-dev"
	alone=(unshare --net)
	[ "$(id -u)" = 0 ] || alone=(unshare --map-root-user --net)
	"${alone[@]}" ip link set lo up || skip "no network of its own for a test: unshare or ip does not work here"
	# what interface=lo sets, for others
	export alone_uri='<General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
	unset CYCLONEDDS_URI ROS_DOMAIN_ID ROS_LOCALHOST_ONLY ROS_AUTOMATIC_DISCOVERY_RANGE
}

has_python() {
	[ -e "$peers/ready" ] || skip "cyclonedds of Python is not there; see build/tests/ros2/venv.log"
}

# Run the script on standard input in a network of its own; all of it ends with it.
in_network() {
	{
		cat <<-'END'
			trap 'kill $(jobs -p) 2>/dev/null || :; wait' EXIT
			ip link set lo up
			stop() { # the server: its report is then in report.json
				kill -INT "$server"
				wait "$server"
			}
		END
		cat
	} >script
	run "${alone[@]}" bash -eu script 3>&-
	[ "$status" = 0 ] || complain "$output"
}

@test "topics of ROS 2: the values and times of a recording, read by Cyclone DDS for Python" {
	has_python
	export CYCLONEDDS_URI=$alone_uri
	incise capture -o a.rec --rig "sim:clock=simulated,cut_s=1,pause_s=0.6,seed=3" --duration 5s
	export peers
	in_network <<-'END'
		incise serve a.rec --ros2 /lab/neck --igtl 0 --endless --rate 200 --json >report.json &
		server=$!
		topics="lab/neck/measured_cp=PoseStamped lab/neck/measured_cf=WrenchStamped lab/neck/events=Log"
		"$peers/read" 0 300 default $topics >default.json
		"$peers/read" 0 10 sensor $topics >sensor.json
		stop
	END
	sqlite3 a.rec/recording.db "SELECT t_ns, quote(x_mm), quote(y_mm), quote(z_mm), quote(qw), quote(qx), quote(qy), quote(qz)
		FROM tracker ORDER BY seq" >rows
	python3 - <<-'END'
		import json
		report = json.load(open("report.json"))["ros2"]
		assert report["prefix"] == "lab/neck" and report["poses"] > 200 and report["events"] > 0, report
		rows = [tuple(map(float, line.split("|"))) for line in open("rows")]
		near = {tuple(1e-3 * x for x in row[1:4]): row for row in rows}
		for kind in "default", "sensor":
		    read = json.load(open(kind + ".json"))
		    offsets = set()
		    for s, ns, frame, *pose in read["lab/neck/measured_cp"]["messages"]:
		        row = near[tuple(pose[:3])]
		        assert frame == "tracker", frame
		        # x, y, z, w; of unit length in the message
		        assert all(abs(a - b) < 1e-12 for a, b in zip(pose[3:], row[5:] + row[4:5])), (pose, row)
		        offsets.add(s * 10**9 + ns - int(row[0]))
		    # the recording's clock has a drift of its own
		    assert max(offsets) - min(offsets) < 1e6, (min(offsets), max(offsets))
		    for s, ns, frame, *wrench in read["lab/neck/measured_cf"]["messages"]:
		        assert frame == "scalpel" and abs(wrench[2]) < 20 and wrench[:2] + wrench[3:] == 5 * [0], wrench
		    (s, ns, level, name, text, *rest), = read["lab/neck/events"]["messages"]
		    assert (level, name, rest) == (20, "incise", ["", "", 0]), (level, name, rest)
		    assert json.loads(text)["state"] == "playing", text
		# 200 means a second; a reader that is slow has gaps, and an end of the recording is one
		times = [s * 10**9 + ns for s, ns, *_ in json.load(open("default.json"))["lab/neck/measured_cf"]["messages"]]
		steps = [(b - a) / 5e6 for a, b in zip(times, times[1:])]
		assert sum(abs(step - round(step)) < 0.04 for step in steps) > 0.9 * len(steps), steps[:20]
	END
	# The hashes of types are those that rosbags makes from their definitions.
	[ -e "$INCISE_BUILD/tests/mcap/ready" ] || return 0
	"$INCISE_BUILD/tests/mcap/venv/bin/python" - <<-'END'
		import json
		from rosbags.typesys import Stores, get_typestore
		read = json.load(open("default.json"))
		types = get_typestore(Stores.ROS2_JAZZY)
		for topic, name in ("measured_cp", "geometry_msgs/msg/PoseStamped"), \
		        ("measured_cf", "geometry_msgs/msg/WrenchStamped"), ("events", "rcl_interfaces/msg/Log"):
		    assert read["lab/neck/" + topic]["user_data"] == f"typehash={types.hash_rihs01(name)};", topic
	END
}

@test "topics of ROS 2: Fast DDS reads the command of a loop, in CDR, in the domain of ROS_DOMAIN_ID" {
	[ -x "$peers/fastdds_read" ] || skip "libfastrtps-dev is not installed"
	cp "$root"/scenes/* .
	export peers
	in_network <<-'END'
		export ROS_DOMAIN_ID=7 ROS_LOCALHOST_ONLY=1
		incise haptic wall.scene --rig sim: --no-rt --overruns 0 --duration 1h --state wall.state >/dev/null 2>&1 &
		loop=$!
		until incise status ./wall.state 2>/dev/null | grep -q running; do kill -0 $loop; sleep 0.1; done
		incise serve ./wall.state --ros2 wall --igtl 0 --json >report.json &
		server=$!
		"$peers/fastdds_read" 7 20 rt/wall/measured_cp geometry_msgs::msg::dds_::PoseStamped_ >poses
		"$peers/fastdds_read" 7 20 rt/wall/setpoint_cf geometry_msgs::msg::dds_::WrenchStamped_ >forces
		stop
	END
	python3 - <<-'END'
		import struct
		def messages(path, n):
		    for line in open(path):
		        raw = bytes.fromhex(line)
		        # little-endian CDR; a stamp, "tracker", then doubles at multiples of 8 from behind the head
		        assert raw[:4] == b"\0\1\0\0" and len(raw) == 4 + 24 + 8 * n, raw
		        s, ns, size, frame, *values = struct.unpack_from(f"<iII8s4x{n}d", raw, 4)
		        assert size == 8 and frame == b"tracker\0" and ns < 10**9, (size, frame)
		        yield s * 10**9 + ns, values
		poses, forces = list(messages("poses", 7)), list(messages("forces", 6))
		assert len(poses) == len(forces) == 20
		assert all(abs(sum(x * x for x in p[3:]) - 1) < 1e-9 for _, p in poses)
		assert all(a < b for (a, _), (b, _) in zip(poses, poses[1:]))
		assert all(f[3:] == [0, 0, 0] for _, f in forces)
	END
}

# bats test_tags=check
@test "topics of ROS 2: what is missing or wrong is one line" {
	mkdir -p none
	run -1 --separate-stderr env INCISE_MODULE_PATH=none incise serve --rig sim: --igtl 0 --ros2 a --duration 50ms
	[[ "$stderr" == "incise serve: --ros2: "*cyclonedds-dev* ]] || complain "$stderr"
	run -1 --separate-stderr env CYCLONEDDS_URI='<General><Interfaces><NetworkInterface name="no0"/></Interfaces></General>' \
		incise serve --rig sim: --igtl 0 --ros2 a --duration 50ms
	[[ "${stderr_lines[0]}" == "incise serve: ROS 2 domain 0: Cyclone DDS cannot join it "*no0* ]] || complain "$stderr"
	run -2 --separate-stderr env ROS_DOMAIN_ID=many incise serve --rig sim: --ros2 a
	[[ "${stderr_lines[0]}" == *ROS_DOMAIN_ID* ]] || complain "$stderr"
}

# CASES=100000 for all of it; a build with O=build/check under sanitizers. The seeds differ by their cases.
@test "topics of ROS 2: damaged datagrams end nothing, and memory is bounded" {
	has_python
	export peers root cases=${CASES:-2000}
	in_network <<-'END'
		incise serve --rig sim: --ros2 neck,interface=lo --igtl 0 --json >report.json 2>errors &
		server=$!
		python3 "$root/tests/ros2/attack.py" 0 "$cases" 1 "$server" >sent.json
		grep VmHWM "/proc/$server/status" >memory
		CYCLONEDDS_URI=$alone_uri "$peers/read" 0 20 default neck/measured_cp=PoseStamped >read.json
		stop
	END
	[ ! -s errors ] || complain "$(cat errors)"
	[ "$(jq -c . sent.json)" = "{\"sent\":$cases,\"dropped\":0}" ] || complain "$(cat sent.json)"
	jq -e '."neck/measured_cp".messages | length >= 20' read.json
	jq -e '.ros2.poses > 0' report.json
	# Cyclone DDS forgets participants; 10 MB are mapped before the first datagram.
	awk '{ exit $2 > 200000 }' memory || complain "$(cat memory)"
}
