/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading the group `actuator` of rig.conf; see incise/backend.h.
 */
#ifndef INCISE_ACTUATOR_CONF_H
#define INCISE_ACTUATOR_CONF_H

#include <incise/backend.h>
#include "../base/settings.h"

/* The keys of the groups actuator, actuator.can and actuator.lines, in a struct incise_actuator. */
extern const struct incise_setting incise_actuator_settings[],
	incise_actuator_can_settings[], incise_actuator_line_settings[];

/* Read and check the group. 0 or -EINVAL; @err names file, line and key. */
int incise_actuator_read(struct incise_actuator *actuator, const config_setting_t *group,
			 const char *path, struct incise_error *err);

/* The largest accepted position_gain_1_s of csv: half of the stable one. */
double incise_actuator_can_gain_1_s(double cycle_s);

#endif
