// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * calibration.conf, between raw readings and millimetres and newtons; see
 * incise/calibration.h.
 */
#include <errno.h>
#include <math.h>
#include <incise/calibration.h>
#include "conf.h"

void incise_calibration_nominal(struct incise_calibration *calibration)
{
	*calibration = (struct incise_calibration){
		.force_mV_N = 1240,
		.force_zero_mV = NAN,
		.depth_mm_px = 47.5 / 400,
	};
}

int incise_calibration_load(const char *path, struct incise_calibration *calibration,
			    struct incise_error *err)
{
	static const char *const keys[] = {"force_mV_N", "force_zero_mV", "depth_mm_px",
					   NULL};
	struct incise_calibration loaded;
	const config_setting_t *root;
	config_t config;
	int rc;

	rc = incise_conf_read(&config, path, err);
	if (rc)
		return rc;
	incise_calibration_nominal(&loaded);
	root = config_root_setting(&config);
	rc = incise_conf_known(root, path, keys, err);
	if (!rc)
		rc = incise_conf_number(root, path, "force_mV_N", 1, 100000,
					&loaded.force_mV_N, err);
	if (!rc)
		rc = incise_conf_number(root, path, "force_zero_mV", -10000, 10000,
					&loaded.force_zero_mV, err);
	if (!rc)
		rc = incise_conf_number(root, path, "depth_mm_px", 0.0001, 10,
					&loaded.depth_mm_px, err);
	config_destroy(&config);
	if (rc) {
		/* One errno for every fault of the file, as the header promises. */
		if (err)
			err->code = EINVAL;
		errno = EINVAL;
		return -EINVAL;
	}
	*calibration = loaded;
	return 0;
}
