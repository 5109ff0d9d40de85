/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading the group `actuator` of rig.conf; see incise/backend.h.
 */
#ifndef INCISE_ACTUATOR_CONF_H
#define INCISE_ACTUATOR_CONF_H

#include <incise/backend.h>
#include "../base/settings.h"

/*
 * The keys of the group actuator, and of its groups can, lines and tmc, which the folders of these devices
 * bring: all in a struct incise_actuator.
 */
extern const struct incise_setting incise_actuator_settings[],
	incise_actuator_can_settings[], incise_actuator_line_settings[],
	incise_actuator_tmc_settings[];

/* Read and check the group. 0 or -EINVAL; @err names file, line and key. */
int incise_actuator_read(struct incise_actuator *actuator, const config_setting_t *group,
			 const char *path, struct incise_error *err);

/* The largest accepted position_gain_1_s of csv: half of the stable one. */
double incise_actuator_can_gain_1_s(double cycle_s);

/*
 * Check the keys of lines, in @group, and of @can against each other and the others. 0 or -EINVAL;
 * @err names file, line, key and what to do.
 */
int incise_actuator_lines_check(const struct incise_actuator *actuator,
				const config_setting_t *group, const char *path,
				struct incise_error *err);
int incise_actuator_can_check(const struct incise_actuator *actuator,
			      const config_setting_t *can, const char *path,
			      struct incise_error *err);

/* The same of the group tmc, which a driver of that kind needs; sets the default of hold_A. */
int incise_actuator_tmc_check(struct incise_actuator *actuator,
			      const config_setting_t *group, const char *path,
			      struct incise_error *err);

#endif
