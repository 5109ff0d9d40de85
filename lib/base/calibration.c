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
		.force_delay_ms = NAN,
		.force_delay_sd_ms = NAN,
		.tracker_delay_ms = NAN,
		.tracker_delay_sd_ms = NAN,
		.camera_delay_ms = NAN,
		.camera_delay_sd_ms = NAN,
	};
}

int incise_calibration_load(const char *path, struct incise_calibration *calibration,
			    struct incise_error *err)
{
	struct incise_calibration loaded;
	const struct {
		const char *key;
		double low, high, *to;
	} numbers[] = {
		{"force_mV_N", 1, 100000, &loaded.force_mV_N},
		{"force_zero_mV", -10000, 10000, &loaded.force_zero_mV},
		{"depth_mm_px", 0.0001, 10, &loaded.depth_mm_px},
		/* a camera may stamp the end of an exposure: later than its middle, or not */
		{"force_delay_ms", -1000, 1000, &loaded.force_delay_ms},
		{"force_delay_sd_ms", 0, 1000, &loaded.force_delay_sd_ms},
		{"tracker_delay_ms", -1000, 1000, &loaded.tracker_delay_ms},
		{"tracker_delay_sd_ms", 0, 1000, &loaded.tracker_delay_sd_ms},
		{"camera_delay_ms", -1000, 1000, &loaded.camera_delay_ms},
		{"camera_delay_sd_ms", 0, 1000, &loaded.camera_delay_sd_ms},
	};
	enum { NUMBERS = sizeof(numbers) / sizeof(*numbers) };
	const char *keys[NUMBERS + 1] = {NULL};
	const config_setting_t *root;
	config_t config;
	int rc;

	for (int i = 0; i < NUMBERS; i++)
		keys[i] = numbers[i].key;
	rc = incise_conf_read(&config, path, err);
	if (rc)
		return rc;
	incise_calibration_nominal(&loaded);
	root = config_root_setting(&config);
	rc = incise_conf_known(root, path, keys, err);
	for (int i = 0; i < NUMBERS && !rc; i++)
		rc = incise_conf_number(root, path, numbers[i].key, numbers[i].low,
					numbers[i].high, numbers[i].to, err);
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
