// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * calibration.conf, between raw readings and millimetres and newtons; see
 * incise/calibration.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibration.h>
#include "calibration_file.h"
#include "conf.h"

#define NUMBER(key, unit, low, high)                                                  \
	{                                                                             \
#key, unit, low, high, offsetof(struct incise_calibration, key), NULL \
	}
#define TIP(axis, i)                                                             \
	{                                                                        \
		"tip_" axis "_mm", "mm", -1e6, 1e6,                              \
			offsetof(struct incise_calibration, tip_mm[i]), "tip_mm" \
	}

const struct calibration_key incise_calibration_keys[] = {
	NUMBER(force_mV_N, "mV/N", 1, 100000),
	NUMBER(force_zero_mV, "mV", -10000, 10000),
	NUMBER(depth_mm_px, "mm/px", 0.0001, 10),
	TIP("x", 0),
	TIP("y", 1),
	TIP("z", 2),
	/* a camera may stamp the end of an exposure: later than its middle, or not */
	NUMBER(force_delay_ms, "ms", -1000, 1000),
	NUMBER(force_delay_sd_ms, "ms", 0, 1000),
	NUMBER(tracker_delay_ms, "ms", -1000, 1000),
	NUMBER(tracker_delay_sd_ms, "ms", 0, 1000),
	NUMBER(camera_delay_ms, "ms", -1000, 1000),
	NUMBER(camera_delay_sd_ms, "ms", 0, 1000),
	NUMBER(stepper_N_step, "N", -100, 100),
	NUMBER(stepper_backlash_mm, "mm", 0, 100),
	NUMBER(stepper_hysteresis_N, "N", 0, 1000),
	NUMBER(stepper_stiction_N, "N", 0, 1000),
	NUMBER(stepper_steps_s, "1/s", 0, 1e7),
	{0},
};

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
		.stepper_N_step = NAN,
		.stepper_backlash_mm = NAN,
		.stepper_hysteresis_N = NAN,
		.stepper_stiction_N = NAN,
		.stepper_steps_s = NAN,
	};
}

double *incise_calibration_at(struct incise_calibration *calibration,
			      const struct calibration_key *key)
{
	return (double *)((char *)calibration + key->offset);
}

double incise_calibration_get(const struct incise_calibration *calibration,
			      const char *name)
{
	struct incise_calibration copy = *calibration;

	for (const struct calibration_key *key = incise_calibration_keys; key->name;
	     key++)
		if (!strcmp(key->name, name))
			return *incise_calibration_at(&copy, key);
	return NAN;
}

int incise_calibration_file_read(struct calibration_file *file, const char *path,
				 struct incise_error *err)
{
	const char *names[CALIBRATION_KEYS + 2] = {NULL};
	const struct calibration_key *key;
	const config_setting_t *root;
	config_t config;
	int rc, n = 0;

	*file = (struct calibration_file){0};
	rc = incise_conf_read(&config, path, err);
	if (rc)
		return rc;
	incise_calibration_nominal(&file->in_force);
	root = config_root_setting(&config);
	for (key = incise_calibration_keys; key->name; key++) {
		const char *name = key->vector ? key->vector : key->name;

		file->present[key - incise_calibration_keys] =
			config_setting_get_member(root, name);
		if (!n || names[n - 1] != name)
			names[n++] = name;
	}
	names[n] = "history";
	rc = incise_conf_known(root, path, names, err);
	for (key = incise_calibration_keys; key->name && !rc; key++)
		if (!key->vector)
			rc = incise_conf_number(
				root, path, key->name, key->low, key->high,
				incise_calibration_at(&file->in_force, key), err);
	if (!rc)
		rc = incise_conf_vector(root, path, "tip_mm", file->in_force.tip_mm, err);
	if (!rc)
		rc = incise_calibration_history_read(root, path, &file->records, &file->n,
						     err);
	config_destroy(&config);
	if (rc) {
		/* One errno for every fault of the file, as the header promises. */
		if (err)
			err->code = EINVAL;
		errno = EINVAL;
		return -EINVAL;
	}
	return 0;
}

int incise_calibration_load(const char *path, struct incise_calibration *calibration,
			    struct incise_error *err)
{
	struct calibration_file file;
	int rc = incise_calibration_file_read(&file, path, err);

	if (rc)
		return rc;
	free(file.records);
	*calibration = file.in_force;
	return 0;
}
