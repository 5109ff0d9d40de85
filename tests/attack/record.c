// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A recording of the virtual rig with its camera, to be attacked: record NAME.rec MS.
 */
#include <stdio.h>
#include <stdlib.h>
#include <incise/capture.h>

int main(int argc, char **argv)
{
	struct incise_calibration calibration;
	struct incise_capture_options options = {.recorder.calibration = &calibration};
	struct incise_capture_result result;
	struct incise_error err = {0};
	struct incise_rig *rig;
	int rc;

	if (argc != 3) {
		fprintf(stderr, "usage: record NAME.rec MS\n");
		return 2;
	}
	incise_calibration_nominal(&calibration);
	rig = incise_rig_open("sim:clock=simulated",
			      INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_CAMERA,
			      &err);
	options.duration_s = atof(argv[2]) * 1e-3;
	rc = rig ? incise_capture_run(argv[1], rig, &options, &result, &err) : -1;
	if (rc)
		fprintf(stderr, "%s\n", err.text);
	incise_rig_close(rig);
	return rc ? 1 : 0;
}
