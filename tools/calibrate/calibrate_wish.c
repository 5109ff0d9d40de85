// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What is asked of every incise calibrate; see calibrate_wish.h.
 */
#include <errno.h>
#include <getopt.h>
#include <string.h>
#include <sys/stat.h>
#include "calibrate_wish.h"

bool calibrate_option(struct calibrate_wish *wish, int id)
{
	switch (id) {
	case 'r':
		wish->rig = optarg;
		return true;
	case 'c':
		wish->calibration = optarg;
		return true;
	case CALIBRATE_FROM:
		wish->from = optarg;
		return true;
	case CALIBRATE_KEEP:
		wish->keep = optarg;
		return true;
	case CALIBRATE_REPORT:
		wish->report = optarg;
		return true;
	case CALIBRATE_DRY_RUN:
		wish->dry_run = true;
		return true;
	case CALIBRATE_JSON:
		wish->json = true;
		return true;
	default:
		return false;
	}
}

void calibrate_find(struct calibrate_wish *wish)
{
	struct incise_error err = {0};
	int rc;

	if (!wish->calibration)
		wish->calibration = "calibration.conf";
	rc = incise_calibration_load(wish->calibration, &wish->found, &err);
	if (rc == -ENOENT)
		incise_calibration_nominal(&wish->found);
	else if (rc)
		cli_fail_with(&err);
}

void calibrate_begin(struct calibrate_wish *wish)
{
	if (wish->from && wish->rig)
		cli_usage("--from and --rig: one source at a time");
	if (wish->from && wish->keep)
		cli_usage("--keep: what comes --from a file is kept there already");
	calibrate_find(wish);
	if (wish->report && mkdir(wish->report, 0777) && errno != EEXIST)
		cli_fail("%s: %s", wish->report, strerror(errno));
}
