// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A recording of the virtual rig with its camera, to be attacked: record NAME.rec MS.
 */
#include <stdio.h>
#include <stdlib.h>
#include <incise/recorder.h>

#define STEP_NS 10000000LL

int main(int argc, char **argv)
{
	struct incise_calibration calibration;
	struct incise_recorder_setup setup = {.calibration = &calibration};
	struct incise_recorder *recorder;
	struct incise_error err = {0};
	struct incise_clock *clock;
	struct incise_rig *rig;
	int64_t end_ns;
	int rc = 0;

	if (argc != 3) {
		fprintf(stderr, "usage: record NAME.rec MS\n");
		return 2;
	}
	incise_calibration_nominal(&calibration);
	rig = incise_rig_open("sim:clock=simulated",
			      INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_CAMERA,
			      &err);
	recorder = rig ? incise_recorder_new(argv[1], rig, &setup, &err) : NULL;
	if (!recorder) {
		fprintf(stderr, "%s\n", err.text);
		return 1;
	}
	clock = incise_rig_clock(rig);
	end_ns = incise_clock_now(clock) + atoll(argv[2]) * 1000000;
	while (!rc && incise_clock_now(clock) < end_ns) {
		incise_clock_wait_until(clock, incise_clock_now(clock) + STEP_NS);
		rc = incise_recorder_poll(recorder, &err);
	}
	if (!rc)
		rc = incise_recorder_close(recorder, &err);
	if (rc)
		fprintf(stderr, "%s\n", err.text);
	incise_rig_close(rig);
	return rc ? 1 : 0;
}
