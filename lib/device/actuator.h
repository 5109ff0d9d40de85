/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading the group `actuator` of rig.conf; see incise/backend.h.
 */
#ifndef INCISE_ACTUATOR_CONF_H
#define INCISE_ACTUATOR_CONF_H

#include <incise/backend.h>
#include "../base/conf.h"

/* Keys of the groups actuator, actuator.can and actuator.lines; they end with NULL. */
extern const char *const incise_actuator_keys[],
	*const incise_actuator_can_keys[], *const incise_actuator_line_keys[];

/* The value of a number in the unit of its key, such as "lead_mm" or "can.following_ms"; false:
 * no number has that key. */
bool incise_actuator_number(const struct incise_actuator *actuator, const char *key,
			    double *value);

/* Read and check the group. 0 or -EINVAL; @err names file, line and key. */
int incise_actuator_read(struct incise_actuator *actuator, const config_setting_t *group,
			 const char *path, struct incise_error *err);

/*
 * Read and check the group `can` within @group; without one all values are defaults.
 * Returns 0 or -EINVAL; err names file, line, key and what to do.
 */
int incise_actuator_can_read(struct incise_actuator_can *can, double travel_mm,
			     const config_setting_t *group, const char *path,
			     struct incise_error *err);

/* The largest accepted position_gain_1_s of csv: half of the stable one. */
double incise_actuator_can_gain_1_s(double cycle_s);

#endif
